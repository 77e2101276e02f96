"""Compressible rubber on any cell."""

import sympy as sp

import softehl


@softehl.page
def rubber(m):
    """W = mu / 2 (I1 J^(-2/3) - 3) + kappa / 4 (J^2 - 1 - 2 ln J)."""
    u = m.vector("u")
    mu, kappa = m.parameters(mu="shear modulus [MPa]", kappa="bulk modulus [MPa]")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    I1 = (F.T * F).trace()
    m.minimise(mu / 2 * (I1 * J ** sp.Rational(-2, 3) - 3) + kappa / 4 * (J**2 - 1 - 2 * sp.log(J)))
    m.fields(J=J)
