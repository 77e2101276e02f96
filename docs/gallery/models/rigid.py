"""An elastic body of Saint-Venant and Kirchhoff."""

import sympy as sp

import softehl


@softehl.page
def elastic(m):
    """W = G E : E + lambda / 2 (tr E)^2, with Green's strain E."""
    E, nu = m.parameters(E="Young's modulus [MPa]", nu="Poisson's ratio")
    F = m.deformation_gradient(m.vector("u"))
    strain = m.define("strain", (F.T * F - sp.eye(F.rows)) / 2)
    G, lame = E / (2 * (1 + nu)), E * nu / ((1 + nu) * (1 - 2 * nu))
    m.minimise(G * (strain * strain).trace() + lame / 2 * strain.trace() ** 2)
