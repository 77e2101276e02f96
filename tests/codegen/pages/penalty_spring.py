"""Penalty spring: a branch."""

import sympy as sp

from softehl.codegen.elements import quadrature
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model


def penalty_spring() -> Definition:
    """Node against a rigid cylinder: potential k/2 gap^2 where gap = |x - c| - r is negative."""
    m = Model("penalty_spring", nodes=1, rule=quadrature.point_rule(), doc=penalty_spring.__doc__)
    (X,), (Y,) = m.coordinates("X", "Y")
    (u,), (v,) = m.nodal_unknowns("u", "v")
    k, c_x, c_y, r = m.parameters(
        k="penalty stiffness [N/mm]",
        c_x="axis of the cylinder [mm]",
        c_y="axis of the cylinder [mm]",
        r="radius of the cylinder [mm]",
    )
    distance = m.define("distance", sp.sqrt((X + u - c_x) ** 2 + (Y + v - c_y) ** 2))
    gap = m.define("gap", distance - r)

    m.potential(sp.Piecewise((k / 2 * gap**2, gap < 0), (0, True)))

    m.fields(gap=gap, force=-k * sp.Min(gap, 0))
    m.offer(product=True, derivatives=[r, X])
    return m.finish()
