"""Time and history in studies: closed forms, orders, adaptive steps, restart, refusals."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

import softehl
from softehl import Definition, Mesh, Model, Study, element, kinematics, quadrature
from softehl.runtime.analyses.time_integrators import BDF2
from softehl.runtime.results.result import Result
from softehl.runtime.solve.solution import NotConverged, Status
from softehl.runtime.study import StudyError


@cache
def heat() -> Definition:
    """du/dt = d2u/dx2, lines of 2 nodes, capacity lumped at the nodes by its rule."""
    m = Model("heat", nodes=2, rule=quadrature.gauss(2, 1))
    X = m.coordinates("X")
    (u,) = m.nodal_unknowns("u")
    (k,) = m.parameters(k="conductivity")
    (u_dot,) = m.rates("u")
    kind, (xi,) = element("line2"), m.point()
    e = kinematics.isoparametric(m, X, kind.gradient(xi))
    N = kind.shape(xi)
    slope = m.define("slope", sum(d[0] * v for d, v in zip(e.dN, u, strict=True)))
    value = m.define("value", sum(a * v for a, v in zip(N, u, strict=True)))
    rate = m.define("rate_of_u", sum(a * v for a, v in zip(N, u_dot, strict=True)))
    m.weak_form([(k * slope * e.detJ, slope), (rate * e.detJ, value)])
    return m.finish()


@cache
def maxwell() -> Definition:
    """A bar with a spring beside a spring and a linear dashpot in series; v is its strain."""
    m = Model("maxwell", nodes=2, rule=quadrature.gauss(1, 1), unroll=True)
    (X,) = m.coordinates("X")
    (u,) = m.nodal_unknowns("u")
    E, tau, dt = m.parameters(E="modulus [MPa]", tau="time of relaxation [s]", dt="step [s]")
    (v_old,) = m.point_data(v_old="strain of the dashpot at the beginning of the step")
    length = m.define("length", X[1] - X[0])
    strain = m.define("strain", (u[1] - u[0]) / length)
    v = m.define("v", (v_old + dt / tau * strain) / (1 + dt / tau))
    stress = m.define("stress", E * strain + E * (strain - v))
    m.weak_form([(stress * length / 2, strain)])
    m.fields(stress=stress)
    m.history(v_old=v)
    return m.finish()


def rod(cells: int = 40) -> Study:
    """A rod of length 1 with a half wave of temperature, cold at both ends."""
    study = Study(Mesh.line(1.0, cells=cells))
    study.add("rod", heat(), k=1.0)
    study.fix("left", u=0.0)
    study.fix("right", u=0.0)
    study.start(u=lambda x: np.sin(np.pi * x[:, 0]))
    return study


def middle(results: list[Result]) -> float:
    return results[-1].at((0.5,))["u"]


@pytest.mark.parametrize(("method", "order"), [("euler", 1), ("bdf2", 2)])
def test_orders_in_time(method: str, order: int) -> None:
    """Against the mesh's own mode, whose decay is known: only the error of time is left."""
    study, until = rod(), 0.1
    h = 1.0 / 40
    stiffness = 2.0 / h * (1.0 - np.cos(np.pi * h))
    capacity = h / 3.0 * (2.0 + np.cos(np.pi * h))
    exact = np.exp(-stiffness / capacity * until)
    errors = []
    for steps in (40, 80):
        march = study.march(dt=until / steps, until=until, method=method)  # type: ignore[arg-type]
        errors.append(abs(middle(list(march)) - exact))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)


def test_adaptive_steps_keep_the_tolerance() -> None:
    study, until = rod(), 0.5
    exact, errors = np.exp(-(np.pi**2) * until), []
    for tolerance in (1e-2, 1e-3):
        march = study.march(dt=1e-4, until=until, method="bdf2", tolerance=tolerance)
        results = list(march)
        times = [0.0, *(r.t for r in results)]
        steps = np.diff(times)
        assert results[-1].t == pytest.approx(until)
        assert steps.max() > 10 * steps.min()
        errors.append(abs(middle(results) / exact - 1.0) / len(results))  # of one step
        assert errors[-1] < 3.0 * tolerance
    assert errors[1] < 0.3 * errors[0]
    fewer = list(study.march(dt=1e-4, until=until, method="bdf2", tolerance=1e-2))
    assert len(fewer) < len(results)


