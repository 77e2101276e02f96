"""Contact node, mean rotation and axial spring against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from softehl.runtime.kernels.kernel import load_kernel
from tests.reference.calling import Part, assemble, solve

NORMAL = np.array([0.6, 0.8])
AREA, RHO = 3.0, 50.0
DATA = np.array([[*NORMAL, 20.0, AREA, RHO]])
NODE = np.array([[1.0, 25.0]])  # n . x - c = 0.6 + 20 - 20


def contact(gap: float, multiplier: float, weight: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Residual and tangent of a node at that gap over an obstacle moved by an offset of 0.1."""
    u = (gap - 0.6 + 0.1) * NORMAL
    residual, tangent = load_kernel("contact").tangent(
        NODE, np.array([[*u, multiplier]]), data=DATA, parameters=np.array([0.1, weight])
    )
    return residual[0], tangent[0]


def test_penetrated_node_is_pushed_out_along_the_normal() -> None:
    residual, tangent = contact(-0.02, -3.0, 0.5)
    push = 0.5 * AREA * (-3.0 + RHO * -0.02)
    np.testing.assert_allclose(residual, [*(push * NORMAL), AREA * -0.02], rtol=1e-12)
    assert residual[:2] @ NORMAL < 0  # minus the reaction of the obstacle, which points along n
    stiffness = 0.5 * AREA * RHO * np.outer(NORMAL, NORMAL)
    np.testing.assert_allclose(tangent[:2, :2], stiffness, rtol=1e-12)


def test_open_node_feels_nothing_and_drives_its_multiplier_to_zero() -> None:
    residual, tangent = contact(0.3, -2.0)
    np.testing.assert_allclose(residual, [0, 0, AREA * 2.0 / RHO], rtol=1e-13)
    exact = np.zeros((3, 3))
    exact[2, 2] = -AREA / RHO
    np.testing.assert_allclose(tangent, exact, rtol=1e-13)


@pytest.mark.parametrize("multiplier", [-4.0, -0.5, 2.0])
def test_residual_is_continuous_and_the_tangent_jumps_at_the_switch(multiplier: float) -> None:
    switch, step = -multiplier / RHO, 1e-9
    closed, opened = contact(switch - step, multiplier), contact(switch + step, multiplier)
    assert np.abs(closed[0] - opened[0]).max() < 4 * step * AREA * RHO
    assert np.abs(closed[1] - opened[1]).max() > 1.0
    assert np.abs(opened[1][:2]).max() == 0.0
    assert np.abs(closed[1] - closed[1].T).max() < 1e-13 * AREA * RHO


def test_spring_pressed_on_the_obstacle_finds_signorini_in_both_senses() -> None:
    """A node on a spring with a dead load: contact pressure or gap, never both, (10)."""
    for load, closed in ((-5.0, True), (4.0, False)):
        x = np.zeros(3)
        part = Part("contact", NODE, np.array([[0, 1, 2]]), (0.6, 1.0), data=DATA)  # gap 0 at rest
        for _ in range(5):
            residual, tangent = assemble([part], x)
            residual[:2] += 2.0 * x[:2] - load * NORMAL
            tangent[:2, :2] += 2.0 * np.eye(2)
            x -= np.linalg.solve(tangent, residual)
        gap, pressure = NORMAL @ x[:2], x[2]
        expected = (0.0, load / AREA) if closed else (load / 2.0, 0.0)
        assert (gap, pressure) == pytest.approx(expected, abs=1e-12)
        other = (load / 2.0, 0.0) if closed else (0.0, load / AREA)  # the wrong branch is caught
        assert (gap, pressure) != pytest.approx(other, abs=1e-2)
        assert gap >= -1e-12 >= pressure - 1e-11


# ------------------------------------------------------------------------ rotation and spring

WIDTH, HEIGHT, MIDDLE = 2.0, 3.0, np.array([0.4, 26.0])
POLAR = WIDTH * HEIGHT * (WIDTH**2 + HEIGHT**2) / 12


