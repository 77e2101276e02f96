"""Bodies in motion: orders of the schemes, energies, stable steps, ties, what is refused."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy as sp

import softehl
from softehl import Definition, Model, UnbalancedStart, quadrature
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.study import Study, StudyError
from tests.runtime.field_pages import mixed
from tests.runtime.field_pages import rubber_by_log as rubber

LENGTH = 10.0
MASS = {"body": {"rho": 1.0}}
ALL = ("generalised-alpha", "newmark", "midpoint", "explicit")
SOME = [pytest.param(m, marks=[pytest.mark.slow] * (m in ALL[1:3])) for m in ALL]


@softehl.page
def moving(m: Any) -> None:
    """The same with its inertia in the weak form."""
    u = m.vector("u")
    mu, lame, rho = m.parameters(mu="shear modulus", lame="Lame's first", rho="density")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    m.minimise(mu / 2 * ((F.T * F).trace() - 3 - 2 * sp.log(J)) + lame / 2 * sp.log(J) ** 2)
    m.weak(rho * m.rate(u, order=2), u)


@cache
def pendulum(damping: bool = False) -> Definition:
    """A mass on a spring that hardens: m w'' + c w' + k (w + w^3) = 0."""
    m = Model("pendulum", nodes=1, rule=quadrature.point_rule())
    ((w,),) = m.nodal_unknowns("w")
    mass, k = m.parameters(mass="mass", k="stiffness")
    ((a,),) = m.rates("w", order=2)
    force = m.define("force", mass * a + k * (w + w**3))
    if damping:
        (c,) = m.parameters(c="damping")
        ((v,),) = m.rates("w")
        force = m.define("damped", force + c * v)
    m.weak_form([(force, w)])
    return m.finish()


def oscillator(**given: Any) -> Study:
    study = Study(Mesh.line(1.0, cells=1))
    page = pendulum("c" in given)
    study.add("pendulum", page, on=lambda x: x[:, 0] == 0.0, mass=2.0, k=3.0, **given)
    study.start(w=1.0)
    return study


def exact(t: float, c: float = 0.0) -> float:
    """By Taylor's series of high order in short steps (mpmath)."""
    import mpmath

    solution = mpmath.odefun(
        lambda _, y: [y[1], -(3 * (y[0] + y[0] ** 3) + c * y[1]) / 2], 0, [1, 0]
    )
    return float(solution(t)[0])


def steps(study: Study, **given: Any) -> list[Any]:
    return list(study.march(**given))


def last(study: Study, **given: Any) -> Any:
    return steps(study, **given)[-1]


@pytest.mark.parametrize(
    ("method", "c"),
    [
        *((method, 0.4) for method in ALL),
        ("explicit", 0.0),
        *(pytest.param(method, 0.0, marks=pytest.mark.slow) for method in ALL[:3]),
    ],
)
def test_orders_are_two(method: str, c: float) -> None:
    study = oscillator(**({"c": c} if c else {}))
    truth = exact(2.0, c)
    lengths = np.array([0.05, 0.025])
    ends = [last(study, dt=d, until=2.0, method=method).values("w")[0] for d in lengths]
    order = np.polyfit(np.log(lengths), np.log(np.abs(np.array(ends) - truth)), 1)[0]
    assert order == pytest.approx(1.0 if method == "explicit" and c else 2.0, abs=0.15)


@pytest.mark.filterwarnings("ignore::softehl.runtime.analyses.motion.EnergyGain")
def test_the_spectral_radius_damps_what_is_too_fast() -> None:
    """A stiff oscillator loses the share rho_inf of its amplitude in a step, after the first."""
    study = Study(Mesh.line(1.0, cells=1))
    study.add("pendulum", pendulum(), on=lambda x: x[:, 0] == 0.0, mass=1e-9, k=1e3)
    study.start(w=1e-6)
    for radius in (0.5, 0.9, 1.0):
        given = {"dt": 1.0, "until": 40.0, "method": "generalised-alpha", "rho_inf": radius}
        w = [abs(r.values("w")[0]) for r in steps(study, **given)]
        assert (w[-1] / w[-11]) ** 0.1 == pytest.approx(radius, rel=0.1)


def beam(page: Any = rubber, **given: Any) -> Study:
    study = Study(Mesh.rectangle(LENGTH, 1.0, cells=(8, 1), order=2))
    study.add("body", page, mu=50.0, lame=50.0, **given)
    study.fix("left", u_x=0, u_y=0)
    return study


PERIOD = 53.8
SWING = {"u_y": lambda x: 0.23 * (x[:, 0] / LENGTH) ** 2}


def test_the_midpoint_conserves_the_energy_of_a_swinging_beam() -> None:
    """And the other implicit ones of second order do not."""

    def drift(method: str, periods: int) -> float:
        given = {"mass": MASS, "velocity": SWING, "method": method}
        found = steps(beam(), dt=PERIOD / 30, until=periods * PERIOD, **given)
        assert max(abs(r.at((LENGTH, 0.5))["u_y"]) for r in found) > 0.1 * LENGTH
        total = np.array([r.energy["kinetic"] + r.energy["internal"] for r in found])
        return float(np.abs(total / total[0] - 1.0).max())

    assert drift("midpoint", 4) < 1e-6
    assert drift("newmark", 1) > 1e-4
    assert drift("generalised-alpha", 1) > 1e-4


