"""Solids against theory: patches, a thick cylinder, rolling with friction."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad as integrate

from softehl import Mesh, Study
from softehl.runtime.arrays import Array
from softehl.runtime.kernels.kernel import load_kernel
from softehl.runtime.results.result import Result
from tests.reference.calling import Part, assemble, call, fitted_order, solve
from tests.reference.states import SOLIDS, State, displacement, quad, solid_states

# --- Patch test, rigid motion, symmetry and objectivity of the axisymmetric solids ----------------


PAPER = (3.04, 0.62, 500.0)
CELLS = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
INNER = 4  # the only node that no boundary force acts on
AXIAL = np.tile([1.0, 0.0], 4)


def patch(shape: str) -> np.ndarray:
    """Nine nodes (9, 2) of four quads: a skewed grid, a graded one or one with a moved middle."""
    lines = np.array([0.0, 0.3, 0.8]) if shape == "graded" else np.array([0.0, 0.4, 0.8])
    nodes = np.array([(z, r) for r in lines for z in lines])
    if shape == "skewed":
        nodes = nodes @ np.array([[1.0, 0.2], [0.3, 1.0]])
    if shape == "distorted":
        nodes[INNER] += (0.11, -0.07)
        nodes[1] += (0.05, 0.06)
        nodes[5] += (-0.04, 0.08)
    return np.asarray(nodes + np.array([0.1, 2.0]))


def part(family: str, nodes: np.ndarray) -> Part:
    maps = (2 * CELLS[:, :, None] + np.arange(2)).reshape(4, 8)
    return Part(family, nodes[CELLS].reshape(4, 8), maps, PAPER)


def imbalance(family: str, shape: str, stretch: tuple[float, float], offset: float = 0.0) -> float:
    """Inner node's force under u_z = a Z, u_r = b (R + offset), over the largest element force."""
    nodes = patch(shape)
    u = (nodes + np.array([0.0, offset])) * stretch
    patch_part = part(family, nodes)
    total, _ = assemble([patch_part], u.ravel())
    largest = np.abs(patch_part.elements(u.ravel())[0]).max()
    return float(np.abs(total[2 * INNER : 2 * INNER + 2]).max() / largest)


@pytest.mark.parametrize(
    ("family", "shape"),
    [(f, s) for f in SOLIDS for s in ("skewed", "graded", "distorted")
     if not (f == "solid_taylor" and s == "distorted")],
)  # fmt: skip
def test_patch_of_homogeneous_strain_is_in_equilibrium(family: str, shape: str) -> None:
    """Equal radial and hoop stretch leaves no force on the inner node, and a uniform stress.

    With P constant, P_rr = P_tt and no shear the exact weak form (1) vanishes; 2x2 points
    integrate it exactly on any quad.  The paper's Taylor-expanded element drops the xi eta terms
    of the gradient and of u_r, so it passes on parallelograms only; that about the means passes.
    """
    for stretch in ((0.25, -0.1), (-0.15, 0.3), (1e-3, 2e-3)):
        assert imbalance(family, shape, stretch) < 2e-12
        nodes = patch(shape)
        fields = part(family, nodes).fields((nodes * stretch).ravel())
        a, b = 1 + stretch[0], 1 + stretch[1]
        np.testing.assert_allclose(fields["J"], a * b * b, rtol=1e-13)
        for name in ("sigma_zz", "sigma_rr", "sigma_tt"):
            exact = cauchy(a, b)[name]
            np.testing.assert_allclose(fields[name], exact, rtol=0, atol=1e-11 * max(abs(exact), 1))
        assert np.abs(fields["sigma_zr"]).max() < 1e-11


