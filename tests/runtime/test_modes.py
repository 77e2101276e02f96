"""Natural modes about loaded states, linear buckling, and whether a state is stable."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import eigh

import softehl
from softehl.runtime.equations.mass_matrix import mass_matrix
from softehl.runtime.equations.stability import UnstableState
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.results.result import Result
from softehl.runtime.study import Study, StudyError
from tests.runtime.field_pages import mixed
from tests.runtime.field_pages import rubber_by_log as rubber

LENGTH, HEIGHT, YOUNG, RHO = 100.0, 1.0, 2000.0, 1e-9
EULER = np.pi**2 * YOUNG * HEIGHT**3 / 12 / (4 * LENGTH**2)


@softehl.page
def stresses(m: Any) -> None:
    """Hellinger and Reissner's energy; five stresses of Pian and Sumihara in each rectangle."""
    u, b = m.vector("u"), m.internal("b", 5)
    lame, mu = m.parameters(lame="Lame's first", mu="shear modulus")
    xi, eta = m.parent
    s = sp.Matrix([[b[0] + b[3] * eta, b[2]], [b[2], b[1] + b[4] * xi]])
    complementary = ((s * s).trace() - lame / (2 * mu + 2 * lame) * s.trace() ** 2) / (4 * mu)
    m.minimise((s * m.grad(u)).trace() - complementary)


@softehl.page
def mean_stress(m: Any) -> None:
    """The same with three stresses that are one for each cell, as unknowns of the study."""
    u, b = m.vector("u"), [m.scalar(f"b_{k}", order=0) for k in range(3)]
    lame, mu = m.parameters(lame="Lame's first", mu="shear modulus")
    s = sp.Matrix([[b[0], b[2]], [b[2], b[1]]])
    complementary = ((s * s).trace() - lame / (2 * mu + 2 * lame) * s.trace() ** 2) / (4 * mu)
    m.minimise((s * m.grad(u)).trace() - complementary)


@softehl.page
def strains(m: Any) -> None:
    """Four enhanced strains of Simo and Rifai, which give that of the stresses in rectangles."""
    u, a = m.vector("u"), sp.Matrix(2, 2, m.internal("a", 4))
    lame, mu = m.parameters(lame="Lame's first", mu="shear modulus")
    middle = m.centroid(m.jacobian)
    H = m.grad(u) + a * sp.diag(*m.parent) * middle.inv()
    e = (H + H.T) / 2
    m.minimise(lame / 2 * e.trace() ** 2 + mu * (e * e).trace())


@softehl.page
def incompressible(m: Any) -> None:
    """Taylor and Hood's: a pressure without an energy of its own."""
    u, p = m.vector("u"), m.scalar("p", order=1)
    (mu,) = m.parameters(mu="shear modulus")
    e = (m.grad(u) + m.grad(u).T) / 2
    m.minimise(mu * (e * e).trace() + p * e.trace())


@softehl.page
def string(m: Any) -> None:
    """A string along x that moves by w across."""
    u, w = m.scalar("u"), m.scalar("w")
    (EA,) = m.parameters(EA="stiffness")
    m.minimise(EA / 2 * (m.grad(u)[0] + m.grad(w)[0] ** 2 / 2) ** 2)


def column(page: Any = rubber, **given: Any) -> Study:
    """A cantilever, pressed at its end by one unit of force per load factor."""
    study = Study(Mesh.rectangle(LENGTH, HEIGHT, cells=(30, 1), order=2))
    study.add("body", page, **(given or {"mu": YOUNG / 2, "lame": 0.0}))
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_x=-1.0 / HEIGHT)
    return study


def at_rest(study: Study) -> Result:
    return study.solve(until=1e-9)


MASS = {"body": {"rho": RHO}}


def test_modes_of_a_beam() -> None:
    """Bernoulli's cantilever: roots of 1 + cos k cosh k."""
    modes = at_rest(column()).modes(3, mass=MASS)
    k = np.array([1.875104068711961, 4.694091132974174, 7.854757438237613])
    theory = k**2 / (2 * np.pi * LENGTH**2) * np.sqrt(YOUNG * HEIGHT**2 / 12 / RHO)
    np.testing.assert_allclose(modes.frequencies, theory, rtol=1e-3)
    assert np.abs(modes.frequencies / theory - 1).max() > 1e-6, "it is no beam but a body"
    end = np.array([mode.at((LENGTH, HEIGHT / 2))["u_y"] for mode in modes])
    np.testing.assert_allclose(np.abs(end), 2 / np.sqrt(RHO * LENGTH * HEIGHT), rtol=2e-3)


