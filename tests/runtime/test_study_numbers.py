"""Numbers as scripts have them, of NumPy and SymPy, lists for arrays; and what is refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import sympy as sp

from softehl import Mesh, Study
from softehl.runtime.mesh.mesh import MeshError
from softehl.runtime.study import StudyError
from tests.runtime import solid_page as pages

SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]]


def held(mesh: Mesh, mu: Any = 0.4) -> Study:
    """A body that stands on its lower side."""
    study = Study(mesh)
    study.add("body", pages.solid(), mu=mu, lame=2.0, thickness=1.0)
    study.fix(lambda x: x[:, 1] == 0, u_x=0, u_y=0)
    return study


def test_numbers_of_numpy_and_sympy_are_numbers() -> None:
    usual = held(Mesh.rectangle(1, 1, cells=(2, 2)))
    usual.load("top", u_y=-0.01)
    tenth = held(Mesh.rectangle(1, 1, cells=np.array([2, 2])), np.array(0.4))  # type: ignore[arg-type]
    tenth.load("top", u_y=-sp.Rational(1, 100))
    found = tenth.solve(steps=np.int64(1)).at((1, 1))  # type: ignore[arg-type]
    assert found == usual.solve().at((1, 1))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda s: s.solve(steps=2.0), r"steps = 2.0: a whole number of at least 1 is needed"),
        (lambda s: s.load("top", u_y=np.array([1.0])), r"u_y = array\(\[1.\]\): a real number"),
        (lambda s: held(s.mesh, [1.0, 2.0]), r"mu has 2 values: .* as data, m.data\(mu=...\)"),
        (
            lambda s: (s.load("top", u_y=lambda x, t: x[0]), s.solve()),
            r"given float64 of shape \(2,\); x has all places, \(9, 2\), in columns: x\[:, 0\]",
        ),
        (lambda s: Mesh.rectangle(1, 1, cells=(2.0, 2)), "2 whole numbers of at least 1"),  # type: ignore[arg-type]
        (lambda s: Mesh(np.array(SQUARE), [("quad4", [])]), "by their kinds, {"),  # type: ignore[arg-type]
        (
            lambda s: Mesh(np.array(SQUARE), {"quad4": np.array([[1, 2, 3, 4]])}),
            "quad4: node numbers from 1 to 4, must be from 0 to 3",
        ),
        (
            lambda s: Mesh(np.array(SQUARE), {"quad4": np.array([[0, 1, 2, 3.0]])}),
            "quad4 has nodes of float64, must be integers",
        ),
    ],
)
def test_what_is_no_number_here_is_told(call: Callable[[Study], Any], words: str) -> None:
    with pytest.raises((StudyError, MeshError), match=words):
        call(held(Mesh.rectangle(1, 1, cells=(3, 1))))