def cauchy(a: float, b: float) -> dict[str, float]:
    """Closed form of (2)-(6) for the stretches (a, b, b): J sigma = 2 dev(...) + J dW_v/dJ."""
    mu_1, mu_2, kappa = PAPER
    J = a * b * b
    first, second = J ** (-2 / 3), J ** (-4 / 3)
    # deviators of Bbar and of Bbar^{-1} for diag(a^2, b^2, b^2)
    difference = mu_1 * first * (a**2 - b**2) + mu_2 * second * (a**2 * b**2 - b**4)
    pressure = kappa / 2 * (J - 1 / J)
    axial, radial = pressure + 2 / 3 * difference / J, pressure - difference / J / 3
    return {"sigma_zz": axial, "sigma_rr": radial, "sigma_tt": radial}


def test_patch_test_rejects_a_field_that_is_not_in_equilibrium() -> None:
    for family in SOLIDS:
        assert imbalance(family, "skewed", (0.2, 0.1), offset=0.05) > 1e-5
        assert abs(cauchy(1.2, 1.1)["sigma_zz"] - cauchy(1.2, 1.1 + 1e-9)["sigma_zz"]) > 1e-8


def test_taylor_element_misses_the_patch_of_general_quads_by_a_little() -> None:
    """What the expansion costs, kept in sight: neither exact nor more than a few per cent."""
    assert 1e-6 < imbalance("solid_taylor", "distorted", (0.25, -0.1)) < 5e-2


def softest(family: str, X: np.ndarray) -> float:
    """The least stiffness at rest but that of axial shifts, over the middle one."""
    K = load_kernel(family).tangent(X[None], 0 * X[None], parameters=np.array(PAPER))[1][0]
    values = np.sort(np.linalg.eigvalsh((K + K.T) / 2 + np.outer(AXIAL, AXIAL) * np.abs(K).max()))
    return float(values[0] / values[3])


def convex(X: np.ndarray) -> bool:
    sides = np.roll(X.reshape(4, 2), -1, axis=0) - X.reshape(4, 2)
    after = np.roll(sides, -1, axis=0)
    return bool((sides[:, 0] * after[:, 1] - sides[:, 1] * after[:, 0]).min() > 0.1 * 0.1**2)


@pytest.mark.parametrize("distortion", [0.15, 0.4])
def test_no_mode_of_a_distorted_element_is_without_stiffness(distortion: float) -> None:
    """Hourglass modes of the element about the means are as stiff as those of the paper's."""
    quads = [quad(np.random.default_rng(s), 25.0, 0.1, distortion) for s in range(100)]
    quads = [X for X in quads if convex(X)]
    assert len(quads) > 30
    for X in quads:
        assert softest("solid_taylor_mean", X) > 0.9 * softest("solid_taylor", X) > 0.0
    if distortion > 0.3:  # F-bar, whose volume is that of one point, fails the same test
        assert min(softest("solid_fbar", X) for X in quads) < 0.0


@pytest.mark.parametrize("state", list(solid_states()), ids=lambda s: s.id)
def test_axial_translation_is_rigid(state: State) -> None:
    """No axial resultant, and the translation is a left and right null vector of the tangent."""
    residual, tangent = (values[0] for values in call("tangent", state))
    assert abs(AXIAL @ residual) < 1e-12 * np.abs(residual).max()
    scale = np.abs(tangent).max()
    assert np.abs(tangent @ AXIAL).max() < 1e-12 * scale
    assert np.abs(AXIAL @ tangent).max() < 1e-12 * scale
    radial = np.roll(AXIAL, 1)  # a radial shift stretches the hoops: it must not be null
    assert np.abs(tangent @ radial).max() > 1e-5 * scale


@pytest.mark.parametrize("family", SOLIDS)
def test_translated_stress_free_element_carries_no_force(family: str) -> None:
    X = quad(np.random.default_rng(3), 25.0, 0.1)
    kernel = load_kernel(family)
    for shift in (0.0, 0.7, -3.0):
        residual, tangent = kernel.tangent(X[None], shift * AXIAL[None], parameters=np.array(PAPER))
        assert np.abs(residual).max() < 1e-13 * np.abs(tangent).max()
    strained = kernel.residual(X[None], 1e-6 * X[None], parameters=np.array(PAPER))
    assert np.abs(strained).max() > 1e-7 * np.abs(tangent).max() * 0.1