def test_modes_of_a_string_are_those_of_its_prestress() -> None:
    n = np.arange(1, 5)
    for strain in (0.01, 0.04):
        study = stretched(strain)
        study.fix("left", w=0)
        study.fix("right", w=0)
        modes = study.solve().modes(4, mass=STRING)
        np.testing.assert_allclose(
            modes.frequencies, n / 4 * np.sqrt(1e3 * strain / 0.5), rtol=2e-4
        )


def free_body(mesh: Mesh, page: Any = rubber, **given: Any) -> Study:
    study = Study(mesh)
    study.add("body", page, **(given or {"mu": 0.5, "lame": 0.0}))
    return study


def test_a_body_that_nothing_holds() -> None:
    """Rigid motions, then those of a free beam (1 = cos k cosh k) and of a bar."""
    mass, L = {"body": {"rho": 1.0}}, 40.0
    bending = np.array([4.730040744862704, 7.853204624095838]) ** 4 / 12 / L**4
    plane = free_body(Mesh.rectangle(L, 1.0, cells=(20, 1), order=2)).modes(12, mass=mass)
    np.testing.assert_array_equal(plane.frequencies[:3], 0.0)
    np.testing.assert_allclose(plane.squares[3:5], bending, rtol=2e-2)
    assert (np.abs(plane.squares / (np.pi / L) ** 2 - 1) < 1e-4).any()
    box = free_body(Mesh.box((L, 1.0, 1.0), cells=(8, 1, 1), order=2)).modes(8, mass=mass)
    np.testing.assert_array_equal(box.frequencies[:6], 0.0)
    np.testing.assert_allclose(box.squares[6:], bending[0], rtol=2e-2)
    cell = Mesh.rectangle(L, 1.0, cells=(20, 1))
    stressed = free_body(cell, stresses, mu=0.5, lame=0.0).modes(4, mass=mass)
    np.testing.assert_array_equal(stressed.frequencies[:3], 0.0)
    assert stressed.squares[3] == pytest.approx(bending[0], rel=2e-2)
    study = free_body(cell)
    study.load("right", u_y=lambda x, t: 0.1)
    with pytest.raises(StudyError, match="loads or prescribed values are not zero at load factor"):
        study.modes(1, mass=mass)


def test_a_ring_at_rest_but_for_rounding() -> None:
    """A thin ring moves along its axis, turns its section, and breathes: 0, E/2 and E over
    rho R^2.
    """
    ring = Mesh.rectangle(0.1, 0.1, cells=(2, 2)).map(lambda x: x + np.array([0.0, 9.95]))
    study = Study(ring, geometry="axisymmetric")
    study.add("body", material="neo_hooke", mu=1.0, kappa=2 / 3)  # E = 2, nu = 0
    squares = study.modes(3, mass={"body": {"rho": 1.0}}).squares
    np.testing.assert_allclose(squares, [0.0, 0.01, 0.02], rtol=2e-4, atol=1e-9)


def test_tied_sides_move_as_one() -> None:
    """A periodic string has waves of the whole length, in pairs."""
    study = stretched(0.01)
    study.tie("left", "right", "w")
    study.spring("left", w=1e-6)
    modes = study.solve().modes(5, mass=STRING)
    wave = np.sqrt(1e3 * 0.01 / 0.5)
    np.testing.assert_allclose(modes.frequencies[1:], np.array([1, 1, 2, 2]) / 2 * wave, rtol=1e-3)
    for mode in modes:
        assert mode.at((0.0,))["w"] == pytest.approx(mode.at((2.0,))["w"], abs=1e-12)


def stretched(strain: float) -> Study:
    study = Study(Mesh.line(2.0, cells=20, order=2))
    study.add("string", string, EA=1e3)
    study.fix("left", u=0)
    study.fix("right", u=lambda x, t: 2.0 * strain)
    study.start(u=lambda x: strain * x[:, 0])
    return study


STRING = {"string": {"rho": 0.5, "of": ["u", "w"]}}


def test_unknowns_without_mass_follow() -> None:
    modes = at_rest(column(mixed, mu=YOUNG / 2, K=2 * YOUNG)).modes(2, mass=MASS)
    plain = at_rest(column(rubber, mu=YOUNG / 2, lame=2 * YOUNG)).modes(2, mass=MASS)
    np.testing.assert_allclose(modes.frequencies, plain.frequencies, rtol=5e-3)
    assert np.abs(modes[0].values("p")[~np.isnan(modes[0].values("p"))]).max() > 0.0


