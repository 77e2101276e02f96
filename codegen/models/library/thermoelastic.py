"""Linear thermoelasticity, coupled both ways: heat strains the body, strain cools it.

Cells: any
Source: Boley and Weiner (1960), Theory of Thermal Stresses, chapter 1.
Benchmark: effect of Kelvin, cooling of an insulated bar in tension.
"""

import sympy as sp

from softehl import Fields, ModelError, page


@page
def thermoelastic(m: Fields) -> None:
    """stress = C (strain - alpha T); c dT/dt + 3 K alpha T_0 tr(dstrain/dt) = div(k grad T)."""
    if m.geometry == "axisymmetric":
        raise ModelError("thermoelastic has no hoop strain: it is for plane strain and space")
    u, T = m.vector("u"), m.scalar("T")
    E, nu, alpha, k, c, T_0 = m.parameters(
        E="Young's modulus [MPa]",
        nu="Poisson's ratio",
        alpha="thermal expansion [1/K]",
        conductivity="conductivity [W/(mm K)]",
        capacity="capacity at constant strain [J/(mm3 K)]",
        T_0="absolute temperature at T = 0 [K]",
    )
    m.require(E > 0, nu > -1, nu < sp.Rational(1, 2), k >= 0, c > 0, T_0 > 0)
    lame, G, K = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 + 2 * nu), E / (3 - 6 * nu)
    size = len(u)
    gradient, rates = m.grad(u)[:size, :size], m.grad(m.rate(u))[:size, :size]
    strain = (gradient + gradient.T) / 2
    stress = (lame * strain.trace() - 3 * K * alpha * T) * sp.eye(size) + 2 * G * strain
    m.weak(stress, gradient)
    # joules are 1000 N mm: mechanical heat in the units of the capacity
    m.weak(c * m.rate(T) + 3 * K * alpha * T_0 / 1000 * rates.trace(), T)
    m.weak(k * m.grad(T), m.grad(T))
    m.fields(sigma_xx=stress[0, 0])