@pytest.mark.parametrize("state", list(solid_states()), ids=lambda s: s.id)
def test_tangent_is_symmetric_where_a_potential_exists(state: State) -> None:
    tangent = call("tangent", state)[1][0]
    skew = np.abs(tangent - tangent.T).max() / np.abs(tangent).max()
    if state.family == "solid_fbar":
        assert skew > 1e-4
    else:
        assert skew < 1e-13


def turned(X: np.ndarray, u: np.ndarray, angle: float, radius: float) -> np.ndarray:
    """Displacements after a rotation of the deformed section about (0, radius)."""
    centre = np.array([0.0, radius])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    x = (X + u).reshape(4, 2) - centre
    return np.asarray(np.ravel(x @ turn.T + centre) - X)


@pytest.mark.parametrize("family", SOLIDS)
def test_objectivity_in_the_limit_of_a_large_ring(family: str) -> None:
    """Turning the deformed section turns its forces, up to hoop strains of the order L / R."""
    angle, radii, errors = 0.7, (1e2, 1e3, 1e4), []
    rng = np.random.default_rng(8)
    flat = quad(rng, 0.0, 0.5)
    u = displacement(rng, flat + np.tile([0.0, 100.0], 4), 0.3, 0.0)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    for radius in radii:
        X = flat + np.tile([0.0, radius], 4)
        both = np.array([u, turned(X, u, angle, radius)])
        forces = load_kernel(family).residual(np.array([X, X]), both, parameters=np.array(PAPER))
        expected = (forces[0].reshape(4, 2) @ turn.T).ravel()
        errors.append(np.abs(forces[1] - expected).max() / np.abs(forces[0]).max())
        assert np.abs(forces[1] - forces[0]).max() > 0.1 * np.abs(forces[0]).max()
    assert -1.05 < fitted_order(radii, errors) < -0.95


@pytest.mark.parametrize("family", SOLIDS)
def test_mirror_image_has_mirrored_forces(family: str) -> None:
    state = next(s for s in solid_states() if s.family == family)
    X, u = np.array(state.coordinates).reshape(4, 2), np.array(state.dofs).reshape(4, 2)
    mirror, order = np.array([-1.0, 1.0]), [1, 0, 3, 2]  # keeps the corners counterclockwise
    forces = load_kernel(family).residual(
        np.array([X.ravel(), (X * mirror)[order].ravel()]),
        np.array([u.ravel(), (u * mirror)[order].ravel()]),
        parameters=np.array(PAPER),
    )
    image = (forces[0].reshape(4, 2) * mirror)[order].ravel()
    np.testing.assert_allclose(forces[1], image, rtol=0, atol=1e-11 * np.abs(forces).max())


# --- Pressurised thick-walled Mooney-Rivlin cylinder with an axial stretch against its closed -----


INSIDE, OUTER, HEIGHT = 1.0, 2.0, 0.3
MU = (1.0, 0.6)
KAPPA = 1e7  # compressibility changes the pressure by about MU / KAPPA
BORE = 1.4  # deformed inner radius of the closed form


def radius(R: float, stretch: float, bore: float = BORE) -> float:
    return float(np.sqrt(bore**2 + (R**2 - INSIDE**2) / stretch))


def exact_pressure(stretch: float, bore: float = BORE, mu: tuple[float, float] = MU) -> float:
    """The closed-form integral (MPa)."""

    def integrand(r: float) -> float:
        R = np.sqrt(INSIDE**2 + stretch * (r**2 - bore**2))
        hoop, radial = r / R, R / (r * stretch)
        first, second = hoop**2 - radial**2, hoop**-2 - radial**-2
        return float((mu[0] * first - mu[1] * second) / r)

    return float(integrate(integrand, bore, radius(OUTER, stretch, bore), epsabs=1e-14)[0])


