"""Geometrically exact beam with shear in space, two nodes.

Cells: line2
Source: Simo and Vu-Quoc (1986), CMAME 58, 79-116; objective as Crisfield and Jelenic (1999).
Benchmark: cantilever of a 45-degree arc under a load out of its plane, eight elements.
"""

import sympy as sp

from softehl import Definition, Model, quadrature


def beam3d_simo() -> Definition:
    """Strains and curvature in the axes that turn with the section, at the middle.

    w is the rotation vector of a node. a is the direction of the first axis of the section.
    """
    m = Model("beam3d_simo", nodes=2, rule=quadrature.point_rule(), doc="Beam of Simo.")
    X = m.coordinates("X", "Y", "Z")
    u = m.nodal_unknowns("u_x", "u_y", "u_z")
    w = m.nodal_unknowns("w_x", "w_y", "w_z")
    EA, GA_1, GA_2, GJ, EI_1, EI_2 = m.parameters(
        EA="axial stiffness [N]",
        GA_1="shear stiffness along axis 1 of the section [N]",
        GA_2="shear stiffness along axis 2 [N]",
        GJ="torsional stiffness [N mm2]",
        EI_1="bending stiffness about axis 1 [N mm2]",
        EI_2="bending stiffness about axis 2 [N mm2]",
    )
    m.require(*(stiffness > 0 for stiffness in (EA, GA_1, GA_2, GJ, EI_1, EI_2)))
    a = sp.Matrix(m.data(a_x="vector near axis 1, along x", a_y="along y", a_z="along z"))
    along = sp.Matrix([x[1] - x[0] for x in X])
    length = m.define("length", m.norm(along))
    t = m.define("t", along / length)
    side = m.define("side", a - t * t.dot(a))
    n1 = m.define("n1", side / m.norm(side))
    axes = sp.Matrix.hstack(t, n1, t.cross(n1))  # tangent, axis 1, axis 2
    R = [m.rotation(sp.Matrix([c[k] for c in w])) for k in (0, 1)]
    turned = [m.define(f"R_{k}", R[k] * axes) for k in (0, 1)]
    # rotation from the first to the second section, in the axes of the first
    spin = m.define("spin", m.rotation_vector(turned[0].T * turned[1], branches=False))
    middle = m.define("middle", turned[0] * m.rotation(spin / 2))
    now = along + sp.Matrix([c[1] - c[0] for c in u])
    strain = m.define("strain", middle.T * now / length - sp.Matrix([1, 0, 0]))
    curvature = spin / length
    stiffness = ((EA, GA_1, GA_2), (GJ, EI_1, EI_2))
    pairs = [
        (k, e)
        for row, v in zip(stiffness, (strain, curvature), strict=True)
        for k, e in zip(row, v, strict=True)
    ]
    m.potential(length / 2 * sum(k * e**2 for k, e in pairs))
    m.fields(
        N=EA * strain[0], T=GJ * curvature[0], M_1=EI_1 * curvature[1], M_2=EI_2 * curvature[2]
    )
    return m.finish()
