"""Bifurcations of paths: found, located, and followed to the other branch."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.special import ellipe, ellipk

from softehl import Definition, Model, quadrature
from softehl.runtime.analyses.bifurcation import MissedBifurcations, critical_point
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.study import Study, StudyError
from tests.runtime.field_pages import rubber_by_log as rubber
from tests.runtime.test_follow import shallow
from tests.runtime.touching_bodies import elastic

K = 3.0


@cache
def link() -> Definition:
    """A rigid link of length 1 on a torsional spring, pressed along its axis by P."""
    m = Model("link", nodes=1, rule=quadrature.point_rule())
    ((q,),) = m.nodal_unknowns("q")
    k, P = m.parameters(k="stiffness", P="force")
    m.potential(k / 2 * q**2 - P * (1 - sp.cos(q)))
    return m.finish()


def column() -> Study:
    study = Study(Mesh.line(1.0, cells=1))
    study.add("link", link(), on=lambda x: x[:, 0] == 0.0, k=K, P=lambda t: t)
    return study


def far(result: Any) -> bool:
    return bool(abs(result.values("q")[0]) > 1.0)


def test_a_link_buckles_to_both_sides() -> None:
    """P = k q / sin q on the other branch."""
    study = column()
    straight = study.follow(step=0.7, until=lambda r: r.t > 5.0, detect="bifurcation")
    (found,) = straight.bifurcations
    assert found.located
    assert found.directions == 1
    assert found.t == pytest.approx(K, rel=1e-9)
    for start, side in ((found, 1.0), (found.reversed, -1.0)):
        path = study.follow(start=start, step=0.1, until=far)
        q = np.array([r.values("q")[0] for r in path.results[1:]])
        t = np.array([r.t for r in path.results[1:]])
        assert (q * side > 0.0).all()
        np.testing.assert_allclose(t, K * q / np.sin(q), rtol=1e-9)
        assert path.results[-1].unstable == 0
    assert straight.results[-1].unstable == 1


def resting() -> Study:
    """A block that lies on another one, which nothing else holds."""
    lower = Mesh.rectangle(1, 1, cells=(2, 2))
    study = Study(Mesh.union(lower=lower, upper=lower.map(lambda x: np.add(x, [0, 1]))))
    study.add("body", elastic, mu=1.0, K=5.0)
    study.contact("upper:bottom", "lower:top", friction=0.3)
    study.fix("lower:bottom", u_x=0, u_y=0)
    study.load("upper:top", u_y=-0.05)
    return study


def test_a_path_that_cannot_see_bifurcations_says_so() -> None:
    with pytest.warns(MissedBifurcations, match="no symmetric, regular tangent at load factor"):
        path = resting().follow(step=0.5, until=lambda r: r.t > 1.0, detect="bifurcation")
    assert path.results[-1].unstable is None


def test_a_limit_point_is_no_bifurcation() -> None:
    path = shallow().follow(
        step=0.01, until=lambda r: r.values("w")[0] > 0.42, detect="bifurcation"
    )
    assert len(path.limits) == 2
    assert path.bifurcations == ()
    assert {r.unstable for r in path.results} == {0, 1}


def test_a_column_becomes_an_elastica() -> None:
    """Euler's curve, by elliptic integrals of half the angle at the end."""
    length, height, young = 100.0, 1.0, 2000.0
    study = Study(Mesh.rectangle(length, height, cells=(25, 1), order=2))
    study.add("body", rubber, mu=young / 2, lame=0.0)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_x=-1.0 / height)
    euler = np.pi**2 * young * height**3 / 12 / (4 * length**2)
    straight = study.follow(
        step=0.3 * euler, until=lambda r: r.t > 1.5 * euler, detect="bifurcation"
    )
    (found,) = straight.bifurcations
    assert found.t == pytest.approx(euler, rel=1e-3)
    tip = (length, height / 2)
    path = study.follow(start=found, step=0.05, until=lambda r: abs(r.at(tip)["u_y"]) > 60.0)
    assert len(path.results) > 5
    for result in path.results[1:]:
        angle = turned(result, length, height)
        k = np.sin(angle / 2)
        load = (2 * ellipk(k**2) / np.pi) ** 2 * euler
        assert result.t == pytest.approx(load, rel=3e-3)
        assert abs(result.at(tip)["u_y"]) == pytest.approx(2 * k / ellipk(k**2) * length, rel=5e-3)
        shortened = length * (2 - 2 * ellipe(k**2) / ellipk(k**2))
        assert -result.at(tip)["u_x"] == pytest.approx(shortened, rel=1e-2, abs=5e-3)
    assert path.results[-1].unstable == 0


def turned(result: Any, length: float, height: float) -> float:
    """Angle of the section at the end."""
    top, bottom = (result.at((length, y)) for y in (height, 0.0))
    return float(np.arcsin(abs(top["u_x"] - bottom["u_x"]) / height))


def test_what_is_refused() -> None:
    study = column()
    with pytest.raises(StudyError, match=r"detect = 'bifurcations': allowed are"):
        study.follow(step=0.5, until=lambda r: True, detect="bifurcations")  # type: ignore[arg-type]


def test_what_is_nearly_singular_is_looked_for_with_contact() -> None:
    result = resting().solve()
    sought = result.system.problem(result.system.quasi_static_step(1.0, result.x, {}))
    found = critical_point(sought, 1.0, result.x)
    assert abs(found.value) > 1e-3  # without contact the block is free
    assert found.value == pytest.approx(critical_point(sought.at(result.x), 1.0, result.x).value)