def test_history_relaxes_as_the_closed_form_of_backward_euler() -> None:
    study = Study(Mesh.line(2.0, cells=3))
    study.add("bar", maxwell(), E=10.0, tau=0.5)
    study.fix("left", u=0.0)
    study.fix("right", u=0.02)
    dt, results = 0.1, []
    for n, result in enumerate(study.march(dt=0.1, until=1.0), start=1):
        results.append(result)
        dashpot = 0.01 * (1.0 - (1.0 + dt / 0.5) ** -n)
        stress = 10.0 * 0.01 + 10.0 * (0.01 - dashpot)
        np.testing.assert_allclose(result.fields("bar")["stress"], stress, rtol=1e-10)
    assert len(results) == 10
    assert list(results[-1].fields("bar")) == ["stress"], "history is no result of its own"
    wrong = 10.0 * 0.01 + 10.0 * 0.01 * np.exp(-1.0 / 0.5)  # the limit dt -> 0, not this dt
    assert results[-1].fields("bar")["stress"][0, 0] != pytest.approx(wrong, rel=1e-3)


def test_history_in_load_steps_is_committed_once_each() -> None:
    """Plasticity without hardening: what is stretched and let go keeps its plastic strain."""
    m = Model("plastic", nodes=2, rule=quadrature.gauss(1, 1), unroll=True)
    (X,) = m.coordinates("X")
    (u,) = m.nodal_unknowns("u")
    E, sy, H = m.parameters(E="modulus", sy="yield stress", H="hardening")
    ep_old, alpha_old = m.point_data(ep_old="plastic strain", alpha_old="its length")
    length = m.define("length", X[1] - X[0])
    strain = m.define("strain", (u[1] - u[0]) / length)
    trial = m.define("trial", E * (strain - ep_old))
    excess = m.define("excess", sp.Abs(trial) - sy - H * alpha_old)
    dg = m.define("dg", sp.Piecewise((excess / (E + H), excess > 0), (0, True)))
    stress = m.define("stress", trial - E * dg * sp.sign(trial))
    m.weak_form([(stress * length / 2, strain)])
    m.fields(stress=stress)
    m.history(ep_old=ep_old + dg * sp.sign(trial), alpha_old=alpha_old + dg)
    study = Study(Mesh.line(1.0, cells=2))
    study.add("bar", m.finish(), E=100.0, sy=1.0, H=10.0)
    study.fix("left", u=0.0)
    study.fix("right", u=lambda x, t: np.full(len(x), 0.05 * min(t, 2.0 - t)))
    there = study.solve(steps=7)
    yielded = 1.0 + 10.0 * (100.0 * 0.05 - 1.0) / 110.0
    assert there.fields("bar")["stress"][0, 0] == pytest.approx(yielded, rel=1e-10)
    plastic = (100.0 * 0.05 - 1.0) / 110.0
    back = study.solve(start=there, until=1.0 + 0.2, steps=3)
    assert back.fields("bar")["stress"][0, 0] == pytest.approx(
        100.0 * (0.05 * 0.8 - plastic), rel=1e-9
    )


def test_what_is_refused(tmp_path: Path) -> None:
    study = rod(4)
    with pytest.raises(StudyError, match="dt = 0"):
        study.march(dt=0.0, until=1.0)
    with pytest.raises(StudyError, match="allowed are"):
        study.march(dt=0.1, until=1.0, method="bdf3")  # type: ignore[arg-type]
    with pytest.raises(StudyError, match="missing or damaged"):
        study.march(dt=0.1, until=1.0, restart=tmp_path / "nothing.npz")
    file = tmp_path / "other.npz"
    list(rod(5).march(dt=0.1, until=0.1, checkpoint=file))
    with pytest.raises(StudyError, match="another study: other nodes or cells"):
        study.march(dt=0.1, until=1.0, restart=file)
    study.start(T=1.0)
    with pytest.raises(StudyError, match="no unknown 'T'"):
        study.system()


def test_a_checkpoint_that_was_edited_is_refused(tmp_path: Path) -> None:
    """Temperatures, a time, a name: whatever a restart believes."""
    file = tmp_path / "rod.npz"
    list(rod(4).march(dt=0.1, until=0.1, checkpoint=file))
    with np.load(file) as content:
        good = {name: content[name] for name in content.files}
    for name in good:
        edited = good[name].copy()
        edited.flat[-1] += 1
        np.savez(file, **{**good, name: edited})
        with pytest.raises(StudyError, match="missing or damaged"):
            rod(4).march(dt=0.1, until=0.2, restart=file)
    np.savez(file, **good)
    (step,) = rod(4).march(dt=0.1, until=0.2, restart=file)
    assert step.t == pytest.approx(0.2)


def test_a_step_that_was_cut_grows_again_to_what_was_asked_for() -> None:
    """A page that has no solution in long steps before t = 1: afterwards steps are 0.4 again."""
    m = Model("early", nodes=1, rule=quadrature.point_rule())
    ((u,),) = m.nodal_unknowns("u")
    dt, t = m.parameters(dt="step", t="time")
    late = sp.Piecewise((u - 1, t > 1), (u - 1, dt < 0.11), (u**2 + 1, True))
    m.weak_form([(late, u)])
    study = Study(Mesh.line(1.0, cells=1))
    study.add("early", m.finish(), on="boundary", t=lambda t: t)
    times = [0.0, *(r.t for r in study.march(dt=0.4, until=4.0))]
    steps = np.diff(times)
    assert steps[0] == pytest.approx(0.1)
    assert steps.max() == pytest.approx(0.4)


