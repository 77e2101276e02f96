"""J2 plasticity at large strain with Hencky's energy, plane strain, 8 nodes and 2 x 2 points."""

import sympy as sp

from softehl import Definition, Model, element, kinematics, quadrature


def finite_j2() -> Definition:
    """The work of a step: the trial energy less what flow saves, so that tau follows from W."""
    cell = element("quad8")
    m = Model("finite_j2", nodes=8, rule=quadrature.gauss(2, 2))
    X = m.coordinates("X", "Y")
    u = m.nodal_unknowns("u_x", "u_y")
    G, K = m.parameters(G="shear modulus [MPa]", K="bulk modulus [MPa]")
    sy, H = m.parameters(sy="yield stress [MPa]", H="hardening modulus [MPa]")
    old = m.point_data(c_xx="Cp^-1 - 1", c_yy="", c_zz="", c_xy="", alpha="plastic strain")
    e = kinematics.isoparametric(m, X, cell.gradient(*m.point()))
    F = m.define("F3", sp.diag(kinematics.deformation_gradient(m, e.dN, u), 1))
    c = sp.Matrix([[old[0], old[3], 0], [old[3], old[1], 0], [0, 0, old[2]]]) + sp.eye(3)
    b = m.define("b", F * c * F.T)  # elastic left Cauchy-Green tensor, if nothing flowed
    limit = m.define("limit", sy + H * old[4])

    def trial(*stretches):  # (3 / 2) s : s
        logs = [sp.log(x) for x in stretches]
        return 6 * G**2 * sum((x - sum(logs) / 3) ** 2 for x in logs)

    square = m.principal("square", b, trial)
    saved = (sp.sqrt(square) - limit) ** 2 / (6 * G + 2 * H)
    W = K / 2 * sp.log(m.define("J", F.det())) ** 2 + square / (6 * G)
    W -= sp.Piecewise((saved, square > limit**2), (0, True))
    W = m.define("W", W)
    m.potential(m.integral("Pi", W * e.detJ))
    dg = sp.Piecewise(((sp.sqrt(square) - limit) / (3 * G + H), square > limit**2), (0, True))
    dg = m.define("dg", dg)
    tau = m.define("tau", m.derivative("P", W, F) * F.T)
    s = tau - tau.trace() / 3 * sp.eye(3)
    ratio = m.define("ratio", sp.Piecewise((3 * dg / (limit + H * dg), dg > 0), (0, True)))
    power = sp.eye(3)
    for k in range(8, 0, -1):  # exp(-2 dg n) by its series
        power = sp.eye(3) - m.define(f"power_{k}", ratio / k * s * power)
    back = F.adjugate() / F.det()
    new = back * power * b * back.T - sp.eye(3)
    m.fields(alpha=old[4] + dg, tau_xx=tau[0, 0], tau_yy=tau[1, 1])
    m.history(c_xx=new[0, 0], c_yy=new[1, 1], c_zz=new[2, 2], c_xy=new[0, 1], alpha=old[4] + dg)
    return m.finish()
