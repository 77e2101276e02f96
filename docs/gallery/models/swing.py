"""Compressible rubber, and a field that swings."""

import sympy as sp

import softehl


@softehl.page
def rubber(m):
    """W = mu / 2 (I1 - 3 - 2 ln J) + lame / 2 ln(J)^2."""
    u = m.vector("u")
    mu, lame = m.parameters(mu="shear modulus [MPa]", lame="Lame's first parameter [MPa]")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    m.minimise(mu / 2 * ((F.T * F).trace() - 3 - 2 * sp.log(J)) + lame / 2 * sp.log(J) ** 2)


@softehl.page
def duffing(m):
    """At each place d2w/dt2 + w + w^3 = 0 (Duffing)."""
    w = m.scalar("w")
    m.weak(m.rate(w, order=2) + w + w**3, w)
