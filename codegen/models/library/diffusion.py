"""Diffusion with swelling: a species strains the body, its stress drives the species.

Cells: any
Source: Larche and Cahn (1985), Acta Metallurgica 33, 331-357.
Benchmark: free and confined swelling in contact with a reservoir.
"""

import sympy as sp

from softehl import Fields, ModelError, page


@page
def diffusion(m: Fields) -> None:
    """dc/dt = div(D c / (R T) grad mu), mu = R T ln(c / c_0) - volume tr(stress) / 3."""
    if m.geometry == "axisymmetric":
        raise ModelError("diffusion has no hoop strain: it is for plane strain and space")
    u, c, mu = m.vector("u"), m.scalar("c"), m.scalar("mu")
    E, nu, D, c_0, volume, RT = m.parameters(
        E="Young's modulus [MPa]",
        nu="Poisson's ratio",
        D="diffusivity [mm2/s]",
        c_0="concentration where c = 0 and mu = 0 [mol/mm3]",
        volume="molar volume of the species [mm3/mol]",
        RT="gas constant times temperature [N mm/mol]",
    )
    m.require(E > 0, nu > -1, nu < sp.Rational(1, 2), D > 0, c_0 > 0, RT > 0)
    lame, G, K = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 + 2 * nu), E / (3 - 6 * nu)
    size = len(u)
    gradient = sp.zeros(3)
    gradient[:size, :size] = m.grad(u)[:size, :size]
    strain = m.define("strain", (gradient + gradient.T) / 2)
    swollen = volume * c
    stress = m.define("stress", (lame * strain.trace() - K * swollen) * sp.eye(3) + 2 * G * strain)
    m.weak(stress[:size, :size], m.grad(u)[:size, :size])
    m.weak(m.rate(c), mu)
    m.weak(D * (c_0 + c) / RT * m.grad(mu), m.grad(mu))
    m.weak(mu / RT - sp.log(1 + c / c_0) + volume * stress.trace() / (3 * RT), c)
    m.fields(sigma_xx=stress[0, 0], sigma_yy=stress[1, 1], sigma_xy=stress[0, 1])
