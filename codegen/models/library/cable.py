"""Cable with two nodes in space: a bar that takes no compression.

Cells: line2
Source: Irvine (1981), Cable Structures, chapter 1.
Benchmark: elastic catenary under its own weight, sag at the middle.
"""

import sympy as sp

from softehl import Definition, Model, quadrature


def cable() -> Definition:
    """Tension E A times the strain of the unstretched length; weight along -y.

    A small stiffness, `slack` times that of a taut cable, keeps a slack one in place.
    """
    m = Model("cable", nodes=2, rule=quadrature.point_rule(), doc="Cable without compression.")
    X = m.coordinates("X", "Y", "Z")
    u = m.nodal_unknowns("u_x", "u_y", "u_z")
    EA, weight, ratio, slack = m.parameters(
        EA="axial stiffness [N]",
        weight="weight of the unstretched length [N/mm]",
        ratio="unstretched length by the distance of the nodes",
        slack="stiffness of a slack cable by that of a taut one",
    )
    m.require(EA > 0, ratio > 0, slack >= 0)
    across = [x[1] - x[0] for x in X]
    along = [d + v[1] - v[0] for d, v in zip(across, u, strict=True)]
    free = m.define("free", ratio * m.norm(across))
    strain = m.define("strain", m.norm(along) / free - 1)
    taut = sp.Piecewise((1, strain > 0), (slack, True))
    m.potential(EA * free / 2 * taut * strain**2 + weight * free * (u[1][0] + u[1][1]) / 2)
    m.fields(tension=EA * taut * strain)
    return m.finish()
