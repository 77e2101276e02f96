"""Initial values of unknowns, of history and of prestress: `Study.initial`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import softehl
from softehl import Mesh, Study, StudyError, UnstableState


@softehl.page
def taut(m: softehl.Fields) -> None:
    """A string or membrane whose tension is a field."""
    w = m.scalar("w")
    (N,) = m.point_data(N="tension")
    slope = m.grad(w)
    m.minimise(N / 2 * slope.dot(slope))


@softehl.page
def creeping(m: softehl.Fields) -> None:
    """Spring E and, in series with another spring of E, a dashpot: strains of u_x alone."""
    u = m.scalar("u_x")
    E, tau, dt = m.parameters(E="modulus", tau="time", dt="step")
    (v,) = m.point_data(v="viscous strain")
    strain = m.define("strain", m.grad(u)[0])
    new = m.define("new", (v + dt / tau * strain) / (1 + dt / tau))
    m.weak(E * strain + E * (strain - new), m.grad(u)[0])
    m.fields(viscous=new)
    m.history(v=new)


def string(n: int = 40) -> Study:
    study = Study(Mesh.line(2.0, cells=n, order=2))
    study.add("string", taut)
    study.fix("boundary", w=0)
    return study


RADIUS_OF_MOST_PRESSURE = 7 ** (1 / 6)
MASS: Any = {"string": {"rho": 0.5, "of": ["w"]}}


def test_a_prestressed_string_has_its_frequencies() -> None:
    study = string()
    study.initial(N=8.0)
    exact = np.arange(1, 4) / (2 * 2.0) * np.sqrt(8.0 / 0.5)
    assert np.allclose(study.modes(3, mass=MASS).frequencies, exact, rtol=1e-5)
    study.initial(N=2.0)
    assert np.allclose(study.modes(3, mass=MASS).frequencies, exact / 2, rtol=1e-5)


@pytest.mark.parametrize("method", ["newmark", "explicit", "generalised-alpha"])
def test_a_string_that_is_released_swings_with_its_prestress(method: Any) -> None:
    study = string(5)
    study.initial(N=8.0, w=lambda x: np.sin(np.pi * x[:, 0] / 2))
    *_, motion = study.march(dt=0.01, until=0.5, method=method, mass=MASS)
    omega = np.pi / 2 * np.sqrt(8.0 / 0.5)
    assert motion.at((1.0,))["w"] == pytest.approx(np.cos(0.5 * omega), abs=2e-3)


def test_a_path_by_arc_length_has_the_prestress() -> None:
    study = string(4)
    study.initial(N=8.0)
    study.load((1.0,), w=1.0)
    end = study.follow(step=0.05, until=lambda r: r.t > 0.1).results[-1]
    assert end.at((1.0,))["w"] / end.t == pytest.approx(2.0 / 4 / 8, rel=1e-9)
    stored = end.integral("N / 2 * grad_w_0**2")
    assert stored == pytest.approx(end.t * end.at((1.0,))["w"] / 2, rel=1e-9)


def test_a_prestressed_membrane_has_its_frequencies() -> None:
    study = Study(Mesh.rectangle(2, 1, cells=(12, 6), order=2))
    study.add("string", taut)
    study.fix("boundary", w=0)
    study.initial(block="string", N=lambda x: np.full(len(x), 3.0))
    exact = [np.sqrt(3.0 / 0.5 * ((i / 2) ** 2 + j**2)) / 2 for i, j in ((1, 1), (2, 1), (3, 1))]
    assert np.allclose(study.modes(3, mass=MASS).frequencies, exact, rtol=2e-4)


def test_a_tension_that_varies_is_that_of_two_strings() -> None:
    """Normal modes of two halves with tensions 1 and 4: tan(k) / k_1 + tan(k / 2) / k_2 = 0."""
    study = string()
    study = Study(study.mesh.with_group("half", lambda x: x[:, 0] < 1))
    study.add("string", taut, N=4.0)
    study.fix("boundary", w=0)
    study.initial("half", N=1.0)
    by_predicate = Study(study.mesh)
    by_predicate.add("string", taut, N=4.0)
    by_predicate.fix("boundary", w=0)
    by_predicate.initial(lambda x: x[:, 0] < 1 + 1e-9, N=1.0)
    root = np.sqrt(0.5)

    def joint(omega: float) -> float:
        k, K = omega * root, omega * root / 2
        return float(k * np.cos(k) * np.sin(K) + 4 * K * np.cos(K) * np.sin(k))

    omega = brentq(joint, 1.0, 4.0)
    for each in (study, by_predicate):
        found = each.modes(1, mass=MASS).frequencies[0]
        assert found == pytest.approx(omega / (2 * np.pi), 1e-5)


def test_a_free_body_takes_its_initial_plastic_strain() -> None:
    mesh = Mesh.box((2, 1, 1), cells=(2, 1, 1))
    study = Study(mesh.with_group("end", lambda x: x[:, 0] > 1))
    study.add("bar", material="j2", E=100.0, nu=0.3, sy=5.0, H=1.0, H_kin=0.0)
    study.fix("left", u_x=0)
    study.fix((0.0, 0.0, 0.0), u_y=0, u_z=0)
    study.fix((0.0, 1.0, 0.0), u_z=0)
    study.initial("end", p_xx=0.01, p_yy=-0.005, p_zz=-0.005)
    study.initial(alpha=0.02)
    result = study.solve()
    assert result.at((1, 1, 1))["u_x"] < 0.004 < 0.009 < result.at((2, 1, 1))["u_x"]
    study.initial(p_xx=0.01, p_yy=-0.005, p_zz=-0.005)
    result = study.solve()
    assert result.at((2, 1, 1))["u_x"] == pytest.approx(0.02, rel=1e-9)
    assert result.at((2, 1, 1))["u_y"] == pytest.approx(-0.005, rel=1e-9)
    assert np.allclose(result.state["bar"].max(), 0.02)


def creep_study(v: Any = None) -> Study:
    study = Study(Mesh.line(1.0, cells=2))
    study.add("bar", creeping, E=1.0, tau=0.5)
    study.fix("left", u_x=0)
    if v is not None:
        study.initial(v=v)
    return study


def test_a_march_begins_with_the_history(tmp_path: Path) -> None:
    """The strain is half of the viscous one, which decays with 2 tau."""
    (result,) = creep_study(0.3).march(dt=0.1, until=0.1)
    expected = 0.3 / (1 + 0.1 / 0.5 / 2)
    assert np.allclose(result.fields("bar")["viscous"], expected, rtol=1e-12)
    *_, known = creep_study(0.3).march(dt=0.1, until=0.4)
    file = tmp_path / "bar.npz"
    list(creep_study(0.3).march(dt=0.1, until=0.2, checkpoint=file))
    *_, again = creep_study().march(dt=0.1, until=0.4, restart=file)
    assert np.array_equal(again.x, known.x)
    (start,) = creep_study(0.3).march(dt=0.1, until=0.1)
    *_, gone_on = creep_study(0.7).march(dt=0.1, until=0.4, start=start)
    assert np.allclose(gone_on.x, known.x, atol=1e-15)


def test_derivatives_by_initial_history() -> None:
    *_, result = creep_study(0.3).march(dt=0.1, until=0.4, record=True)
    by: Any = {"bar": ["v", "tau"]}
    slopes = result.sensitivity("u_x", at=(1.0,), by=by)
    assert np.sum(slopes["bar", "v"]) == pytest.approx(result.at((1.0,))["u_x"] / 0.3, 1e-10)
    v = ("bar", "v")
    mixed = result.hessian("u_x", at=(1.0,), by=by)[v, ("bar", "tau")]
    assert np.sum(mixed) == pytest.approx(slopes["bar", "tau"] / 0.3, 1e-9)


def test_an_initial_shape_selects_the_state_of_a_balloon() -> None:
    """A neo-Hookean sphere has two radii at one pressure: p R / (2 mu t) = 1/x - 1/x^7."""
    pressure = 1 / 1.2 - 1.2**-7
    large = brentq(lambda x: 1 / x - x**-7 - pressure, 1.4, 3.0)
    for start, radius in ((0.15, 1.2), (0.9, large)):
        study = balloon(2 * pressure)
        for k, axis in enumerate("xyz"):
            study.initial(**{f"u_{axis}": start * study.mesh.points[:, k]})  # type: ignore[arg-type]
        begins = study.system().at_rest()
        assert np.abs(begins).max() == pytest.approx(start)
        if radius < RADIUS_OF_MOST_PRESSURE:
            result = study.solve(until=0.0)
        else:
            with pytest.warns(UnstableState):
                result = study.solve(until=0.0)
        found = 1 + result.at((1.0, 0.0, 0.0))["u_x"]
        assert found == pytest.approx(radius, rel=0.02)


def balloon(pressure: float) -> Study:
    n = 4
    s = np.tan(np.pi / 4 * np.linspace(0.0, 1.0, n + 1))
    flat = Mesh.rectangle(1.0, 1.0, cells=(n, n))
    a, b = np.interp(flat.points.T, np.linspace(0.0, 1.0, n + 1), s)
    first = np.stack([1 + 0 * a, a, b], axis=1) / np.sqrt(1 + a**2 + b**2)[:, None]
    points = np.concatenate([first, np.roll(first, 1, 1), np.roll(first, 2, 1)])
    cells = np.concatenate([flat.cells["quad4"] + k * len(first) for k in range(3)])
    _, kept, place = np.unique(points.round(9), axis=0, return_index=True, return_inverse=True)
    study = Study(Mesh(points[kept], {"quad4": place.reshape(-1)[cells]}))
    study.add("skin", element="membrane", mu=1.0, t=1.0, slack=1e-6, p=pressure)
    for k, axis in enumerate("xyz"):
        study.fix(np.flatnonzero(np.isclose(points[kept][:, k], 0)), **{f"u_{axis}": 0})
    return study


@softehl.page
def tension_at_sides(m: softehl.Fields) -> None:
    """Another page with a datum N, and an unknown v."""
    v = m.scalar("v")
    (w,) = m.point_data(w="stiffness")
    m.minimise(w * v**2 / 2)


def test_wrong_names_and_places_are_refused_with_what_is_allowed() -> None:
    study = string(2)
    with pytest.raises(StudyError, match=r"'left', N=.*: 'N' stands at .*group of cells.*: none"):
        study.initial("left", N=1.0)
    with pytest.raises(StudyError, match=r"did you mean .string.*there are string"):
        study.initial(block="strin", N=1.0)
    with pytest.raises(StudyError, match=r"block 'string' has no data of points 'M'; it has N"):
        study.initial(block="string", M=1.0)
    with pytest.raises(StudyError, match=r"'string': N: given .*\(3,\); allowed are a number,"):
        study.initial(N=np.ones(3))
    study.initial(T=1.0)
    with pytest.raises(StudyError, match="no unknown 'T'; at nodes: w; data of points: N"):
        study.system()
    early = Study(Mesh.line(1.0, cells=2))
    early.initial(N=1.0)
    early.add("string", taut)
    with pytest.raises(StudyError, match="data of points of 'string': add the block before"):
        early.system()
    study.add("foundation", tension_at_sides)
    with pytest.raises(StudyError, match=r"'w' is an unknown, and data.*say block='foundation'"):
        study.initial(w=1.0)
    study.initial(block="foundation", w=1.0)


def test_a_path_does_not_miss_a_change_of_the_history() -> None:
    study = creep_study()
    path = study.march(dt=0.1, until=0.3)
    next(path)
    study.initial(v=1.0)
    with pytest.raises(StudyError, match="the study was changed on its way"):
        next(path)