def rectangle(count: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and cells of a rectangle about MIDDLE with its inner nodes moved at random."""
    line = np.linspace(-0.5, 0.5, count + 1)
    nodes = np.array([(WIDTH * z, HEIGHT * r) for r in line for z in line])
    inner = np.all(np.abs(nodes) < 0.49 * np.array([WIDTH, HEIGHT]), axis=1)
    nodes[inner] += 0.2 * np.random.default_rng(4).uniform(-1, 1, (inner.sum(), 2))
    corner = np.add.outer((count + 1) * np.arange(count), np.arange(count)).ravel()
    cells = corner[:, None] + np.array([0, 1, count + 2, count + 1])
    return nodes + MIDDLE, cells


def section(family: str, parameters: tuple[float, ...], extra: bool = False) -> Part:
    nodes, cells = rectangle()
    maps = (2 * cells[:, :, None] + np.arange(2)).reshape(len(cells), 8)
    if extra:
        maps = np.hstack([maps, np.full((len(cells), 1), 2 * len(nodes))])
    return Part(family, nodes[cells].reshape(len(cells), 8), maps, parameters)


def rotation_row(u: np.ndarray, angle: float) -> float:
    part = section("mean_rotation", (*MIDDLE, POLAR, angle), extra=True)
    return float(assemble([part], np.array([*u.ravel(), 7.0]))[0][-1])


def test_mean_rotation_measures_a_small_rigid_rotation_and_no_translation() -> None:
    """On any mesh of the rectangle, with the closed-form polar moment b h (b^2 + h^2) / 12."""
    nodes, _ = rectangle()
    arm = nodes - MIDDLE
    turn = 0.03 * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
    assert rotation_row(turn, 0.0) == pytest.approx(0.03, rel=1e-12)
    assert rotation_row(turn, 0.03) == pytest.approx(0.0, abs=1e-14)
    assert rotation_row(turn, -0.01) == pytest.approx(0.04, rel=1e-12)
    assert rotation_row(np.ones_like(nodes) * (0.5, -0.2), 0.0) == pytest.approx(0.0, abs=1e-14)
    assert rotation_row(-turn, 0.0) != pytest.approx(0.03, rel=0.1)  # the sense matters


def test_moment_does_its_work_and_has_no_resultant() -> None:
    nodes, _ = rectangle()
    part = section("mean_rotation", (*MIDDLE, POLAR, 0.02), extra=True)
    total, tangent = assemble([part], np.array([*np.zeros(nodes.size), 7.0]))
    forces, arm = total[:-1].reshape(-1, 2), nodes - MIDDLE
    assert np.abs(forces.sum(axis=0)).max() < 1e-13
    assert (arm[:, 0] * forces[:, 1] - arm[:, 1] * forces[:, 0]).sum() == pytest.approx(7.0)
    np.testing.assert_allclose(tangent, tangent.T, atol=1e-15)
    assert not tangent[:-1, :-1].any()
    assert tangent[-1, -1] == 0.0


def test_mean_axial_displacement_and_its_force() -> None:
    """A rigid shift less the prescribed place; N pulls the section back by -N, and nothing else."""
    nodes, _ = rectangle()
    part = section("mean_axial", (WIDTH * HEIGHT, 0.02), extra=True)
    shifted = np.ones_like(nodes) * (0.5, -0.2)
    total, tangent = assemble([part], np.array([*shifted.ravel(), 7.0]))
    assert total[-1] == pytest.approx(0.48, rel=1e-12)
    assert total[:-1].reshape(-1, 2).sum(axis=0) == pytest.approx([7.0, 0.0], abs=1e-12)
    np.testing.assert_allclose(tangent, tangent.T, atol=1e-15)
    assert not tangent[:-1, :-1].any()


def test_axial_spring_stores_the_closed_form_energy() -> None:
    """stiffness / 2 times the area for a shift; times the second moment for u_z = a (R - Rc)."""
    nodes, cells = rectangle()
    part = section("axial_spring", (0.7,))
    kernel, maps = part.kernel, part.maps
    for field, moment in (
        (np.ones(len(nodes)) * 0.2, 0.04 * WIDTH * HEIGHT),
        (0.1 * (nodes[:, 1] - MIDDLE[1]), 0.01 * WIDTH * HEIGHT**3 / 12),
    ):
        u = np.stack([field, np.sin(field)], axis=1).ravel()
        energy = kernel.energy(part.coordinates, u[maps], parameters=part.parameters).sum()
        assert energy == pytest.approx(0.7 / 2 * moment, rel=1e-12)
        assert energy != pytest.approx(0.7 / 2 * moment * MIDDLE[1], rel=0.1)  # no factor of r
        total, tangent = assemble([part], u)
        assert u @ total == pytest.approx(2 * energy, rel=1e-12)
        assert not total[1::2].any()
        np.testing.assert_allclose(tangent @ u, total, atol=1e-14)
    assert len(cells) == 9


def test_spring_alone_finds_the_mean_of_its_load() -> None:
    """A uniform shift under a total force F is F / (stiffness area)."""
    nodes, _ = rectangle()
    part = section("axial_spring", (0.7,))
    ones = np.zeros(nodes.size)
    ones[0::2] = 1.0
    total, _ = assemble([part], ones)
    assert total.sum() == pytest.approx(0.7 * WIDTH * HEIGHT, rel=1e-12)
    x = solve([part], ones.copy(), np.arange(0, nodes.size, 2))
    assert np.abs(x).max() < 1e-12
