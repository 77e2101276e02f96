"""Geometrically exact beam with shear in the plane, two nodes.

Cells: line2
Source: Reissner (1972), ZAMP 23, 795-804; Simo and Vu-Quoc (1986), CMAME 58, 79-116.
Benchmark: cantilever that an end moment bends to a half circle, place of its tip.
"""

import sympy as sp

from softehl import Definition, Model, quadrature


def beam2d_reissner() -> Definition:
    """Energy of stretch, shear and curvature, at one point: no shear locking."""
    m = Model("beam2d_reissner", nodes=2, rule=quadrature.point_rule(), doc="Beam of Reissner.")
    X = m.coordinates("X", "Y")
    u_x, u_y = m.nodal_unknowns("u_x", "u_y")
    (theta,) = m.nodal_unknowns("theta")
    EA, GA, EI = m.parameters(
        EA="axial stiffness [N]", GA="shear stiffness [N]", EI="bending stiffness [N mm2]"
    )
    m.require(EA > 0, GA > 0, EI > 0)
    dX, dY = (x[1] - x[0] for x in X)
    length = m.define("length", m.norm([dX, dY]))
    dx, dy = dX + u_x[1] - u_x[0], dY + u_y[1] - u_y[0]
    # axis of the undeformed beam, turned by the rotation in the middle
    angle = m.define("angle", (theta[0] + theta[1]) / 2)
    c, s = m.define("c", sp.cos(angle)), m.define("s", sp.sin(angle))
    t_x, t_y = (c * dX - s * dY) / length, (s * dX + c * dY) / length
    stretch = m.define("stretch", (t_x * dx + t_y * dy) / length - 1)
    shear = m.define("shear", (t_x * dy - t_y * dx) / length)
    curvature = m.define("curvature", (theta[1] - theta[0]) / length)
    m.potential(length / 2 * (EA * stretch**2 + GA * shear**2 + EI * curvature**2))
    m.fields(N=EA * stretch, Q=GA * shear, M=EI * curvature)
    return m.finish()
