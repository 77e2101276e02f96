"""Quasi-brittle damage with a gradient: the strain that drives it is smoothed over a length.

Cells: any
Source: Peerlings et al. (1996), IJNME 39, 3391-3403; de Vree et al. (1995) for the strain.
Benchmark: homogeneous softening; smoothed strain of an elastic bar beside a fixed end.
"""

import sympy as sp

from softehl import Fields, ModelError, page


@page
def gradient_damage(m: Fields) -> None:
    """e - length^2 div(grad e) = equivalent strain; damage by the largest e so far."""
    if m.geometry == "axisymmetric":
        raise ModelError("gradient_damage has no hoop strain: it is for plane strain and space")
    u, e = m.vector("u"), m.scalar("e")
    E, nu, length, k_0, a, b, ratio = m.parameters(
        E="Young's modulus [MPa]",
        nu="Poisson's ratio",
        length="length over which the strain is smoothed [mm]",
        k_0="strain where damage begins",
        a="part of the stiffness that is lost at last",
        b="rate of softening",
        ratio="strength in compression by that in tension",
    )
    m.require(E > 0, nu > -1, nu < sp.Rational(1, 2), length > 0, k_0 > 0, a <= 1, b > 0, ratio > 0)
    (previous,) = m.point_data(largest="largest smoothed strain so far")
    lame, G = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 + 2 * nu)
    gradient = sp.zeros(3)
    gradient[: len(u), : len(u)] = m.grad(u)[: len(u), : len(u)]
    strain = m.define("strain", (gradient + gradient.T) / 2)
    volume = strain.trace()
    shape = (strain - volume / 3 * sp.eye(3)) * sp.sqrt(6 * ratio) / (1 + nu)
    part = (ratio - 1) / (1 - 2 * nu) * volume
    equivalent = m.define("equivalent", (part + m.norm([part, *shape])) / (2 * ratio))
    largest = m.define("now", sp.Max(e, previous))
    left = k_0 / largest * (1 - a + a * sp.exp(-b * (largest - k_0)))
    D = m.define("D", sp.Piecewise((1 - left, largest > k_0), (0, True)))
    stress = m.define("stress", (1 - D) * (lame * volume * sp.eye(3) + 2 * G * strain))
    m.weak(stress[: len(u), : len(u)], m.grad(u)[: len(u), : len(u)])
    m.weak(e - equivalent, e)
    m.weak(length**2 * m.grad(e), m.grad(e))
    m.fields(D=D, sigma_xx=stress[0, 0], sigma_yy=stress[1, 1], sigma_xy=stress[0, 1])
    m.history(largest=largest)
