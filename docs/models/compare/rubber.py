"""Rubber on any cell."""

import sympy as sp

import softehl


@softehl.page
def rubber(m):
    """W = mu / 2 (J^(-2/3) I1 - 3) + K / 2 (J - 1)^2."""
    u = m.vector("u")
    mu, K = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    I1 = (F.T * F).trace()
    m.minimise(mu / 2 * (J ** sp.Rational(-2, 3) * I1 - 3) + K / 2 * (J - 1) ** 2)
