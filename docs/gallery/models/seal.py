"""Nearly incompressible rubber in plane strain: displacements at 9 nodes, pressure at 4."""

import sympy as sp

from softehl import Definition, Model, element, kinematics


def seal() -> Definition:
    """W = mu / 2 (I1 - 3 - 2 ln J) + p (J - 1) - p^2 / (2 kappa), made stationary by p as well."""
    cell, corners = element("quad9"), element("quad4")
    m = Model("seal", nodes=9, rule=cell.rule)
    X = m.coordinates("X", "Y")
    u = m.nodal_unknowns("u_x", "u_y")
    (p,) = m.nodal_unknowns("p", nodes=4)
    mu, kappa = m.parameters(mu="shear modulus [MPa]", kappa="bulk modulus [MPa]")
    e = kinematics.isoparametric(m, X, cell.gradient(*m.point()))
    F = kinematics.deformation_gradient(m, e.dN, u)
    J = m.define("J", F.det())
    pressure = sum(N * v for N, v in zip(corners.shape(*m.point()), p, strict=True))
    I1 = (F.T * F).trace() + 1
    W = mu / 2 * (I1 - 3 - 2 * sp.log(J)) + pressure * (J - 1) - pressure**2 / (2 * kappa)
    m.potential(m.integral("Pi", W * e.detJ))
    b = F * F.T
    s = sp.diag(b, 1) - b.trace() / 3 * sp.eye(3) - sp.eye(3) / 3
    m.fields(J=J, mises=mu / J * sp.sqrt(sp.Rational(3, 2) * (s * s).trace()))
    return m.finish()
