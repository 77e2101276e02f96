"""Brittle fracture by a phase field, AT2, split by principal strains.

Cells: any
Source: Miehe, Welschinger and Hofacker (2010), IJNME 83, 1273-1311.
Benchmark: stress of a broken point in compression.
"""

import sympy as sp

from softehl import Fields, ModelError, page


@page
def at2_spectral(m: Fields) -> None:
    """Negative principal strains keep their stiffness."""
    if m.geometry == "axisymmetric":
        raise ModelError("at2_spectral has no hoop strain: it is for plane strain and space")
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
    positive = m.isotropic(strain, lambda e: sp.Max(e, 0))
    opened, closed = sp.Max(strain.trace(), 0), sp.Min(strain.trace(), 0)
    psi = lame / 2 * opened**2 + G * (positive * positive).trace()
    tension = lame * opened * sp.eye(3) + 2 * G * positive
    compression = lame * closed * sp.eye(3) + 2 * G * (strain - positive)
    largest = m.define("now", sp.Max(psi, previous))
    degradation = (1 - d) ** 2 + sp.Rational("1e-9")
    stress = m.define("stress", degradation * tension + compression)
    m.weak(stress[: len(u), : len(u)], m.grad(u)[: len(u), : len(u)])
    m.weak(Gc / length * d - 2 * (1 - d) * largest, d)
    m.weak(Gc * length * m.grad(d), m.grad(d))
    m.fields(sigma_xx=stress[0, 0], sigma_yy=stress[1, 1], sigma_xy=stress[0, 1])
    m.history(largest=largest)