@pytest.mark.parametrize("method", ["newmark", "generalised-alpha", "midpoint"])
def test_a_support_that_is_accelerated_begins_with_its_acceleration(method: str) -> None:
    """Its inertia, and that of the nodes beside it, alternated about the right value before."""
    study = Study(Mesh.rectangle(1.0, 1.0, cells=(2, 1)))
    study.add("body", rubber, mu=50.0, lame=50.0)
    study.fix("left", u_x=lambda x, t: np.full(len(x), 0.005 * t**2), u_y=0)
    states = steps(study, dt=0.05, until=0.2, method=method, mass=MASS)
    left = states[0].system.mesh.nodes("left")
    for state in states:
        np.testing.assert_allclose(state.acceleration("u_x")[left], 0.01, rtol=1e-5)


def test_a_mass_beside_that_of_the_page_is_refused() -> None:
    """They would add; on a block of its own it is added mass."""
    study = beam(moving, rho=1e-3)
    with pytest.raises(StudyError, match="mass of 'body': its page has accelerations"):
        steps(study, dt=1.0, until=1.0, method="newmark", mass=MASS)
    with pytest.raises(StudyError, match="mass of 'body': its page has accelerations"):
        study.modes(1, mass=MASS)


def test_pressures_need_no_mass() -> None:
    study = Study(Mesh.rectangle(LENGTH, 1.0, cells=(6, 1), order=2))
    study.add("body", mixed, mu=50.0, K=1e6)
    study.fix("left", u_x=0, u_y=0)
    given = {"dt": 1.0, "until": 20.0, "mass": MASS, "velocity": SWING}
    for method, most in (("midpoint", 1e-9), ("generalised-alpha", 0.02)):
        states = steps(study, method=method, **given)
        assert abs(states[-1].energy["balance"]) < most * states[0].energy["kinetic"]
        assert np.nanmax(np.abs(states[-1].values("p"))) > 0.1
    with pytest.raises(StudyError, match="p has no mass everywhere"):
        steps(study, method="explicit", **given)


@cache
def valve() -> Definition:
    """A mass with an unknown q without mass, q^2 = w - 1: none where w < 1."""
    m = Model("valve", nodes=1, rule=quadrature.point_rule())
    ((w,),), ((q,),) = m.nodal_unknowns("w"), m.nodal_unknowns("q")
    ((a,),) = m.rates("w", order=2)
    m.weak_form([(a + w, w), (q**2 + 1 - w, q)])
    return m.finish()


@pytest.mark.parametrize("w", [2.0, 0.5])
def test_a_start_without_equilibrium_of_what_has_no_mass_is_not_silent(w: float) -> None:
    study = Study(Mesh.line(1.0, cells=1))
    study.add("valve", valve(), on=lambda x: x[:, 0] == 0.0)
    study.start(w=w, q=0.5)
    given: dict[str, Any] = {"method": "generalised-alpha", "dt": 1e-3, "until": 1e-3}
    if w > 1.0:
        assert last(study, **given).values("q")[0] == pytest.approx(1.0, abs=1e-5)
        return
    message = r"t = 0: 'q' has no mass, and no equilibrium of it was found at the start"
    with pytest.warns(UnbalancedStart, match=message):
        study.march(**given)


@pytest.mark.parametrize("method", ALL)
def test_a_motion_is_not_recorded(method: str) -> None:
    message = f'record = True: a march by "{method}" has no derivatives.* "euler", "bdf2"'
    with pytest.raises(StudyError, match=message):
        steps(oscillator(), dt=0.1, until=0.2, method=method, record=True)


def test_mass_of_a_page_is_that_of_a_density() -> None:
    given: dict[str, Any] = {"dt": PERIOD / 20, "until": PERIOD / 4, "velocity": SWING}
    for method in ("midpoint", "generalised-alpha"):
        one = last(beam(), method=method, mass=MASS, **given)
        other = last(beam(moving, rho=1.0), method=method, **given)
        np.testing.assert_allclose(one.x, other.x, rtol=1e-7, atol=1e-9)
        assert one.energy["kinetic"] == pytest.approx(other.energy["kinetic"])
    modes = beam(moving, rho=1.0).solve(until=0.0).modes(2)
    same = beam().solve(until=0.0).modes(2, mass=MASS)
    np.testing.assert_allclose(modes.frequencies, same.frequencies, rtol=1e-10)


