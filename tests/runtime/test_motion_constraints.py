"""Motions with contact, ties and multipliers: every scheme is right, or is refused by name."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy as sp

import softehl
from softehl import Definition, Mesh, Model, NotConverged, quadrature
from softehl.runtime.analyses.motion import EnergyGain
from softehl.runtime.study import Study, StudyError
from tests.runtime.touching_bodies import force

E, RHO, LENGTH = 1000.0, 1e-3, 1.0
SPEED = float(np.sqrt(E / RHO))  # of a wave; with it a bar is passed in LENGTH / SPEED
MASS = {name: {"rho": RHO} for name in ("bar", "wall")}
SCHEMES: dict[str, dict[str, Any]] = {
    "newmark": {"method": "newmark"},
    "generalised-alpha": {"method": "generalised-alpha"},
    "most damped": {"method": "generalised-alpha", "rho_inf": 0.0},
    "midpoint": {"method": "midpoint"},
}
STILL: dict[str, dict[str, Any]] = {"euler": {"method": "euler"}, "bdf2": {"method": "bdf2"}}
DEAR = ("newmark", "most damped", "bdf2")  # whose neighbours are tested always
some_schemes = pytest.mark.parametrize(
    "scheme",
    [
        "generalised-alpha",
        "midpoint",
        *(pytest.param(name, marks=pytest.mark.slow) for name in DEAR[:2]),
    ],
)


@softehl.page
def heavy(m: Any) -> None:
    """A linear spring of a body with its inertia."""
    u = m.vector("u")
    E, rho = m.parameters(E="modulus", rho="density")
    m.weak(E * (m.grad(u) + m.grad(u).T) / 2, m.grad(u))
    m.weak(rho * m.rate(u, order=2), u)


def bars(
    *,
    cells: int = 2,
    dimension: int = 2,
    order: int = 1,
    gap: float = 0.0,
    page: Any = None,
    **contact: Any,
) -> Study:
    """A bar on a wall that is a bar of the same kind; both lead one wave along x."""
    size, n = (LENGTH, 1.0, 1.0)[:dimension], (cells, 1, 1)[:dimension]
    make: Any = Mesh.rectangle if dimension == 2 else lambda *a, **k: Mesh.box(a, **k)
    wall = make(*size, cells=n, order=order)
    offset = np.eye(dimension)[0] * (LENGTH + gap)
    study = Study(Mesh.union(bar=wall.map(lambda x: x + offset), wall=wall))
    for name in ("bar", "wall"):
        if page is None:
            study.add(name, material="hooke", cells=name, E=E, nu=0.0)
        else:
            study.add(name, page, cells=name, E=E, rho=RHO)
    across: dict[str, Any] = {f"u_{c}": 0 for c in "yz"[: dimension - 1]}
    study.fix("bar:boundary", **across)
    study.fix("wall:left", u_x=0, **across)  # all of it would leave the shear stress arbitrary
    study.contact("bar:left", "wall:right", **contact)
    return study


def moved(study: Study, **given: Any) -> list[Any]:
    """All results of a march."""
    return list(study.march(**given))


def test_a_start_that_its_constraints_do_not_admit() -> None:
    """Tied masses get the velocity of their momentum, bodies that overlap no energy."""
    study = Study(Mesh.line(1.0, cells=1))
    for mass, place in ((2.0, 0.0), (1.0, 1.0)):
        spring: dict[str, Any] = {"mass": mass, "k": 1e-9}
        study.add(f"m{place}", mass_on_spring(), on=lambda x, p=place: x[:, 0] == p, **spring)
    study.tie((1.0,), (0.0,), "w", offset=lambda x, t: 0.1, tolerance=2.0)
    given: dict[str, Any] = {"velocity": {"w": lambda x: 3.0 * x[:, 0]}, "dt": 0.1, "until": 0.4}
    for scheme in SCHEMES:
        speed = moved(study, **SCHEMES[scheme], **given)[-1].velocity("w")
        np.testing.assert_allclose(speed, 1.0, rtol=1e-6)
        wave = {"mass": MASS, "dt": 0.1 * LENGTH / SPEED, "until": 0.5 * LENGTH / SPEED}
        energy = moved(bars(gap=-1e-3), **SCHEMES[scheme], **wave)[-1].energy
        assert energy["kinetic"] + energy["internal"] < 1e-12


FEATURES: dict[str, dict[str, Any]] = {
    "smooth": {},
    "friction": {"friction": 0.3},
    "quadratic": {"order": 2},
    "in space": {"dimension": 3, "cells": 1, "friction": 0.3},
    "mass in the page": {"page": heavy},
}


RESTS = [
    pytest.param(
        *(feature, scheme),
        marks=[pytest.mark.slow] if feature not in ("smooth", "friction") or scheme in DEAR else [],
    )
    for feature in FEATURES
    for scheme in (*STILL, *SCHEMES)
    if not (scheme in STILL and feature == "mass in the page")  # refused: they have no inertia
]


@pytest.mark.parametrize(("feature", "scheme"), RESTS)
def test_rest_stays_rest(feature: str, scheme: str) -> None:
    """Bodies that are pressed together go on with the same pressure."""
    inertia = "page" in FEATURES[feature]
    given = {**STILL, **SCHEMES}[scheme]
    study = bars(**FEATURES[feature])
    study.load("bar:right", u_x=-1.0)
    start = study.solve()
    if scheme in SCHEMES and not inertia:
        given = {**given, "mass": MASS}
    dt = 0.2 * LENGTH / SPEED
    results = moved(study, dt=dt, until=start.t + 4 * dt, start=start, **given)
    assert [force(r) for r in results] == pytest.approx([1.0] * 4, rel=1e-6)
    np.testing.assert_allclose(results[-1].x, start.x, atol=1e-6 * np.abs(start.x).max())
    if scheme in SCHEMES:
        energy = results[-1].energy
        assert max(abs(energy["balance"]), energy["kinetic"]) < 1e-6 / E


@some_schemes
def test_an_impact_gains_no_energy(scheme: str) -> None:
    """Both bars take a wave of the pressure rho c v / 2; contact damps a few per cent at most."""
    v, cells = 10.0, 12
    study = bars(cells=cells, gap=0.01)
    push = {"u_x": lambda x: np.where(x[:, 0] > LENGTH + 0.005, -v, 0.0)}
    crossing = LENGTH / SPEED
    given: dict[str, Any] = {**SCHEMES[scheme], "mass": MASS, "velocity": push}
    results = moved(study, dt=0.5 * crossing / cells, until=2.4 * crossing, **given)
    total = np.array([r.energy["kinetic"] + r.energy["internal"] for r in results])
    first = 0.5 * RHO * LENGTH * v**2
    assert total.max() < 1.005 * first
    assert total.min() > 0.94 * first
    assert results[-1].energy["balance"] == pytest.approx(total[-1] - first, abs=1e-3 * first)
    arrival = 0.01 / v
    times = [r.t for r in results]
    during = [force(r) for r, t in zip(results, times, strict=True) if 0 < t - arrival < crossing]
    assert np.mean(during) == pytest.approx(RHO * SPEED * v / 2, rel=0.05)


def test_friction_takes_the_energy_of_a_sliding_body() -> None:
    """Momentum falls by friction times the load, and energy by its work."""
    top = Mesh.rectangle(0.5, 0.25, cells=(2, 1)).map(lambda x: x + np.array([0.25, 0.5]))
    study = Study(Mesh.union(bar=top, wall=Mesh.rectangle(1.0, 0.5, cells=(4, 2))))
    for name in ("bar", "wall"):
        study.add(name, material="hooke", cells=name, E=E, nu=0.0)
    study.contact("bar:bottom", "wall:top", friction=0.3)
    study.fix("wall:boundary", u_x=0, u_y=0)
    study.load("bar:top", u_y=-2.0)  # a force of 1
    study.spring("bar:boundary", u_x=1e-9)
    start = study.solve()
    v, mass = 2.0, RHO * 0.5 * 0.25
    until = 0.4 * v * mass / 0.3
    push = np.where(np.arange(len(study.mesh.points)) < 6, v, 0.0)  # nodes of the upper body
    given: dict[str, Any] = {"mass": MASS, "velocity": {"u_x": lambda x: push}}
    for scheme in ("generalised-alpha", "midpoint"):
        *_, result = moved(
            study, dt=until / 40, until=start.t + until, start=start, **SCHEMES[scheme], **given
        )
        energy, first = result.energy, 0.5 * mass * v**2
        speed = np.nanmean(result.velocity("u_x")[push > 0])
        assert speed == pytest.approx(0.6 * v, rel=0.06)
        assert abs(energy["balance"]) < 0.02 * first
        assert energy["internal"] > 0.5 * (first - energy["kinetic"])


@cache
def mass_on_spring() -> Definition:
    """m a + k w = 0."""
    m = Model("mass_on_spring", nodes=1, rule=quadrature.point_rule())
    ((w,),) = m.nodal_unknowns("w")
    mass, k = m.parameters(mass="mass", k="stiffness")
    ((a,),) = m.rates("w", order=2)
    m.weak_form([(mass * a + k * w, w)])
    return m.finish()


@some_schemes
def test_a_tie_whose_offset_moves(scheme: str) -> None:
    """Against the closed form: order 2, of the force 1; its work is in the balance."""
    w, until, rest = 1.3, 2.0, np.sqrt(8.0 / 3.0)
    # 3 a + 8 u = -(o'' + 5 o), o = sin w t; the velocity at the start is that of the momentum 0
    forced = -(5.0 - w**2) / (8.0 - 3.0 * w**2)
    free = (-w / 3.0 - forced * w) / rest
    u = free * np.sin(rest * until) + forced * np.sin(w * until)
    a = -(rest**2) * free * np.sin(rest * until) - w**2 * forced * np.sin(w * until)
    force = 2.0 * a + 3.0 * u
    errors, balances = [], []
    for steps in (40, 80):
        study = Study(Mesh.line(1.0, cells=1))
        study.add("a", mass_on_spring(), on=lambda x: x[:, 0] == 0.0, mass=2.0, k=3.0)
        study.add("b", mass_on_spring(), on=lambda x: x[:, 0] == 1.0, mass=1.0, k=5.0)
        study.tie((1.0,), (0.0,), "w", offset=lambda x, t: np.sin(w * t), tolerance=2.0)
        results = moved(study, dt=until / steps, until=until, **SCHEMES[scheme])
        result = results[-1]
        tie = result.system.numbering.layout.part(result.system.numbering.layout.names[-1])
        # a mean of the last step; undamped schemes have it alternate about the mean of two
        mean = 0.5 * (result.x[tie] + results[-2].x[tie])[0]
        errors.append([abs(result.values("w")[0] - u), abs(mean - force)])
        balances.append(abs(result.energy["balance"]))
    orders = np.log2(np.array(errors[0]) / errors[1])
    assert orders[0] == pytest.approx(2.0, abs=0.1)
    assert orders[1] > 0.9
    assert errors[1][1] < 0.1
    assert balances[1] < max(0.55 * balances[0], 1e-11)


@cache
def rod() -> Definition:
    """A weight on a rigid rod of length 1, of which the force is a multiplier."""
    m = Model("rod", nodes=1, rule=quadrature.point_rule())
    (x,), (y,) = m.nodal_unknowns("x", "y")
    force = m.unknown("force")
    right, up, g = m.parameters(right="at the start", up="at the start", g="gravity")
    (ax,), (ay,) = m.rates("x", "y", order=2)
    X, Y = x + right, y + up
    m.weak_form([(ax + force * X, x), (ay + g + force * Y, y), ((X**2 + Y**2 - 1) / 2, force)])
    return m.finish()


def pendulum(right: float, up: float) -> Study:
    study = Study(Mesh.line(1.0, cells=1))
    study.add("rod", rod(), on=lambda x: x[:, 0] == 0.0, right=right, up=up, g=9.81)
    return study


@pytest.mark.parametrize("scheme", ["generalised-alpha", "midpoint"])
def test_multipliers_of_pages_begin_right_and_stay_so(scheme: str) -> None:
    """A weight at rest has its weight in every step; one that swings by mpmath."""
    import mpmath

    forces = [
        r.values("force")[0]
        for r in pendulum(0.0, -1.0).march(dt=0.1, until=0.5, **SCHEMES[scheme])
    ]
    assert forces == pytest.approx([9.81] * 5, rel=1e-9)
    swing = mpmath.odefun(
        lambda t, y: [y[1], -9.81 * mpmath.sin(y[0])], 0, [mpmath.asin(mpmath.mpf("0.6")), 0]
    )
    angle, speed = (float(v) for v in swing(2.0))
    errors = []
    for steps in (40, 80):
        *_, result = moved(pendulum(0.6, -0.8), dt=2.0 / steps, until=2.0, **SCHEMES[scheme])
        errors.append(abs(result.values("force")[0] - (9.81 * np.cos(angle) + speed**2)))
    assert errors[1] < 0.12
    assert errors[1] < 0.6 * errors[0]


@pytest.mark.parametrize("given", [{}, {"method": "generalised-alpha", "rho_inf": 1.0}])
def test_multipliers_of_pages_are_refused_where_nothing_damps(given: dict[str, Any]) -> None:
    with pytest.raises(
        StudyError, match=r"'force' is a multiplier.* .newmark. .* rho_inf below 1, or"
    ) as error:
        moved(pendulum(0.6, -0.8), dt=0.1, until=1.0, **{"method": "newmark", **given})
    assert "\n" not in str(error.value)


@cache
def dashpot() -> Definition:
    """m a + c (w - w_old) / dt + k w = 0."""
    m = Model("dashpot", nodes=1, rule=quadrature.point_rule())
    ((w,),) = m.nodal_unknowns("w")
    ((before,),) = m.nodal_data("w_old", meaning="in the step before")
    mass, c, k, dt = m.parameters(mass="mass", c="damping", k="stiffness", dt="step")
    ((a,),) = m.rates("w", order=2)
    m.weak_form([(mass * a + c * (w - before) / dt + k * w, w)])
    return m.finish()


@pytest.mark.parametrize("scheme", [*SCHEMES, "explicit"])
def test_pages_that_divide_by_the_step(scheme: str) -> None:
    """Closed form of a damped oscillator; such a rate has order 1, averaged order 2."""
    rate = 0.4 / (2 * 2.0)
    w = np.sqrt(3.0 / 2.0 - rate**2)
    truth = np.exp(-rate * 2.0) * (np.cos(w * 2.0) + rate / w * np.sin(w * 2.0))
    errors = []
    for steps in (25, 50):
        study = Study(Mesh.line(1.0, cells=1))
        study.add("d", dashpot(), on=lambda x: x[:, 0] == 0.0, mass=2.0, c=0.4, k=3.0)
        study.start(w=1.0)
        given = SCHEMES.get(scheme, {"method": "explicit"})
        *_, result = moved(study, dt=2.0 / steps, until=2.0, **given)
        errors.append(abs(result.values("w")[0] - truth))
    assert errors[1] < 3e-3
    if scheme != "most damped":  # whose two errors cancel here
        order = 2.0 if scheme == "midpoint" else 1.0
        assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2 * order)


def in_a_tube(dimension: int, **contact: Any) -> Study:
    """Bars of four cells that are fixed across everywhere, pressed on each other by 1e-3."""
    study = bars(dimension=dimension, **contact)
    study.fix("wall:boundary", **{f"u_{c}": 0 for c in "yz"[: dimension - 1]})
    study.load("bar:right", u_x=-1e-3)
    return study


@pytest.mark.parametrize("dimension", [2, 3])
def test_bodies_in_contact_without_friction_are_one_along_its_normal(dimension: int) -> None:
    """Points that do not slip do not stick: force and mode of a bar in closed form."""
    result = in_a_tube(dimension).solve()
    assert force(result) == pytest.approx(1e-3, rel=1e-9)
    found = result.modes(1, mass=MASS).frequencies[0]
    assert found == pytest.approx(lowest_of_four_cells(), rel=1e-7)
    with pytest.raises(NotConverged, match="not held"):  # the shear stress is arbitrary
        in_a_tube(dimension, friction=0.3).solve()


def lowest_of_four_cells() -> float:
    """The frequency of a bar fixed at one end, of linear cells with consistent mass."""
    h = LENGTH / 2
    turn = np.cos(np.pi / (4 * LENGTH) * h)
    return float(SPEED / h * np.sqrt(6 * (1 - turn) / (2 + turn)) / (2 * np.pi))


def test_modes_of_bodies_in_contact_are_those_of_one() -> None:
    """Four linear cells of a bar that is fixed at one end, in closed form."""
    study = bars()
    study.load("bar:right", u_x=-1e-3)
    along = {name: {"rho": RHO, "of": ["u_x"]} for name in ("bar", "wall")}
    found = study.solve().modes(4, mass=along).frequencies
    assert np.abs(found / lowest_of_four_cells() - 1).min() < 1e-5
    rough = bars(friction=0.3)
    rough.load("bar:right", u_x=-1e-3)
    with pytest.raises(StudyError, match=r"not symmetric .friction"):
        rough.solve().modes(2, mass=MASS)


@softehl.page
def enhanced(m: Any) -> None:
    """With a pressure in each cell."""
    u, p = m.vector("u"), m.internal("p")
    (E,) = m.parameters(E="modulus")
    e = (m.grad(u) + m.grad(u).T) / 2
    m.minimise(E / 2 * (e.T * e).trace() + p * e.trace() - p**2 / (2 * E))


def test_explicit_steps_say_what_they_do_not_take() -> None:
    given: dict[str, Any] = {"dt": 1e-3, "until": 1e-2, "method": "explicit"}
    study = Study(Mesh.rectangle(1.0, 1.0, cells=(1, 1)))
    study.add("bar", enhanced, E=E)
    study.fix("left", u_x=0, u_y=0)
    with pytest.raises(StudyError, match=r"p belongs to elements .m\.internal."):
        moved(study, mass={"bar": {"rho": RHO}}, **given)


def test_energy_from_the_scheme_warns() -> None:
    """Steps far longer than the period make an oscillator overshoot at the start."""
    study = Study(Mesh.line(1.0, cells=1))
    study.add("a", mass_on_spring(), on=lambda x: x[:, 0] == 0.0, mass=1e-9, k=1e3)
    study.start(w=1e-6)
    march = study.march(dt=1.0, until=5.0, method="generalised-alpha", rho_inf=0.9)
    with pytest.warns(EnergyGain, match="100% of the energy of the motion come from the scheme"):
        list(march)


@some_schemes
def test_a_wall_without_mass_is_a_spring(scheme: str) -> None:
    """Pressed slowly it has the whole force; an impact on it gains no energy."""
    mass, until = {"bar": {"rho": RHO}}, 60.0 * LENGTH / SPEED
    study = bars(cells=1)
    study.load("bar:right", u_x=lambda x, t: -(np.sin(0.5 * np.pi * t / until) ** 2))
    result = moved(study, dt=until / 30, until=until, mass=mass, **SCHEMES[scheme])[-1]
    assert force(result) == pytest.approx(1.0, abs=0.02)
    assert result.at((LENGTH, 0.5))["u_x"] == pytest.approx(-LENGTH / E, rel=0.03)
    push = {"u_x": lambda x: np.where(x[:, 0] > LENGTH + 0.005, -10.0, 0.0)}
    given: dict[str, Any] = {**SCHEMES[scheme], "mass": mass, "velocity": push}
    dt = 0.1 * LENGTH / SPEED
    results = moved(bars(cells=3, gap=0.01), dt=dt, until=25 * dt, **given)
    total = np.array([r.energy["kinetic"] + r.energy["internal"] for r in results])
    first = 0.5 * RHO * LENGTH * 10.0**2
    assert total.max() < 1.001 * first
    assert total.min() > 0.9 * first


@softehl.page
def growing(m: Any) -> None:
    """A linear body that grows, with a force on its volume."""
    u = m.vector("u")
    E, growth, b = m.parameters(E="modulus", growth="strain", b="force per volume")
    e = (m.grad(u) + m.grad(u).T) / 2 - growth * sp.eye(len(u))
    m.minimise(E / 2 * (e.T * e).trace() - b * u[0])


@pytest.mark.parametrize("scheme", ["generalised-alpha", "midpoint", "explicit"])
def test_parameters_that_change_with_time_work(scheme: str) -> None:
    """The balance falls with the square of the step, or is zero."""
    gaps = []
    for steps in (40, 80):
        study = Study(Mesh.rectangle(1.0, 0.5, cells=(2, 1)))
        waves: dict[str, Any] = {
            "growth": lambda t: 1e-3 * np.sin(4e3 * t),
            "b": lambda t: 30 * np.cos(3e3 * t),
        }
        study.add("bar", growing, E=E, **waves)
        study.fix("left", u_x=0, u_y=0)
        given = SCHEMES.get(scheme, {"method": "explicit"})
        mass = {"bar": {"rho": RHO}}
        results = moved(study, dt=2e-3 / steps, until=2e-3, mass=mass, **given)
        largest = max(r.energy["kinetic"] + abs(r.energy["internal"]) for r in results)
        gaps.append(max(abs(r.energy["balance"]) for r in results) / largest)
    assert gaps[1] < max(0.3 * gaps[0], 1e-10)
    assert gaps[0] < 0.02
