"""A node that a spring stops when it passes a wall: a force with a branch."""

import sympy as sp

from softehl import Definition, Model, quadrature


def spring() -> Definition:
    """Potential stiffness / 2 * g^2 where the gap g = wall - (X + u) is negative, else none."""
    m = Model("spring", nodes=1, rule=quadrature.point_rule(), unroll=True, doc=spring.__doc__)
    ((X,),) = m.coordinates("X")
    ((u,),) = m.nodal_unknowns("u")
    stiffness, wall = m.parameters(
        stiffness="penalty stiffness [N/mm]", wall="position of the wall [mm]"
    )
    gap = m.define("gap", wall - (X + u))
    m.potential(sp.Piecewise((stiffness / 2 * gap**2, gap < 0), (0, True)))
    return m.finish()
