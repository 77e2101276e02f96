"""Random pages of elements with nodes: two fields, a parameter, data, history and a field.

The kinds are few and the expressions come from `random_models`, so that a page has any function.
"""

from __future__ import annotations

from typing import Any

import sympy as sp
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st

from softehl.codegen.language import kinematics
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.elements.cells import element
from softehl.codegen.language.model import Model
from tests.codegen.random_models import expressions

FEW = settings(
    max_examples=3,
    derandomize=True,
    deadline=None,
    phases=(Phase.generate,),
    suppress_health_check=[HealthCheck.too_slow],
)
"""Three pages, each of which is compiled twice; shrinking one would take minutes."""
CELLS = ("line2", "tri3", "quad4", "tri6")
A, B, K, C, H = sp.symbols("a_here b_here k c h_old", real=True)


def page(cell: str, energy: Any, factor: Any, *, conservative: bool) -> Definition:
    """The page of an `energy` of field values, or of a weak form with a `factor`."""
    kind = element(cell)
    m = Model(f"random_{cell}", nodes=len(kind.nodes), rule=kind.rule, doc="Random.")
    X = m.coordinates(*("X", "Y")[: kind.dimension])
    (a,) = m.nodal_unknowns("a")
    (b,) = m.nodal_unknowns("b", nodes=kind.dimension + 1)
    (k,), (c,) = m.parameters(k="a parameter"), m.data(c="a datum")
    (h,) = m.point_data(h_old="a datum of points")
    (before,) = m.nodal_data("a_old")
    point = m.point()
    e = kinematics.isoparametric(m, X, kind.gradient(*point))
    corners = element({1: "line2", 2: "tri3"}[kind.dimension]).shape(*point)
    here = m.define("a_here", sum(N * v for N, v in zip(kind.shape(*point), a, strict=True)))
    other = m.define("b_here", sum(N * v for N, v in zip(corners, b, strict=True)))
    step = here - sum(N * v for N, v in zip(kind.shape(*point), before, strict=True))
    names = {A: here, B: other, K: k, C: c, H: h}
    energy, factor = energy.xreplace(names), factor.xreplace(names)
    total = energy + (here - h) ** 2 + k * other**2 + c * step**2 + here * other
    m.potential(m.integral("Pi", total * e.detJ))
    if not conservative:
        m.weak_form([(factor * e.detJ, here)])
    m.fields(value=here * other)
    m.history(h_old=h / 2 + here)
    return m.finish()


@st.composite
def pages(draw: st.DrawFn) -> Definition:
    """Any of them."""
    grown = expressions((A, B, K, C, H), 5)
    return page(
        draw(st.sampled_from(CELLS)), draw(grown), draw(grown), conservative=draw(st.booleans())
    )
