"""Random pages of elements with nodes: two fields, a parameter, data, history and a field.

Random materials: an energy of two invariants, with history. The kinds are few and the expressions
come from `random_models`, so that a page has any function.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy as sp
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st

import softehl
from softehl.codegen.elements.cells import element
from softehl.codegen.language import kinematics
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.material import Law, Material
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


def page(
    cell: str, energy: Any, factor: Any, *, conservative: bool, memory: bool = True
) -> Definition:
    """The page of an `energy` of field values, or of a weak form with a `factor`.

    memory: with values before the step and history; without, both are zero.
    """
    kind = element(cell)
    m = Model(f"random_{cell}", nodes=len(kind.nodes), rule=kind.rule, doc="Random.")
    X = m.coordinates(*("X", "Y")[: kind.dimension])
    (a,) = m.nodal_unknowns("a")
    (b,) = m.nodal_unknowns("b", nodes=kind.dimension + 1)
    (k,), (c,) = m.parameters(k="a parameter"), m.data(c="a datum")
    (h,) = m.point_data(h_old="a datum of points") if memory else [sp.Integer(0)]
    (before,) = m.nodal_data("a_old") if memory else [[0] * len(kind.nodes)]
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
    if memory:
        m.history(h_old=h / 2 + here)
    return m.finish()


@st.composite
def pages(draw: st.DrawFn, *, cells: Sequence[str] = CELLS, memory: bool = True) -> Definition:
    """Any of them."""
    grown = expressions((A, B, K, C, H), 5)
    cell, energy, factor = draw(st.sampled_from(cells)), draw(grown), draw(grown)
    return page(cell, energy, factor, conservative=draw(st.booleans()), memory=memory)


@st.composite
def laws(draw: st.DrawFn) -> Law:
    """Any energy of tr C - 3, J - 1, a parameter and a datum of the point, with a stiff part."""
    energy, renewed = draw(expressions((A, B, K, H), 5)), draw(expressions((A, B, H), 3))

    @softehl.material
    def random_law(m: Material) -> None:
        """Random."""
        (k,), (h,) = m.parameters(k="a parameter"), m.point_data(h="a datum of points")
        J = m.define("J", m.F.det())
        stretch = m.define("stretch", (m.F.T * m.F).trace() - 3)
        names = {A: stretch, B: J - 1, K: k, H: h}
        m.energy(stretch - 2 * sp.log(J) + k * (J - 1) ** 2 + energy.xreplace(names) / 20)
        m.fields(value=stretch * J)
        m.history(h=h / 2 + renewed.xreplace(names))

    return random_law