def cylinder(family: str, count: int, pressure: float, kappa: float = KAPPA) -> list[Part]:
    """One row of elements through the wall, numbered (bottom, top) from the bore outwards."""
    R = np.linspace(INSIDE, OUTER, count + 1)
    nodes = np.array([(z, r) for r in R for z in (0.0, HEIGHT)])
    column = 2 * np.arange(count)[:, None]
    cells = column + np.array([[0, 1, 3, 2]])
    maps = (2 * cells[:, :, None] + np.arange(2)).reshape(count, 8)
    # the bore runs along +z: the solid is on its left
    return [
        Part(family, nodes[cells].reshape(count, 8), maps, (*MU, kappa)),
        Part("follower_pressure", nodes[:2].reshape(1, 4), np.array([[0, 1, 2, 3]]), (pressure,)),
    ]


def bore_of(
    family: str,
    count: int,
    pressure: float,
    stretch: float = 1.0,
    *,
    kappa: float = KAPPA,
    guess: float = BORE,
) -> float:
    """Deformed inner radius under the pressure, axial displacements prescribed."""
    parts = cylinder(family, count, pressure, kappa)
    R = np.linspace(INSIDE, OUTER, count + 1)
    x = np.zeros(4 * (count + 1))
    x[2::4] = (stretch - 1) * HEIGHT
    x[1::4] = x[3::4] = [radius(r, stretch, guess) - r for r in R]
    u = solve(parts, x, np.arange(1, x.size, 2), tolerance=1e-9)  # kappa / mu takes six digits
    assert u[1] == pytest.approx(u[3], abs=1e-9)
    return INSIDE + float(u[1])


@pytest.mark.parametrize("stretch", [1.0, 0.8])
@pytest.mark.parametrize("family", ["solid_fbar", "solid_taylor", "solid_taylor_mean"])
def test_bore_converges_with_second_order_to_the_closed_form(family: str, stretch: float) -> None:
    counts = (8, 16, 32, 64)
    pressure = exact_pressure(stretch)
    errors = [abs(bore_of(family, n, pressure, stretch) - BORE) for n in counts]
    assert errors[-1] < 2e-5 * (BORE - INSIDE)
    assert 1.95 < -fitted_order(counts, errors) < 2.1


@pytest.mark.parametrize("family", ["solid_fbar", "solid_taylor", "solid_taylor_mean"])
def test_a_wrong_pressure_or_material_is_noticed(family: str) -> None:
    """A material with mu_2 counted as mu_1 agrees in plane strain only, as it should."""
    swapped = (MU[0] + MU[1], 0.0)
    assert exact_pressure(1.0, mu=swapped) == pytest.approx(exact_pressure(1.0), rel=1e-12)
    counts = (4, 8, 16)
    wrong = [abs(bore_of(family, n, exact_pressure(0.8, mu=swapped), 0.8) - BORE) for n in counts]
    assert not 1.85 < -fitted_order(counts, wrong) < 2.1


def test_plain_element_locks_and_so_fails_the_same_test() -> None:
    counts, bore = (4, 8, 16), 1.05
    pressure = exact_pressure(1.0, bore)
    errors = [abs(bore_of("solid_q4", n, pressure, guess=INSIDE) - bore) for n in counts]
    assert errors[0] > 0.1 * (bore - INSIDE)
    assert not 1.85 < -fitted_order(counts, errors) < 2.1


def test_reactions_balance_the_pressure_on_a_shell_between_two_radii() -> None:
    """At the solution the free rows vanish; the axial reactions carry the axial stress alone."""
    pressure = exact_pressure(1.0)
    parts = cylinder("solid_fbar", 8, pressure)
    x = np.zeros(36)
    R = np.linspace(INSIDE, OUTER, 9)
    x[1::4] = x[3::4] = [radius(r, 1.0) - r for r in R]
    x = solve(parts, x, np.arange(1, 36, 2), tolerance=1e-9)
    total, _ = assemble(parts, x)
    assert np.abs(total[1::2]).max() < 1e-7 * np.abs(total).max()
    assert total[0::4].sum() == pytest.approx(-total[2::4].sum(), rel=1e-9)


