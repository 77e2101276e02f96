"""Consolidation by Biot: displacements and the pressure of an incompressible pore fluid.

Cells: quad9, tri6, hex27, tet10
Source: Biot (1941), Journal of Applied Physics 12, 155-164; Terzaghi (1923).
Benchmark: columns of Terzaghi, slab of Mandel, sphere of Cryer: pore pressure.
"""

import sympy as sp

from softehl import Fields, page


@page
def biot(m: Fields) -> None:
    """div(stress - p I) = 0 and div(du/dt) = div(mobility grad p)."""
    u, p = m.vector("u"), m.scalar("p", order=1)
    E, nu, k = m.parameters(
        E="Young's modulus, drained [MPa]",
        nu="Poisson's ratio, drained",
        mobility="permeability over viscosity [mm4/(N s)]",
    )
    m.require(E > 0, nu > -1, nu < sp.Rational(1, 2), k > 0)
    lame, G = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 + 2 * nu)
    gradient = m.deformation_gradient(u) - sp.eye(3)
    strain = (gradient + gradient.T) / 2
    m.weak((lame * strain.trace() - p) * sp.eye(3) + 2 * G * strain, gradient)
    m.weak(m.grad(m.rate(u))[: len(u), : len(u)].trace(), p)
    if m.geometry == "axisymmetric":
        m.weak(m.rate(u)[1] / m.position[1], p)
    m.weak(k * m.grad(p), m.grad(p))
