"""Nearly incompressible neo-Hooke with F-bar: J is that of the centroid of the cell.

Cells: quad4, hex8
Source: de Souza Neto et al. (1996), IJSS 33, 3277-3296, as a potential.
Benchmark: incompressible tube under inner pressure at large strain.
"""

import sympy as sp

from softehl import Fields, page


@page
def fbar(m: Fields) -> None:
    """Neo-Hooke of F scaled to J of the centroid; in plane strain in the plane only."""
    u = m.vector("u")
    mu, kappa = m.parameters(mu="shear modulus [MPa]", kappa="bulk modulus [MPa]")
    m.require(mu > 0, kappa > 0)
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    centre = m.define("J_centre", m.centroid(J))
    scale = m.define("scale", (centre / J) ** sp.Rational(1, len(u)))
    stretch = sp.diag(*[scale] * len(u), *[1] * (3 - len(u)))
    I1 = ((F * stretch).T * (F * stretch)).trace()
    W = mu / 2 * (I1 * centre ** sp.Rational(-2, 3) - 3) + kappa / 2 * (centre - 1) ** 2
    m.minimise(W)
    m.fields(J=centre, pressure=-kappa * (centre - 1))
