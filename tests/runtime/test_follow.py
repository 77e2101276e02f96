"""Paths by arc length over a study: limit points of a shallow truss, refusals, what was reached."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import sympy as sp

from softehl import Definition, Model, quadrature
from softehl.runtime.mesh.mesh import Mesh
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
    found = [limit.t for limit in path.limits]
    np.testing.assert_allclose(found, [turn, -turn], rtol=1e-9)
    places = [limit.x[0] / HEIGHT for limit in path.limits]
    np.testing.assert_allclose(places, [1 - 1 / np.sqrt(3), 1 + 1 / np.sqrt(3)], rtol=1e-5)
    assert not np.allclose(found, [1.001 * turn, -turn], rtol=1e-4), "the oracle can fail"


@cache
def link() -> Definition:
    """A spring between two nodes."""
    m = Model("link", nodes=2, rule=quadrature.point_rule())
    ((a, b),) = m.nodal_unknowns("w")
    (c,) = m.parameters(c="stiffness")
    m.potential(c / 2 * (b - a) ** 2)
    return m.finish()


SOFT = 0.5  # of the spring in series: the truss, k (3 w^2 / 2 - 3 H w + H^2), falls to -2
EVEN = 0.3  # of the load at the truss beside the moving end


def in_series(driven: str) -> Study:
    """The truss behind a spring, driven at the other end of the spring."""
    study = Study(Mesh.line(2.0, cells=2))
    study.add("truss", truss(), on=lambda x: x[:, 0] == 0.0, k=100.0, H=HEIGHT)
    study.add("spring", link(), on=[[0, 1]], c=SOFT)
    study.add("anchor", link(), on=[[1, 2]], c=0.0)
    study.fix((2.0,), w=0.0)
    if driven == "force":
        study.load((1.0,), w=1.0)
    elif driven == "tie":
        study.tie((1.0,), (2.0,), "w", offset=lambda x, t: t)
    else:
        study.fix((1.0,), w=1.0)
    if driven == "both":
        study.load((0.0,), w=EVEN)
    return study


@pytest.mark.parametrize(
    ("driven", "step"),
    [
        *(("force", 0.2), ("fix", 10.0), ("tie", 0.2)),
        pytest.param("both", 10.0, marks=pytest.mark.slow),
    ],
)
def test_a_snap_back_is_followed_however_it_is_driven(driven: str, step: float) -> None:
    """The end is at t = w + F / c, which turns where F' = -c: at w = H (1 -+ 1/2)."""
    path = in_series(driven).follow(step=step, until=lambda r: r.values("w")[0] > 0.42)
    w = np.array([r.values("w")[0] for r in path.results])
    t = np.array([r.t for r in path.results])
    force = 100.0 * w * (w / 2 - HEIGHT) * (w - HEIGHT)
    theory = {"force": force, "both": (SOFT * w + force) / (SOFT + EVEN)}
    np.testing.assert_allclose(t, theory.get(driven, w + force / SOFT), atol=2e-9)
    assert (np.diff(w) > 0.0).all()
    found = [limit.t for limit in path.limits]
    turn = 100.0 * HEIGHT**3 / (3 * np.sqrt(3))
    limits = {"force": (turn, -turn), "both": (0.25, 0.0)}
    np.testing.assert_allclose(found, limits.get(driven, (0.4, 0.0)), atol=2e-9)


def test_a_path_along_which_a_spring_closes_a_gap() -> None:
    """A corner of 72 degrees, at which no step is short enough to be smooth."""
    m = Model("corner", nodes=1, rule=quadrature.point_rule())
    ((w,),) = m.nodal_unknowns("w")
    m.weak_form([(sp.Piecewise((w, w < 1), (sp.Rational(3, 2) - w / 2, True)), w)])
    study = Study(Mesh.line(1.0, cells=1))
    study.add("corner", m.finish(), on=lambda x: x[:, 0] == 0.0)
    study.load((0.0,), w=1.0)
    path = study.follow(step=0.5, until=lambda r: r.values("w")[0] > 2.0)
    (limit,) = path.limits
    assert limit.t == pytest.approx(1.0, abs=1e-3)
    assert not limit.located


def test_what_is_refused() -> None:
    for step in (0.0, -1.0, float("nan")):
        with pytest.raises(StudyError, match=r"must be (positive|finite)"):
            shallow().follow(step=step, until=lambda r: True)
    for linear in ("amg", "matrix-free"):
        with pytest.raises(StudyError, match=f'no linear = "{linear}", it factorises'):
            shallow().follow(step=0.1, until=lambda r: True, linear=linear)


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
