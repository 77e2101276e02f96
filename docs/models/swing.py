"""Compressible rubber, with its inertia or without."""

import sympy as sp

import softehl


def energy(m, u):
    mu, lame = m.parameters(mu="shear modulus [MPa]", lame="Lame's first parameter [MPa]")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    return mu / 2 * ((F.T * F).trace() - 3 - 2 * sp.log(J)) + lame / 2 * sp.log(J) ** 2


@softehl.page
def rubber(m):
    """Minimises its energy."""
    m.minimise(energy(m, m.vector("u")))


@softehl.page
def moving(m):
    """With rho d2u/dt2 in the weak form."""
    u = m.vector("u")
    (rho,) = m.parameters(rho="density [t/mm^3]")
    m.minimise(energy(m, u))
    m.weak(rho * m.rate(u, order=2), u)