def test_arguments_that_a_study_fills_and_those_it_does_not() -> None:
    """dt and the rate are its own; t, or a rate of the page's own, must be given."""
    m = Model("own", nodes=1, rule=quadrature.point_rule())
    ((u,),) = m.nodal_unknowns("u")
    t, rate, dt = m.parameters(t="thickness", rate="of creep", dt="step")
    m.weak_form([(t * u + rate * dt - 1, u)])
    study = Study(Mesh.line(1.0, cells=1))
    with pytest.raises(StudyError, match=r"own needs t, rate; where t is .* t=lambda t: t"):
        study.add("own", m.finish(), on="boundary")
    study.add("own", m.finish(), on="boundary", t=2.0, rate=1.0)
    (step,) = study.march(dt=0.5, until=0.5)
    assert step.at((0.0,))["u"] == pytest.approx(0.25)
    with pytest.raises(StudyError, match=r"'own': own has dt.* no time: march, or give dt="):
        study.solve()
    with pytest.raises(StudyError, match="rate comes from the steps in time"):
        rod(4).add("other", heat(), k=1.0, rate=2.0)


def test_a_march_that_cannot_go_on_says_when_and_why() -> None:
    """u^2 = 1 - t has no solution after t = 1."""
    m = Model("closing", nodes=1, rule=quadrature.point_rule())
    ((u,),) = m.nodal_unknowns("u")
    (t,) = m.parameters(t="time")
    m.weak_form([(u**2 - 1 + t, u)])
    study = Study(Mesh.line(1.0, cells=1))
    study.add("closing", m.finish(), on=lambda x: x[:, 0] == 0.0, t=lambda t: t)
    study.start(u=1.0)
    reached = list[float]()
    with pytest.raises(NotConverged, match=r"turns back: at about t = (0\.97|1)") as error:
        reached.extend(result.t for result in study.march(dt=0.1, until=2.0))
    assert error.value.result.status is Status.TURNING_POINT
    assert isinstance(error.value.reached, Result)
    assert error.value.reached.t == reached[-1]


def test_a_local_error_that_no_step_keeps_ends_a_march() -> None:
    """A jump of the load from 0 to 1, relative to which no step is short enough."""
    study = Study(Mesh.line(1.0, cells=4))
    study.add("rod", heat(), k=1.0)
    study.fix("right", u=lambda x, t: np.full(len(x), float(t > 0.05)))
    march = study.march(dt=1e-2, until=0.1, tolerance=1e-2)
    with pytest.raises(NotConverged, match=r"refused.*the local error is above its tolerance"):
        list(march)


@softehl.page
def viscous(m: Any) -> None:
    """E grad u + eta d(grad u)/dt, by the step before."""
    u = m.vector("u")
    E, eta, dt = m.parameters(E="stiffness", eta="viscosity", dt="length of the step")
    now, before = m.grad(u), m.grad(m.previous(u))
    m.weak(E * now + eta * (now - before) / dt, now)


def test_adaptive_steps_pass_the_moment_of_touch() -> None:
    """Two bars of Kelvin and Voigt, the gap of which closes at a speed: the force jumps."""
    bar = Mesh.rectangle(1, 1, cells=(1, 1))
    study = Study(Mesh.union(a=bar.map(lambda x: x + np.array([1.01, 0.0])), b=bar))
    for name in ("a", "b"):
        study.add(name, viscous, cells=name, E=10.0, eta=2.0)
    study.contact("a:left", "b:right")
    study.fix("b:left", u_x=0, u_y=0)
    study.fix("a:boundary", u_y=0)
    study.fix("a:right", u_x=lambda x, t: np.full(len(x), -0.1 * np.sin(t)))
    *_, last = study.march(dt=0.05, until=1.4, tolerance=3e-3)
    exact = (10.0 * (0.1 * np.sin(1.4) - 0.01) + 2.0 * 0.1 * np.cos(1.4)) / 2
    assert last.reaction("b:left")["u_x"] == pytest.approx(exact, rel=0.02)


def test_differences_are_exact_for_straight_lines_and_parabolas() -> None:
    t = np.array([1.0, 0.7, 0.2])
    assert BDF2().weights([0.3]) @ t[:2] == pytest.approx(1.0)
    assert BDF2().weights([0.3, 0.5]) @ t**2 == pytest.approx(2.0)
    assert BDF2().weights([0.3, 0.5]).sum() == pytest.approx(0.0)
