"""Brittle fracture by a phase field, AT1: elastic up to a strength.

Cells: any
Source: Pham, Amor, Marigo and Maurini (2011), Int. J. Damage Mechanics 20, 618-652.
Benchmark: strength of a homogeneous bar.
"""

import sympy as sp

from softehl import Fields, ModelError, page


@page
def at1(m: Fields) -> None:
    """(1 - d)^2 psi + 3 Gc / 8 (d / length + length |grad d|^2)."""
    if m.geometry == "axisymmetric":
        raise ModelError("at1 has no hoop strain: it is for plane strain and space")
    u, d = m.vector("u"), m.scalar("d")
    E, nu, Gc, length = m.parameters(
        E="Young's modulus [MPa]",
        nu="Poisson's ratio",
        Gc="toughness [N/mm]",
        length="length of the smeared crack [mm]",
    )
    m.require(E > 0, nu > -1, nu < sp.Rational(1, 2), Gc > 0, length > 0)
    (previous,) = m.point_data(largest="largest energy that drives the crack so far [MPa]")
    lame, G = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 + 2 * nu)
    gradient = sp.zeros(3)
    gradient[: len(u), : len(u)] = m.grad(u)[: len(u), : len(u)]
    strain = m.define("strain", (gradient + gradient.T) / 2)
    psi = lame / 2 * strain.trace() ** 2 + G * (strain * strain).trace()
    tension = lame * strain.trace() * sp.eye(3) + 2 * G * strain
    largest = m.define("now", sp.Max(psi, previous))
    degradation = (1 - d) ** 2 + sp.Rational("1e-9")
    stress = m.define("stress", degradation * tension)
    m.weak(stress[: len(u), : len(u)], m.grad(u)[: len(u), : len(u)])
    # d >= 0 by the smallest energy that drives a crack
    driving = sp.Max(largest, 3 * Gc / (16 * length))
    m.weak(3 * Gc / (8 * length) - 2 * (1 - d) * driving, d)
    m.weak(3 * Gc / 4 * length * m.grad(d), m.grad(d))
    m.fields(sigma_xx=stress[0, 0], sigma_yy=stress[1, 1], sigma_xy=stress[0, 1])
    m.history(largest=largest)
