"""A body that floats is refused, whatever rounding makes of its matrix; one that is held is not."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csc_array, lil_array

from softehl import Mesh, Study
from softehl.runtime.solve.held import loosest
from softehl.runtime.solve.solution import NotConverged
from softehl.runtime.solve.superlu import SuperLU
from tests.runtime import solid_page as pages

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


def test_three_supports_hold_it() -> None:
    study = pulled()
    study.fix((0.0, 0.0), u_x=0.0, u_y=0.0)
    study.fix((2.0, 0.0), u_y=0.0)
    assert study.solve().at((2.0, 0.0))["u_x"] > 0.0


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
    assert loosest(K, SuperLU().factorise(K)) is None


def test_held_by_rounding_is_loose() -> None:
    K = chain(10, 1e-15)
    assert loosest(K, SuperLU().factorise(K)) is not None
