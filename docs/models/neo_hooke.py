"""A compressible rubber: the neo-Hookean solid, plane strain, 4 nodes."""

import sympy as sp

from softehl import Definition, Model, kinematics, quadrature, shapes


def neo_hooke() -> Definition:
    """W = mu / 2 (tr F^T F - 2 - 2 ln J) + lame / 2 (ln J)^2, per thickness."""
    m = Model("neo_hooke", nodes=4, rule=quadrature.gauss(2, 2), unroll=True)
    X = m.coordinates("X", "Y")
    u = m.nodal_unknowns("u_x", "u_y")
    mu, lame = m.parameters(mu="shear modulus [MPa]", lame="first Lame parameter [MPa]")
    e = kinematics.isoparametric(m, X, shapes.quad4_gradient(*m.point()))
    F = kinematics.deformation_gradient(m, e.dN, u)
    J = m.define("J", F.det())
    W = mu / 2 * ((F.T * F).trace() - 2 - 2 * sp.log(J)) + lame / 2 * sp.log(J) ** 2
    m.potential(m.integral("Pi", W * e.detJ))
    P = m.derivative("P", W, F)
    m.fields(J=J, sigma_xx=(P * F.T)[0, 0] / J)
    return m.finish()
