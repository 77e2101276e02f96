"""Rubber in plane strain, 4 nodes."""

import sympy as sp

from softehl import Definition, Model, element, kinematics


def rubber() -> Definition:
    """W = mu / 2 (J^(-2/3) I1 - 3) + K / 2 (J - 1)^2."""
    cell = element("quad4")
    m = Model("rubber", nodes=4, rule=cell.rule, unroll=True)
    X = m.coordinates("X", "Y")
    u = m.nodal_unknowns("u_x", "u_y")
    mu, K = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]")
    e = kinematics.isoparametric(m, X, cell.gradient(*m.point()))
    F = kinematics.deformation_gradient(m, e.dN, u)
    J = m.define("J", F.det())
    I1 = (F.T * F).trace() + 1
    W = mu / 2 * (J ** sp.Rational(-2, 3) * I1 - 3) + K / 2 * (J - 1) ** 2
    m.potential(m.integral("Pi", W * e.detJ))
    return m.finish()