@pytest.mark.parametrize("method", SOME)
def test_loads_and_moving_supports_do_the_work(method: str) -> None:
    """What both energies gain is the work, but for the error of the scheme."""
    study = Study(Mesh.rectangle(LENGTH, 1.0, cells=(5, 1)))
    study.add("body", rubber, mu=50.0, lame=50.0)
    study.fix("left", u_x=0, u_y=lambda x, t: 0.5 * (1 - np.cos(0.3 * t)))
    study.load("right", u_y=lambda x, t: 0.02 * np.sin(0.2 * t))
    study.pressure("top", lambda x, t: 0.001 * t)
    given: dict[str, Any] = {"rho_inf": 1.0} if method == "generalised-alpha" else {}
    result = last(study, dt=0.1, until=15.0, method=method, mass=MASS, **given)
    energy = result.energy
    assert energy["external"] > 0.05
    gained = energy["kinetic"] + energy["internal"]
    assert gained == pytest.approx(energy["external"], rel=5e-3)
    assert energy["balance"] == pytest.approx(gained - energy["external"], abs=1e-9)
    assert abs(energy["balance"]) < (1e-7 if method == "midpoint" else 5e-3) * energy["external"]


def test_explicit_steps_are_stable_and_told() -> None:
    """A bar of linear cells with lumped masses: h / c, c of a wave that is held aside."""
    study = Study(Mesh.rectangle(4.0, 1.0, cells=(16, 1)))
    study.add("body", rubber, mu=50.0, lame=0.0)
    study.fix("left", u_x=0)
    study.fix(lambda x: np.full(len(x), True), u_y=0)
    wave = {"u_x": lambda x: 1e-4 * np.sin(np.pi * x[:, 0] / 8)}
    states = steps(study, dt=0.5, until=4.0, method="explicit", mass=MASS, velocity=wave)
    assert states[0].stable_step == pytest.approx(0.25 / np.sqrt(100.0), rel=0.01)
    w = np.pi / 8 * np.sqrt(100.0)
    t = np.array([r.t for r in states])
    tip = np.array([r.at((4.0, 0.5))["u_x"] for r in states])
    np.testing.assert_allclose(tip, 1e-4 / w * np.sin(w * t), atol=0.01e-4 / w)
    assert abs(states[-1].energy["balance"]) < 1e-3 * states[0].energy["kinetic"] + 1e-12


def test_a_march_goes_on_from_a_motion() -> None:
    study, given = oscillator(), {"method": "midpoint", "dt": 0.1}
    half = last(study, until=1.0, **given)
    whole = last(study, until=2.0, **given)
    on = last(study, start=half, until=2.0, **given)
    assert on.values("w")[0] == pytest.approx(whole.values("w")[0], rel=1e-9)
    assert on.velocity("w")[0] == pytest.approx(whole.velocity("w")[0], rel=1e-9)
    with pytest.raises(KeyError, match="no unknown 'v'; at nodes: w"):
        on.acceleration("v")


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"method": "midpont"}, r'did you mean \'midpoint\'\?\): allowed are "euler", "bdf2", '),
        ({"method": "newmark", "rho_inf": 0.5}, "only method = .generalised-alpha. has it$"),
        ({"method": "generalised-alpha", "rho_inf": 1.5}, "allowed is 0 .* to 1"),
        ({"method": "newmark"}, "there is no mass: give densities"),
        ({"method": "newmark", "mass": {"bdy": {"rho": 1}}}, r"did you mean 'body'"),
        ({"method": "newmark", "mass": MASS, "velocity": {"u_a": 1.0}}, "velocity has no unknown"),
        ({"method": "newmark", "mass": MASS, "tolerance": 1e-3}, "tolerance: .* leave it out$"),
        ({"method": "bdf2", "mass": MASS}, "mass: method = .bdf2. has no such thing"),
        ({"method": "newmark", "mass": MASS, "until": -1.0}, "must be positive"),
    ],
)
def test_what_is_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(StudyError, match=words) as error:
        steps(beam(), **{"dt": 1.0, "until": 2.0, **given})
    assert "\n" not in str(error.value)


def test_pages_with_accelerations_are_not_marched_without() -> None:
    with pytest.raises(StudyError, match="'pendulum' has accelerations, method"):
        steps(oscillator(), dt=1.0, until=2.0)
    with pytest.raises(StudyError, match="acceleration comes from the steps in time"):
        oscillator(acceleration=1.0)


@pytest.mark.parametrize("method", SOME)
def test_tied_sides_move_as_one(method: str) -> None:
    """Both sides have one motion, and ties do no work."""
    study = Study(Mesh.rectangle(2.0, 1.0, cells=(8, 1)))
    study.add("body", rubber, mu=50.0, lame=0.0)
    study.tie("left", "right", "u_x", "u_y")
    study.fix((0.0, 0.0), u_x=0, u_y=0)
    push = {"u_x": lambda x: 0.01 * np.sin(np.pi * x[:, 0])}
    states = steps(study, dt=0.01, until=0.3, method=method, mass=MASS, velocity=push)
    u = states[-1].values("u_y")
    mesh = study.mesh
    left, right = (mesh.nodes(side) for side in ("left", "right"))
    np.testing.assert_allclose(u[left], u[right], atol=1e-12)
    energy = states[-1].energy
    assert energy["internal"] > 1e-6
    assert abs(energy["balance"]) < 0.02 * energy["kinetic"]
