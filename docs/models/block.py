"""A block of rubber that is pushed sideways."""

import sympy as sp

import softehl


@softehl.page
def block(m):
    """Compressible neo-Hooke."""
    u = m.vector("u")
    mu, lam = m.parameters(mu="shear modulus [MPa]", lam="Lame's constant [MPa]")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    m.minimise(
        mu / 2 * ((F.T * F).trace() - 3) - mu * sp.log(J) + lam / 4 * (J**2 - 1 - 2 * sp.log(J))
    )
    m.offer(product=True)
