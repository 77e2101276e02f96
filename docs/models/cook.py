"""Cook's membrane of compressible rubber in three dimensions, 8 nodes."""

import sympy as sp

from softehl import Definition, Model, element, kinematics


def cook() -> Definition:
    """W = mu / 2 (I1 J^(-2/3) - 3) + kappa / 4 (J^2 - 1 - 2 ln J)."""
    hex8 = element("hex8")
    m = Model("cook", nodes=8, rule=hex8.rule)
    X = m.coordinates("X", "Y", "Z")
    u = m.nodal_unknowns("u_x", "u_y", "u_z")
    mu, kappa = m.parameters(mu="shear modulus [MPa]", kappa="bulk modulus [MPa]")
    e = kinematics.isoparametric(m, X, hex8.gradient(*m.point()))
    F = kinematics.deformation_gradient(m, e.dN, u)
    J = m.define("J", F.det())
    I1 = (F.T * F).trace()
    W = mu / 2 * (I1 * J ** sp.Rational(-2, 3) - 3) + kappa / 4 * (J**2 - 1 - 2 * sp.log(J))
    m.potential(m.integral("Pi", W * e.detJ))
    P = m.derivative("P", W, F)
    m.fields(J=J, sigma_xx=(P * F.T)[0, 0] / J)
    return m.finish()