# --- Coulomb's friction: the stick of Cattaneo and Mindlin, and full sliding with hysteresis ------


PAGE = Path(__file__).parents[2] / "docs" / "gallery" / "models" / "block.py"
COULOMB, G, NU, RADIUS = 0.3, 1.0, 0.4999, 10.0
BULK = 2 * G * (1 + NU) / (3 * (1 - 2 * NU))


def spread(s: Array) -> Array:
    """Equal cells to 1.4 mm on either side, then growing to 100 mm."""
    far = np.expm1(14 * np.maximum(abs(s) - 0.55, 0)) / 14
    return np.asarray(np.sign(s) * 1.4 / 0.55 * (np.minimum(abs(s), 0.55) + far))


def widths(x: Array) -> Array:
    order = np.argsort(x[:, 0])
    return np.asarray(np.gradient(x[order, 0])[np.argsort(order)])


def stresses(result: Result) -> tuple[Array, Array, Array]:
    """Width of the nodes, their pressure and tangential stress."""
    nodes = result.system.blocks["roller"].nodes[:, 0]
    p, tau = result.values("lambda"), result.values("tau")
    return widths(result.system.mesh.points[nodes]), np.maximum(-p, 0), tau


def pushed(n: int, shift: float) -> list[Result]:
    """Steps of a roller that is pressed 0.4 mm deep, then pushed by `shift`."""
    study = Study(Mesh.rectangle(2, 1, cells=(2 * n, n)).map(lambda x: spread(x - 1)))
    study.add("block", PAGE, G=G, K=BULK)
    given: dict[str, Any] = {"area": widths, "rho": lambda x: G / widths(x)}
    given["c"] = lambda x: -(x[:, 0] ** 2) / (2 * RADIUS)
    given |= {"n_z": 0.0, "n_r": -1.0, "offset": 0.0, "friction": COULOMB}
    study.add("roller", "contact_friction", on="top", **given)
    study.fix("bottom", u_r=lambda x, t: 0.4 * min(t, 1), u_z=lambda x, t: shift * max(t - 1, 0))
    pressed, path = study.solve(steps=4), list[Result]()
    study.solve(steps=4, start=pressed, until=2.0, on_step=path.append)
    return path


def departure(path: list[Result], friction: float) -> float:
    """Largest error of the stick ratio against sqrt(1 - Q / (friction P)), in widths of a node."""
    worst = 0.0
    for result in path:
        w, p, tau = stresses(result)
        sticks = (p > 0) & (abs(tau) < COULOMB * p * (1 - 1e-9))
        ratio = w[sticks].sum() / w[p > 0].sum()
        expected = max(1 - float(abs(tau @ w) / (friction * (p @ w))), 0.0) ** 0.5
        worst = max(worst, abs(ratio - expected) * w[p > 0].sum() / (2 * w[p > 0].max()))
    return worst


def test_stick_follows_cattaneo_and_mindlin() -> None:
    """Within one node; with another coefficient of friction the same comparison fails."""
    path = pushed(16, 0.12)
    assert departure(path, COULOMB) < 1.0
    assert departure(path, 1.5 * COULOMB) > 1.2


def test_a_roller_that_slides_everywhere_carries_mu_p() -> None:
    """|Q| = mu P to rounding, against the motion."""
    for shift in (0.5, -0.5):
        w, p, tau = stresses(pushed(12, shift)[-1])
        assert tau @ w == pytest.approx(-np.sign(shift) * COULOMB * (p @ w), rel=1e-9)
        assert np.all(abs(abs(tau) - COULOMB * p) <= 1e-9 * p.max())