def test_modes_against_dense_matrices() -> None:
    study = Study(Mesh.rectangle(2.0, 1.0, cells=(3, 2)))
    study.add("body", rubber, mu=1.0, lame=1.0)
    study.fix("left", u_x=0, u_y=0)
    result = study.solve(until=0.0)
    modes = result.modes(5, mass={"body": {"rho": lambda x: 1 + x[:, 0]}})
    K = result.problem.linearise(result.x)[1].toarray()
    M = dense_mass(result, lambda x: 1 + x[:, 0])
    held = result.problem.fixed
    free = np.setdiff1d(np.arange(len(K)), held)
    exact = eigh(K[np.ix_(free, free)], M[np.ix_(free, free)], eigvals_only=True)[:5]
    np.testing.assert_allclose(modes.squares, exact, rtol=1e-9)


def dense_mass(result: Result, rho: Any) -> np.ndarray:
    """Of rectangles of four nodes: the area / 36 [4 2 1 2, ...]."""
    mesh, nodal = result.system.mesh, result.system.numbering.nodal
    ring = np.array([[4, 2, 1, 2], [2, 4, 2, 1], [1, 2, 4, 2], [2, 1, 2, 4]]) / 36
    M = np.zeros((len(result.x), len(result.x)))
    for cell in mesh.cells["quad4"]:
        x = mesh.points[cell]
        part = rho(x.mean(axis=0)[None])[0] * np.prod(np.ptp(x, axis=0)) * ring
        for name in ("u_x", "u_y"):
            M[np.ix_(nodal[name][cell], nodal[name][cell])] += part
    return M


def test_masses_of_more_elements_than_are_evaluated_at_once() -> None:
    study = Study(Mesh.box((2.0, 1.0, 0.5), cells=(8, 8, 8)))
    study.add("body", material="neo_hooke", mu=1.0, kappa=1.0)
    system = study.system()
    M = mass_matrix(system, system.resting(), system.at_rest(), MASS)
    assert M.sum() == pytest.approx(3.0 * RHO, rel=1e-12)


def test_euler_loads() -> None:
    buckling = column().buckling(2)
    np.testing.assert_allclose(buckling.factors, EULER * np.array([1, 9]), rtol=2e-3)
    assert buckling.factors[0] == pytest.approx(EULER, rel=1e-3)
    assert abs(buckling.shapes[0].at((LENGTH, HEIGHT / 2))["u_y"]) == pytest.approx(1, abs=1e-3)
    near = column().solve(until=0.9 * EULER)
    exact = column().buckling(1, start=near).factors
    np.testing.assert_allclose(exact, EULER, rtol=2e-4)


def test_a_ring_buckles_under_a_pressure_that_ends_at_supports() -> None:
    """Levy's load of a ring, 3 E I / R^3, of a quarter between planes of symmetry."""
    radius, thickness, young = 1.0, 0.04, 1000.0

    def bent(x: Any) -> Any:
        r = radius - thickness / 2 + x[:, 1]
        return np.column_stack([r * np.sin(x[:, 0]), r * np.cos(x[:, 0])])

    mesh = Mesh.rectangle(np.pi / 2, thickness, cells=(16, 1), order=2).map(bent)
    study = Study(mesh)
    study.add("ring", material="saint_venant", E=young, nu=0.0)
    study.fix("left", u_x=0)
    study.fix("right", u_y=0)
    levy = 3 * young * thickness**3 / 12 / radius**3
    study.pressure("top", levy)
    assert study.buckling(1).factors[0] == pytest.approx(1.0, rel=0.01)
    assert study.solve(until=0.9).unstable == 0
    with pytest.warns(UnstableState, match="along one direction"):
        assert study.solve(until=1.1).unstable == 1


def test_a_column_beyond_its_load_is_not_silent() -> None:
    study = column()
    below = study.solve(until=0.98 * EULER)
    assert below.unstable == 0
    with pytest.warns(UnstableState, match="load factor .* is unstable: .* one direction"):
        beyond = study.solve(until=1.02 * EULER)
    assert beyond.unstable == 1
    with pytest.warns(UnstableState, match="2 independent directions"):
        assert study.solve(until=9.1 * EULER).unstable == 2
    modes = beyond.modes(2, mass=MASS)
    assert modes.squares[0] < 0.0 < modes.squares[1]
    assert np.isnan(modes.frequencies[0])


