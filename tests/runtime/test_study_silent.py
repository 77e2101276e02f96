"""What once gave wrong numbers without a word, asked of Study: each is right, or a named error.

Not repeated here: misspelt parameters, texts for numbers, two values for one unknown and cells
that are inside out (`test_study`), node orders of all elements (`test_study_elements`), bodies that
float (`test_held`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import sympy as sp

from softehl import Definition, Mesh, Model, Study, quadrature
from softehl.codegen.language.errors import ModelError
from softehl.runtime.solve.solution import NotConverged


def nodal(law: Callable[[Model, Any, Any], Any], name: str) -> Definition:
    """One unknown at a node, whose equation is what `law` makes of it and of a load f."""
    m = Model(name, nodes=1, rule=quadrature.point_rule())
    ((u,),) = m.nodal_unknowns("u")
    (f,) = m.parameters(f="load")
    m.weak_form([(law(m, u, f), u)])
    return m.finish()


def solution(page: Definition, f: float, start: float = 0.0) -> float:
    study = Study(Mesh.line(1.0, cells=1))
    study.add("law", page, on="right", f=f)
    study.add("rest", nodal(lambda m, u, f: u - f, "rest"), on="left", f=0.0)
    study.start(u=start)
    return float(study.solve().at((1.0,))["u"])


def test_a_side_that_is_not_taken_needs_no_value() -> None:
    """log(u) sqrt(u - 1) is nowhere below 1, where the path may start."""

    def law(m: Model, u: Any, f: Any) -> Any:
        beyond = u + sp.log(u) * sp.sqrt(u - 1)
        s = m.implicit("s", lambda s: s - sp.Piecewise((u, u < 1), (beyond, True)), start=0)
        return s - f

    page = nodal(law, "sides")
    assert solution(page, 0.5) == pytest.approx(0.5, rel=1e-12)
    found = solution(page, 2.0, start=1.5)
    assert found + np.log(found) * np.sqrt(found - 1) == pytest.approx(2.0, rel=1e-9)


def test_a_value_that_is_no_number_is_named() -> None:
    def law(m: Model, u: Any, f: Any) -> Any:
        return m.define("inside", sp.log(u - 1)) - f

    with pytest.raises(NotConverged, match=r"not finite.*block 'law'") as error:
        solution(nodal(law, "logarithm"), 1.0)
    assert "\n" not in str(error.value)


ILLEGAL: dict[str, Callable[[Model, Any, Any], Any]] = {
    "division by zero": lambda m, u, f: u / sp.Integer(0) - f,
    "a branch of Python": lambda m, u, f: u if u > 0 else f,
    "no last side": lambda m, u, f: sp.Piecewise((u, u > 0)) - f,
}


@pytest.mark.parametrize("name", ILLEGAL)
def test_pages_that_say_what_no_kernel_can_hold(name: str) -> None:
    with pytest.raises((ModelError, TypeError)) as error:
        solution(nodal(ILLEGAL[name], "illegal"), 1.0)
    assert "\n" not in str(error.value)


def test_another_law_has_another_solution() -> None:
    assert solution(nodal(lambda m, u, f: 2 * u - f, "twice"), 1.0) == pytest.approx(0.5)
