"""Entropic rubber: stress that grows with the temperature, heat of deformation.

Cells: any
Source: Chadwick (1974), Philosophical Transactions A 276, 371-403; Holzapfel (2000), chapter 7.
Benchmark: adiabatic extension to three times the length, rise of the temperature (Joule).
"""

import sympy as sp

from softehl import Fields, page


@page
def entropic(m: Fields) -> None:
    """Free energy T / T_0 W - 3 K alpha (T - T_0) ln J + U(J) + c (T - T_0 - T ln(T / T_0))."""
    u, rise = m.vector("u"), m.scalar("T")
    mu, kappa, alpha, c, k, T_0, dt = m.parameters(
        mu="shear modulus at T_0 [MPa]",
        kappa="bulk modulus [MPa]",
        alpha="thermal expansion [1/K]",
        capacity="heat capacity [MPa/K]",
        conductivity="conductivity [N/(s K)]",
        T_0="absolute temperature at T = 0 [K]",
        dt="step [s]",
    )
    m.require(mu > 0, kappa > 0, c > 0, k >= 0, T_0 > 0)

    def network(F: sp.Matrix) -> sp.Expr:
        return mu / 2 * (F.det() ** sp.Rational(-2, 3) * (F.T * F).trace() - 3)

    def entropy(F: sp.Matrix, T: sp.Expr) -> sp.Expr:
        return 3 * kappa * alpha * sp.log(F.det()) - network(F) / T_0 + c * sp.log(T / T_0)

    F = m.deformation_gradient(u)
    old = m.deformation_gradient(m.previous(u), "F_old")
    J, T = m.define("J", F.det()), T_0 + rise
    energy = T / T_0 * network(F) - 3 * kappa * alpha * rise * sp.log(J)
    energy += kappa / 4 * (J**2 - 1 - 2 * sp.log(J))
    m.weak(m.derivative("P", energy, F), F)
    gain = entropy(F, T) - entropy(old, T_0 + m.previous(rise))
    m.weak(T * gain / dt, rise)
    flux = J * (F.T * F).inv()[: len(u), : len(u)]
    m.weak(k * flux * m.grad(rise), m.grad(rise))
    m.fields(J=J, temperature=T)
