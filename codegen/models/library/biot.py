"""Consolidation by Biot: displacements and the pressure of an incompressible pore fluid.

Cells: quad9, tri6, hex27, tet10
Source: Biot (1941), Journal of Applied Physics 12, 155-164; Terzaghi (1923).
Benchmark: Terzaghi's column, pore pressure at the closed end.
"""

import sympy as sp

from softehl import Fields, ModelError, page


@page
def biot(m: Fields) -> None:
    """div(stress - p I) = 0 and div(du/dt) = div(mobility grad p)."""
    if m.geometry == "axisymmetric":
        raise ModelError("biot has no hoop strain: it is for plane strain and space")
    u, p = m.vector("u"), m.scalar("p", order=1)
    E, nu, k = m.parameters(
        E="Young's modulus, drained [MPa]",
        nu="Poisson's ratio, drained",
        mobility="permeability over viscosity [mm4/(N s)]",
    )
    m.require(E > 0, nu > -1, nu < sp.Rational(1, 2), k > 0)
    lame, G = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 + 2 * nu)
    size = len(u)
    gradient, rates = m.grad(u)[:size, :size], m.grad(m.rate(u))[:size, :size]
    strain = (gradient + gradient.T) / 2
    stress = (lame * strain.trace() - p) * sp.eye(size) + 2 * G * strain
    m.weak(stress, gradient)
    m.weak(rates.trace(), p)
    m.weak(k * m.grad(p), m.grad(p))