def test_ties_and_pressures_are_not_taken_for_instabilities() -> None:
    study = column(mixed, mu=YOUNG / 2, K=2 * YOUNG)
    assert at_rest(study).unstable == 0
    study.tie("top", "bottom", "u_x")
    assert at_rest(study).unstable == 0


def beam(page: Any, order: int = 1, load: float = 1e-3, **given: Any) -> Result:
    study = Study(Mesh.rectangle(4.0, 1.0, cells=(4, 2), order=order))
    study.add("body", page, **given)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_y=load)
    return study.solve()


def test_stresses_as_unknowns_are_not_taken_for_instabilities() -> None:
    """Both elements are the same one in rectangles (Andelfinger and Ramm, 1993)."""
    mass = {"body": {"rho": 1.0}}
    mixed_one, other = (beam(page, lame=0.6, mu=0.4) for page in (stresses, strains))
    assert mixed_one.unstable == other.unstable == 0
    squares = [result.modes(4, mass=mass).squares for result in (mixed_one, other)]
    np.testing.assert_allclose(squares[0], squares[1], rtol=1e-9)
    simple = beam(mean_stress, lame=0.6, mu=0.4)
    assert simple.unstable == 0  # softer: one point in each cell
    assert simple.modes(1, mass=mass).squares[0] == pytest.approx(squares[0][0], rel=0.3)


def test_what_is_incompressible_has_a_stability_and_modes() -> None:
    mass = {"body": {"rho": 1.0}}
    exact = beam(incompressible, 2, mu=1.0)
    assert exact.unstable == 0
    nearly = beam(mixed, 2, load=1e-9, mu=1.0, K=1e6).modes(3, mass=mass).squares
    np.testing.assert_allclose(exact.modes(3, mass=mass).squares, nearly, rtol=1e-4)


def test_a_cell_whose_displacements_are_prescribed_is_stable() -> None:
    study = Study(Mesh.rectangle(1.0, 1.0, cells=(1, 1), order=2))
    study.add("body", mixed, mu=1.0, K=10.0)
    study.fix(lambda x: x[:, 0] >= 0.0, u_x=lambda x, t: 0.01 * x[:, 0], u_y=0)
    result = study.solve()
    assert result.unstable == 0
    with pytest.raises(StudyError, match="of the unknowns that have a mass 0 can move"):
        result.modes(1, mass=MASS)


@pytest.mark.parametrize(
    ("mass", "words"),
    [
        ({"bod": {"rho": 1.0}}, r"no block 'bod' \(did you mean 'body'\?\); there are body$"),
        ({"body": {"rh": 1.0}}, r"no key 'rh' \(did you mean 'rho'\?\); it has rho, of$"),
        ({"body": {"rho": 1.0, "of": ["w"]}}, "no unknown 'w'; it has u_x, u_y$"),
        ({"body": {"rho": -1.0}}, "rho = -1, it cannot be negative$"),
        ({"body": 1.0}, "give its density, as in"),
        (None, "there is no mass: give densities"),
        (1e-9, "mass = 1e-09: give densities by blocks, as in"),
    ],
)
def test_what_is_refused(mass: Any, words: str) -> None:
    with pytest.raises(StudyError, match=words) as error:
        at_rest(column()).modes(2, mass=mass)
    assert "\n" not in str(error.value)


def test_numbers_that_are_refused() -> None:
    result = at_rest(column())
    with pytest.raises(StudyError, match="at least 1"):
        result.modes(0, mass=MASS)
    with pytest.raises(StudyError, match="from 1 to"):
        result.modes(10_000, mass=MASS)
    study = Study(Mesh.rectangle(1.0, 1.0, cells=(1, 1)))
    study.add("body", rubber, mu=1.0, lame=1.0)
    study.fix("left", u_x=0, u_y=0)
    with pytest.raises(StudyError, match="nothing changes with the load factor"):
        study.buckling()
    linear = Study(Mesh.rectangle(9.0, 1.0, cells=(9, 1)))
    linear.add("body", material="hooke", E=1.0, nu=0.3)
    linear.fix("left", u_x=0, u_y=0)
    linear.load("right", u_x=-1)
    with pytest.raises(StudyError, match="the stiffness does not change with the load, as in"):
        linear.buckling()


def test_an_unsymmetric_tangent_has_no_modes() -> None:
    study = column()
    study.pressure("top", lambda x, t: np.where(x[:, 0] > 50, t, 0.0))
    result = study.solve(until=1e-3)
    assert result.unstable is None
    with pytest.raises(StudyError, match="not symmetric"):
        result.modes(1, mass=MASS)
