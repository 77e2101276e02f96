"""Brittle fracture by a phase field, AT2, without a split of the energy.

Cells: any
Source: Bourdin, Francfort and Marigo (2000), JMPS 48, 797-826; Miehe et al. (2010), CMAME 199.
Benchmark: strength of a homogeneous bar.
"""

import sympy as sp

from softehl import Fields, ModelError, page


@page
def at2(m: Fields) -> None:
    """(1 - d)^2 psi + Gc / 2 (d^2 / length + length |grad d|^2)."""
    if m.geometry == "axisymmetric":
        raise ModelError("at2 has no hoop strain: it is for plane strain and space")
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
    m.weak(Gc / length * d - 2 * (1 - d) * largest, d)
    m.weak(Gc * length * m.grad(d), m.grad(d))
    m.fields(sigma_xx=stress[0, 0], sigma_yy=stress[1, 1], sigma_xy=stress[0, 1])
    m.history(largest=largest)
