"""Compressible rubber on any cell."""

import sympy as sp

import softehl


@softehl.page
def rubber(m):
    """W = mu / 2 (I1 - 3 - 2 ln J) + lame / 2 (J - 1)^2."""
    u = m.vector("u")
    mu, lame = m.parameters(mu="shear modulus [MPa]", lame="Lame's first parameter [MPa]")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    I1 = (F.T * F).trace()
    W = m.define("W", mu / 2 * (I1 - 3 - 2 * sp.log(J)) + lame / 2 * (J - 1) ** 2)
    m.minimise(W)
    m.fields(W=W)
