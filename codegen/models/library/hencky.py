"""Hyperelastic law of Hencky: quadratic in the logarithmic strain.

Source: Hencky (1928); Xiao and Chen (2002), Acta Mechanica 157, 51-60.
Benchmark: simple tension, Kirchhoff stress E ln(stretch) for nu = 1/2.
"""

import sympy as sp

from softehl import Material, material


@material
def hencky(m: Material) -> None:
    """kappa / 2 (ln J)^2 + mu dev E : dev E with E = 1/2 ln C."""
    mu, kappa = m.parameters(mu="shear modulus [MPa]", kappa="bulk modulus [MPa]")
    m.require(mu > 0, kappa > 0)
    E = m.define("E", m.log(m.F.T * m.F) / 2)
    volume = m.define("volume", E.trace())
    deviator = E - sp.eye(3) * volume / 3
    m.energy(kappa / 2 * volume**2 + mu * (deviator.T * deviator).trace())
