"""Rubber on any cell."""

import sympy as sp

import softehl


@softehl.page
def rubber(m):
    """W = mu / 2 (I1 J^(-2/3) - 3) + kappa / 4 (J^2 - 1 - 2 ln J)."""
    u = m.vector("u")
    mu, kappa = m.parameters(mu="shear modulus [MPa]", kappa="bulk modulus [MPa]")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    shear = (F.T * F).trace() * J ** sp.Rational(-2, 3) - 3
    m.minimise(mu / 2 * shear + kappa / 4 * (J**2 - 1 - 2 * sp.log(J)))
