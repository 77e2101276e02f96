"""Follower pressure (8) on closed rings and single segments against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from softehl.runtime.kernels.kernel import load_kernel
from tests.reference.calling import Part, assemble, call
from tests.reference.states import boundary_states

PRESSURE = 1.7


def ring(sides: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """A counterclockwise polygon around (0.2, 5) and a displacement that deforms it strongly."""
    angle = 2 * np.pi * np.arange(sides) / sides
    nodes = np.stack([0.2 + np.cos(angle), 5 + np.sin(angle)], axis=1)
    u = np.stack([0.3 * np.sin(2 * angle) + 0.4, 0.2 * np.cos(3 * angle) - 0.1], axis=1)
    return nodes, u


def segments(nodes: np.ndarray, closed: bool, pressure: float = PRESSURE) -> Part:
    count = len(nodes) if closed else len(nodes) - 1
    pairs = np.stack([np.arange(count), (np.arange(count) + 1) % len(nodes)], axis=1)
    maps = (2 * pairs[:, :, None] + np.arange(2)).reshape(count, 4)
    return Part("follower_pressure", nodes[pairs].reshape(count, 4), maps, (pressure,))


def enclosed_volume(x: np.ndarray) -> float:
    """Volume of the ring body of a counterclockwise polygon: integral of pi r^2 dz by edges."""
    z, r = x[:, 0], x[:, 1]
    z2, r2 = np.roll(z, -1), np.roll(r, -1)
    return float(-np.sum(np.pi * (z2 - z) * (r * r + r * r2 + r2 * r2) / 3))


def enclosed_area(x: np.ndarray) -> float:
    """Area of the counterclockwise polygon (shoelace)."""
    z, r = x[:, 0], x[:, 1]
    return float(0.5 * np.sum(z * np.roll(r, -1) - np.roll(z, -1) * r))


def test_closed_ring_has_no_axial_resultant_and_the_radial_one_of_its_area() -> None:
    nodes, u = ring()
    total, _ = assemble([segments(nodes, closed=True)], u.ravel())
    scale = np.abs(total).max()
    assert abs(total[0::2].sum()) < 1e-12 * scale
    radial = 2 * np.pi * PRESSURE * enclosed_area(nodes + u)
    assert total[1::2].sum() == pytest.approx(radial, rel=1e-12)


def test_open_boundary_carries_pressure_times_projected_annulus() -> None:
    nodes, u = ring()
    for stop in (2, 7, 13, 20):
        part = segments(nodes[:stop], closed=False)
        total, _ = assemble([part], u[:stop].ravel())
        r = (nodes + u)[[0, stop - 1], 1]
        exact = PRESSURE * np.pi * (r[1] ** 2 - r[0] ** 2)
        assert total[0::2].sum() == pytest.approx(exact, rel=1e-11)
        undeformed = PRESSURE * np.pi * (nodes[stop - 1, 1] ** 2 - nodes[0, 1] ** 2)
        assert undeformed != pytest.approx(exact, rel=1e-3)  # the reference area would be caught


def test_closed_ring_is_the_gradient_of_pressure_times_volume() -> None:
    nodes, u = ring()
    total, tangent = assemble([segments(nodes, closed=True)], u.ravel())
    step, gradient = 1e-4, np.zeros(u.size)
    for i in range(u.size):  # the volume is a cubic: Richardson's differences are exact
        volumes = []
        for factor in (1, -1, 2, -2):
            moved = u.ravel().copy()
            moved[i] += factor * step
            volumes.append(enclosed_volume(nodes + moved.reshape(-1, 2)))
        near, far = volumes[0] - volumes[1], volumes[2] - volumes[3]
        gradient[i] = (8 * near - far) / (12 * step)
    np.testing.assert_allclose(total, PRESSURE * gradient, atol=2e-9 * np.abs(total).max())
    assert np.abs(tangent - tangent.T).max() < 1e-13 * np.abs(tangent).max()
    broken, _ = assemble([segments(nodes, closed=False)], u.ravel())  # one segment left out
    assert np.abs(broken - PRESSURE * gradient).max() > 1e-3 * np.abs(total).max()


def test_nodal_forces_of_one_deformed_segment() -> None:
    """Integral of N_a r n ds by hand: (2 r1 + r2) / 6 and (r1 + 2 r2) / 6 of the segment."""
    for state in (s for s in boundary_states() if s.family == "follower_pressure"):
        z1, r1, z2, r2 = np.array(state.coordinates) + np.array(state.dofs)
        forces = call("residual", state)[0]
        share = 2 * np.pi * state.parameters[0] * np.array([2 * r1 + r2, r1 + 2 * r2]) / 6
        exact = np.outer(share, [r2 - r1, z1 - z2]).ravel()
        np.testing.assert_allclose(forces, exact, rtol=1e-13)
        swapped = np.outer(share[::-1], [r2 - r1, z1 - z2]).ravel()
        assert np.abs(forces - swapped).max() > 1e-5 * np.abs(forces).max()


def test_pressure_pushes_a_counterclockwise_body_inwards() -> None:
    """A segment along +z below the body: the load is upwards, the residual is minus the load."""
    X = np.array([[0.0, 2.0, 1.0, 2.0]])
    forces = load_kernel("follower_pressure").residual(
        X, np.zeros((1, 4)), parameters=np.array([PRESSURE])
    )[0]
    np.testing.assert_allclose(forces, -np.array([0, 1, 0, 1]) * 2 * np.pi * PRESSURE, atol=1e-12)
