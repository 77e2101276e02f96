"""Rubber, and a string."""

import sympy as sp

import softehl


@softehl.page
def rubber(m):
    """W = mu / 2 (I1 - 3 - 2 ln J) + lame / 2 ln(J)^2."""
    u = m.vector("u")
    mu, lame = m.parameters(mu="shear modulus [MPa]", lame="Lame's first parameter [MPa]")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    I1 = (F.T * F).trace()
    m.minimise(mu / 2 * (I1 - 3 - 2 * sp.log(J)) + lame / 2 * sp.log(J) ** 2)
