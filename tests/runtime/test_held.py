"""A body that floats is refused, whatever rounding makes of its matrix; one that is held is not."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.sparse import csc_array, lil_array

from softehl import Definition, Mesh, Model, Study, kinematics, quadrature, shapes
from softehl.runtime.solve.linear.superlu import SuperLU
from softehl.runtime.solve.singularity_check import unconstrained_unknown
from softehl.runtime.solve.solution import NotConverged
from tests.runtime import solid_page as pages
from tests.runtime.test_measure import bar

SOLID: dict[str, Any] = {"mu": 0.4, "lame": 2.0, "thickness": 1.0}


def pulled() -> Study:
    """A rectangle pulled at both ends."""
    study = Study(Mesh.rectangle(2.0, 1.0, cells=(4, 2)))
    study.add("body", pages.solid(), **SOLID)
    study.load("left", u_x=-0.05)
    study.load("right", u_x=0.05)
    return study


WAYS: dict[str, Callable[[Study], object]] = {
    "solve": Study.solve,
    "march": lambda study: list(study.march(dt=0.5, until=1.0)),
    "follow": lambda study: study.follow(step=0.5, until=lambda r: r.t > 1.0),
}


@pytest.mark.parametrize("held", [{}, {"u_x": 0.0}, {"u_y": 0.0}])
@pytest.mark.parametrize("way", WAYS)
def test_a_body_in_balance_that_nothing_holds(held: dict[str, float], way: str) -> None:
    study = pulled()
    if held:
        study.fix((0.0, 0.0), **held)
    with pytest.raises(NotConverged):
        WAYS[way](study)


FREE: dict[str, tuple[Callable[[Study], object], str]] = {
    "nothing": (lambda s: None, "a translation along x, a translation along y, a rotation[.]"),
    "a roller": (lambda s: s.fix("bottom", u_y=0.0), "a translation along x[.]"),
    "a pin": (lambda s: s.fix((2.0, 1.0), u_x=0.0, u_y=0.0), r"a rotation about \(2, 1\)[.]"),
    "a spring": (
        lambda s: s.spring((2.0, 1.0), u_x=1e-3, u_y=1e-3),
        r"a rotation about \(2, 1\)[.]",
    ),
    "ties": (
        lambda s: s.tie("right", "left", "u_x", "u_y"),
        "a translation along x, a translation along y[.]",
    ),
}


@pytest.mark.parametrize("held", FREE)
@pytest.mark.parametrize("load", [0.0, 1e-12, 0.05])
def test_the_free_motion_is_named_before_anything_is_solved(held: str, load: float) -> None:
    support, words = FREE[held]
    study = Study(Mesh.rectangle(2.0, 1.0, cells=(4, 2)))
    study.add("body", pages.solid(), **SOLID)
    study.load("right", u_x=load)
    support(study)
    with pytest.raises(NotConverged, match=f"not held: nothing prevents {words}"):
        study.solve()


@pytest.mark.filterwarnings("ignore:4 of 12 cells of the mesh have no elements")  # between them
def test_the_one_of_two_bodies_that_is_free_is_named() -> None:
    mesh = Mesh.rectangle(3.0, 1.0, cells=(6, 2)).with_group("a", lambda x: x[:, 0] < 1.1)
    study = Study(mesh.with_group("b", lambda x: x[:, 0] > 1.9))
    for name in "ab":
        study.add(name, pages.solid(), cells=name, **SOLID)
    study.fix("left", u_x=0.0, u_y=0.0)
    with pytest.raises(NotConverged, match=r"a rotation of the part with node 4 \(2, 0\)"):
        study.solve()


def test_a_temperature_that_nothing_sets_is_named() -> None:
    study = Study(Mesh.line(1.0, cells=4))
    study.add("bar", bar(), k=1.0)
    with pytest.raises(NotConverged, match=r"nothing prevents a constant added to T[.]"):
        study.solve()
    study.spring("left", T=1e-6)
    study.load("right", T=1e-6)
    assert study.solve().at((0.0,))["T"] == pytest.approx(1.0)


def test_a_floor_holds_what_is_pressed_into_it() -> None:
    """It holds at the start already: its nodes are a little below."""
    study = Study(Mesh.rectangle(2.0, 1.0, cells=(4, 2)).map(lambda x: x - np.array([0.0, 1e-3])))
    study.add("body", pages.solid(), **SOLID)
    study.add("floor", pages.floor(), on="bottom", k=10.0)
    study.fix((0.0, -1e-3), u_x=0.0)
    study.load("top", u_y=lambda x, t: np.full(len(x), -1e-2))
    assert 0.0 < study.solve().at((0.0, -1e-3))["u_y"] < 1e-3


def chain(n: int, ground: float) -> csc_array[np.float64]:
    """A chain of n springs of stiffness 1, whose first is held by another."""
    K = lil_array((n, n))
    K.setdiag(np.full(n, 2.0))
    K.setdiag(-np.ones(n - 1), 1)
    K.setdiag(-np.ones(n - 1), -1)
    K[0, 0], K[n - 1, n - 1] = 1.0 + ground, 1.0
    return csc_array(K)


@pytest.mark.parametrize(("n", "ground"), [(10, 1.0), (20_000, 1.0), (10, 1e-8)])
def test_badly_conditioned_is_not_loose(n: int, ground: float) -> None:
    K = chain(n, ground)
    assert unconstrained_unknown(K, SuperLU().factorise(K)) is None


def test_held_by_rounding_is_loose() -> None:
    K = chain(10, 1e-15)
    assert unconstrained_unknown(K, SuperLU().factorise(K)) is not None


def springy() -> Definition:
    """A linear elastic brick."""
    m = Model("brick", nodes=8, rule=quadrature.gauss(2, 3))
    X, u = m.coordinates("X", "Y", "Z"), m.nodal_unknowns("u_x", "u_y", "u_z")
    e = kinematics.isoparametric(m, X, shapes.hex8_gradient(*m.point()))
    F = kinematics.deformation_gradient(m, e.dN, u)
    eps = (F + F.T) / 2 - sp.eye(3)
    m.potential(m.integral("Pi", (eps.trace() ** 2 + (eps.T * eps).trace()) * e.detJ))
    return m.finish()


def test_a_body_of_three_dimensions_on_a_hinge() -> None:
    study = Study(Mesh.box((1.0, 2.0, 1.0), cells=(1, 2, 1)))
    study.add("body", springy())
    study.fix(lambda x: (x[:, 0] == 0.0) & (x[:, 2] == 1.0), u_x=0.0, u_y=0.0, u_z=0.0)
    with pytest.raises(NotConverged, match=r"a rotation about y through \(0, 1, 1\)[.]"):
        study.solve()
