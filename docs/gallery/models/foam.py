"""Compressible rubber, the walls of a foam."""

import sympy as sp

import softehl


@softehl.material
def foam(m):
    """W = mu / 2 (I1 - 3 - 2 ln J) + lame / 2 (J - 1)^2."""
    mu, lame = m.parameters(mu="shear modulus [MPa]", lame="Lame's first parameter [MPa]")
    I1 = (m.F.T * m.F).trace()
    J = m.define("J", m.F.det())
    m.energy(mu / 2 * (I1 - 3 - 2 * sp.log(J)) + lame / 2 * (J - 1) ** 2)
