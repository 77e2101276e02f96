"""Linear beam with shear in the plane, two nodes, exact at its nodes.

Cells: line2
Source: Timoshenko (1921), Phil. Mag. 41, 744-746; MacNeal (1978), Computers & Structures 8, 175.
Benchmark: cantilever of one element under a load at its tip, deflection.
"""

import sympy as sp

from softehl import Definition, Model, quadrature


def beam2d_timoshenko() -> Definition:
    """Energy of the middle; its shear flexibility has l^2 / (12 EI) more: exact for end loads."""
    m = Model("beam2d_timoshenko", nodes=2, rule=quadrature.point_rule(), doc="Linear beam.")
    X = m.coordinates("X", "Y")
    u_x, u_y = m.nodal_unknowns("u_x", "u_y")
    (theta,) = m.nodal_unknowns("theta")
    EA, GA, EI = m.parameters(
        EA="axial stiffness [N]", GA="shear stiffness [N]", EI="bending stiffness [N mm2]"
    )
    m.require(EA > 0, GA > 0, EI > 0)
    axis = sp.Matrix([x[1] - x[0] for x in X])
    length = m.define("length", m.norm(axis))
    t = axis / length
    moved = sp.Matrix([u_x[1] - u_x[0], u_y[1] - u_y[0]]) / length
    stretch = m.define("stretch", t.dot(moved))
    deflection = t[0] * moved[1] - t[1] * moved[0]
    shear = m.define("shear", deflection - (theta[0] + theta[1]) / 2)
    curvature = m.define("curvature", (theta[1] - theta[0]) / length)
    stiffness = 1 / (1 / GA + length**2 / (12 * EI))
    m.potential(length / 2 * (EA * stretch**2 + stiffness * shear**2 + EI * curvature**2))
    m.fields(N=EA * stretch, Q=stiffness * shear, M=EI * curvature)
    return m.finish()
