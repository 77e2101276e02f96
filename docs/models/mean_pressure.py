"""Rubber with one pressure in every cell: Q1P0."""

import sympy as sp

import softehl


@softehl.page
def mean_pressure(m):
    """mu / 2 (I1 - 3 - 2 ln J) + p (J - 1) - p^2 / (2 K), with p condensed."""
    u, p = m.vector("u"), m.internal("p")
    mu, K = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    m.minimise(mu / 2 * ((F.T * F).trace() - 3 - 2 * sp.log(J)) + p * (J - 1) - p**2 / (2 * K))
