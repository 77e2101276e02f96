"""J2 plasticity at small strain with linear hardening, plane strain, 8 nodes and 2 x 2 points."""

import sympy as sp

from softehl import Definition, Model, element, kinematics, quadrature


def j2() -> Definition:
    """Radial return: 3 G dg = q_trial - sy - H (alpha_old + dg) where that is positive."""
    cell = element("quad8")
    m = Model("j2", nodes=8, rule=quadrature.gauss(2, 2))
    X = m.coordinates("X", "Y")
    u = m.nodal_unknowns("u_x", "u_y")
    G, K = m.parameters(G="shear modulus [MPa]", K="bulk modulus [MPa]")
    sy, H = m.parameters(sy="yield stress [MPa]", H="hardening modulus [MPa]")
    old = m.point_data(p_xx="plastic strain", p_yy="", p_xy="", alpha="equivalent plastic strain")
    e = kinematics.isoparametric(m, X, cell.gradient(*m.point()))
    grad = kinematics.deformation_gradient(m, e.dN, u) - sp.eye(2)
    strain = m.define("strain", sp.diag((grad + grad.T) / 2, 0))
    p = sp.Matrix([[old[0], old[2], 0], [old[2], old[1], 0], [0, 0, -old[0] - old[1]]])
    volume = strain.trace()
    s = m.define("s", 2 * G * (strain - volume / 3 * sp.eye(3) - p))
    q = m.define("q", sp.sqrt(sp.Rational(3, 2) * (s * s).trace()))
    excess = m.define("excess", q - sy - H * old[3])
    dg = m.define("dg", sp.Piecewise((excess / (3 * G + H), excess > 0), (0, True)))
    flow = m.define("flow", sp.Piecewise((3 * dg / (2 * q), excess > 0), (0, True)))
    stress = m.define("stress", K * volume * sp.eye(3) + (1 - 2 * G * flow) * s)
    pairs = [(0, 0, 1), (1, 1, 1), (0, 1, 2)]
    m.weak_form([(c * stress[i, j] * e.detJ, strain[i, j]) for i, j, c in pairs])
    m.fields(alpha=old[3] + dg, s_xx=stress[0, 0], s_xy=stress[0, 1], s_yy=stress[1, 1])
    new = p + flow * s
    m.history(p_xx=new[0, 0], p_yy=new[1, 1], p_xy=new[0, 1], alpha=old[3] + dg)
    return m.finish()
