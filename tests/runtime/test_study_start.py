"""Paths that begin with a result: its values, but the equations of the study that goes on."""

from __future__ import annotations

from functools import cache

import pytest

from softehl import Definition, Mesh, Model, Study, quadrature
from softehl.runtime.results.result import Result
from softehl.runtime.study import StudyError


@cache
def spring() -> Definition:
    """A node on a spring that hardens, with a force and a slider: s follows what u has been."""
    m = Model("spring", nodes=1, rule=quadrature.point_rule())
    ((u,),) = m.nodal_unknowns("u")
    (k,) = m.parameters(k="stiffness")
    (most_old,) = m.point_data(most_old="largest u so far")
    m.weak_form([(k * u, u)])
    m.fields(most=most_old)
    m.history(most_old=most_old + u)
    return m.finish()


@cache
def dashpot() -> Definition:
    """A node on a spring and a dashpot of 1."""
    m = Model("dashpot", nodes=1, rule=quadrature.point_rule())
    ((u,),) = m.nodal_unknowns("u")
    (k,) = m.parameters(k="stiffness")
    ((rate,),) = m.rates("u")
    m.weak_form([(k * u + rate, u)])
    return m.finish()


@cache
def multiplier() -> Definition:
    """An unknown of the element alone: p = c u."""
    m = Model("multiplier", nodes=1, rule=quadrature.point_rule())
    ((u,),) = m.nodal_unknowns("u")
    p = m.unknown("p")
    (c,) = m.parameters(c="factor")
    m.weak_form([(p - c * u, p)])
    return m.finish()


def sprung(k: float, mesh: Mesh | None = None) -> Study:
    study = Study(mesh or Mesh.line(1.0, cells=1))
    study.add("spring", spring(), on="boundary", k=k)
    study.load((0.0,), u=1.0)
    return study


def left(result: Result) -> float:
    return float(result.at((0.0,))["u"])


def test_the_equations_are_those_of_the_study_that_solves() -> None:
    soft = sprung(1.0).solve()
    assert left(soft) == pytest.approx(1.0)
    stiff = sprung(4.0)
    assert left(stiff.solve(start=soft)) == pytest.approx(0.25)
    assert left(stiff.solve(start=soft, until=2.0, steps=2)) == pytest.approx(0.5)
    path = stiff.follow(step=0.5, until=lambda r: r.t > 1.9, start=soft)
    assert path.results[0].t == 1.0
    assert left(path.results[-1]) == pytest.approx(path.results[-1].t / 4.0)
    damped = Study(soft.system.mesh)
    damped.add("dashpot", dashpot(), on="boundary", k=2.0)
    (step,) = damped.march(dt=0.5, until=1.5, start=soft)
    assert left(step) == pytest.approx(1.0 / (1.0 + 0.5 * 2.0)), "u / dt + 2 u = u_old / dt"


def test_loads_and_supports_that_are_added_count() -> None:
    study = sprung(1.0)
    first = study.solve()
    study.load((0.0,), u=2.0)
    study.fix((1.0,), u=5.0)
    again = study.solve(start=first)
    assert (again.t, left(again), again.at((1.0,))["u"]) == pytest.approx((1.0, 3.0, 5.0))


def test_histories_and_unknowns_of_elements_go_on() -> None:
    study = sprung(2.0)
    study.add("multiplier", multiplier(), on="left", c=3.0)
    first = study.solve()
    assert first.state["spring"][:, 0, 0] == pytest.approx([0.5, 0.0])
    other = sprung(4.0)
    other.add("multiplier", multiplier(), on="left", c=3.0)
    (step,) = other.march(dt=1.0, until=2.0, start=first)
    assert step.values("p") == pytest.approx([0.75])
    assert step.state["spring"][:, 0, 0] == pytest.approx([0.75, 0.0])
    assert first.state["spring"][:, 0, 0] == pytest.approx([0.5, 0.0]), "the result is not touched"


def test_what_does_not_fit_is_refused() -> None:
    first = sprung(1.0).solve()
    with pytest.raises(StudyError, match="of another mesh"):
        sprung(1.0, Mesh.line(2.0, cells=1)).solve(start=first)
    other = sprung(1.0)
    m = Model("follower", nodes=1, rule=quadrature.point_rule())
    ((w,),) = m.nodal_unknowns("w")
    m.weak_form([(w - w**2, w)])
    other.add("follower", m.finish(), on="right")
    with pytest.raises(StudyError, match=r"no 'w' at node 1 .*study\.initial\(w=\.\.\.\)"):
        other.solve(start=first)
    other.start(w=0.9)
    assert other.solve(start=first).at((1.0,))["w"] == pytest.approx(1.0)
    fewer = Study(first.system.mesh)
    fewer.add("spring", spring(), on="left", k=1.0)
    with pytest.raises(StudyError, match="'spring' has other elements in the result"):
        fewer.solve(start=first)
    with pytest.raises(StudyError, match="give one of them"):
        sprung(1.0).march(dt=0.1, until=2.0, start=first, restart="rod.npz")


def test_a_study_that_is_changed_on_its_way_is_an_error() -> None:
    study = Study(Mesh.line(1.0, cells=1))
    study.add("dashpot", dashpot(), on="boundary", k=2.0)
    march = study.march(dt=0.1, until=0.5)
    last = next(march)
    study.fix("right", u=1.0)
    with pytest.raises(StudyError, match=r"changed on its way.*march\(start=result"):
        next(march)
    (*_, end) = study.march(dt=0.1, until=0.5, start=last)
    assert end.at((1.0,))["u"] == 1.0
    assert len(list(study.march(dt=0.1, until=0.2))) == 2
    for _ in study.march(dt=0.1, until=0.1):
        study.fix("left", u=0.0)  # after the last step: nothing is lost
