"""Compressible neo-Hooke, with a stiffness of each element."""

import sympy as sp

import softehl


@softehl.page
def rubber(m):
    """W = s mu / 2 (I1 - 3 - 2 ln J) + K / 2 (J - 1)^2."""
    u = m.vector("u")
    mu, K = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]")
    (s,) = m.data(s="share of the shear modulus")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    m.minimise(s * mu / 2 * ((F.T * F).trace() - 3 - 2 * sp.log(J)) + K / 2 * (J - 1) ** 2)
