"""Paths by arc length over a study: limit points of a shallow truss, refusals, what was reached."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from softehl import Definition, Model, quadrature
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.result import Result
from softehl.runtime.solve.solution import NotConverged
from softehl.runtime.study import Study, StudyError

HEIGHT = 0.2


@cache
def truss() -> Definition:
    """A node that moves by w between two shallow bars: W = k / 2 (w^2 / 2 - H w)^2."""
    m = Model("truss", nodes=1, rule=quadrature.point_rule())
    ((w,),) = m.nodal_unknowns("w")
    k, H = m.parameters(k="stiffness", H="height")
    m.potential(k / 2 * (w**2 / 2 - H * w) ** 2)
    return m.finish()


def shallow(k: float = 100.0) -> Study:
    study = Study(Mesh.line(1.0, cells=1))
    study.add("truss", truss(), on=lambda x: x[:, 0] == 0.0, k=k, H=HEIGHT)
    study.load((0.0,), w=1.0)
    return study


def test_a_truss_snaps_through() -> None:
    """t = k w (w / 2 - H) (w - H) turns at w = H (1 -+ 1 / sqrt 3)."""
    study = shallow()
    path = study.follow(step=0.01, until=lambda r: r.values("w")[0] > 2.1 * HEIGHT)
    w = np.array([r.values("w")[0] for r in path.results])
    t = np.array([r.t for r in path.results])
    np.testing.assert_allclose(t, 100.0 * w * (w / 2 - HEIGHT) * (w - HEIGHT), atol=1e-9)
    assert [limit.kind for limit in path.limits] == ["maximum", "minimum"]
    turn = 100.0 * HEIGHT**3 / (3 * np.sqrt(3))
    found = [limit.parameter for limit in path.limits]
    np.testing.assert_allclose(found, [turn, -turn], rtol=1e-9)
    places = [limit.x[0] / HEIGHT for limit in path.limits]
    np.testing.assert_allclose(places, [1 - 1 / np.sqrt(3), 1 + 1 / np.sqrt(3)], rtol=1e-5)
    assert not np.allclose(found, [1.001 * turn, -turn], rtol=1e-4), "the oracle can fail"


def test_an_end_that_is_never_reached() -> None:
    with pytest.raises(NotConverged, match="5 points, the last at load factor") as error:
        shallow().follow(step=0.01, until=lambda r: False, most=5)
    reached = error.value.reached
    assert isinstance(reached, Result)
    assert reached.t > 0.0


def test_what_is_refused() -> None:
    for step in (0.0, -1.0, float("nan")):
        with pytest.raises(StudyError, match=r"must be (positive|finite)"):
            shallow().follow(step=step, until=lambda r: True)


def test_history_is_committed_along_the_path() -> None:
    """A bar that counts its steps: each accepted point adds one, trials add none."""
    m = Model("counter", nodes=1, rule=quadrature.point_rule())
    ((u,),) = m.nodal_unknowns("u")
    (t,) = m.parameters(t="load factor")
    (n,) = m.point_data(n="points so far")
    m.weak_form([(u + u**3 - t, u)])
    m.fields(count=n)
    m.history(n=n + 1)
    study = Study(Mesh.line(1.0, cells=1))
    study.add("counter", m.finish(), on=lambda x: x[:, 0] == 0.0, t=lambda t: t)
    path = study.follow(step=0.2, until=lambda r: r.t > 1.0)
    last = path.results[-1]
    assert last.histories["counter"][0, 0, 0] == len(path.results)
