"""A rubber whose chains have a finite length: the solid of Gent (1996), plane strain, 4 nodes."""

import sympy as sp

from softehl import Definition, Model, kinematics, quadrature, shapes


def gent() -> Definition:
    """W = -mu J_m / 2 ln(1 - (I1 - 3) / J_m) - mu ln J + lambda / 2 (ln J)^2, per thickness."""
    m = Model("gent", nodes=4, rule=quadrature.gauss(2, 2), unroll=True, doc=gent.__doc__)
    X = m.coordinates("X", "Y")
    u = m.nodal_unknowns("u_x", "u_y")
    mu, J_m, lam = m.parameters(
        mu="shear modulus [MPa]",
        J_m="largest value that I1 - 3 can have",
        lame="first Lame parameter [MPa]",
    )
    xi, eta = m.point()
    e = kinematics.isoparametric(m, X, shapes.quad4_gradient(xi, eta))
    F = kinematics.deformation_gradient(m, e.dN, u)
    J = m.define("J", F.det())
    I1 = m.define("I1", (F.T * F).trace() + 1)
    W = -mu * J_m / 2 * sp.log(1 - (I1 - 3) / J_m) - mu * sp.log(J) + lam / 2 * sp.log(J) ** 2
    m.potential(m.integral("Pi", W * e.detJ))
    stress = mu / (1 - (I1 - 3) / J_m) * F * F.T + (lam * sp.log(J) - mu) * sp.eye(2)
    m.fields(J=J, sigma_xx=stress[0, 0] / J, sigma_yy=stress[1, 1] / J, sigma_xy=stress[0, 1] / J)
    return m.finish()
