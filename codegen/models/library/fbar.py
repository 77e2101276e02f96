"""Nearly incompressible neo-Hooke with F-bar: J is that of the centroid of the cell.

Cells: quad4, hex8
Source: de Souza Neto et al. (1996), IJSS 33, 3277-3296, as a potential.
Benchmark: incompressible tube under inner pressure at large strain.
"""

import sympy as sp

from softehl import Fields, page

ENTRIES = (("xx", 0, 0), ("yy", 1, 1), ("zz", 2, 2), ("xy", 0, 1), ("yz", 1, 2), ("xz", 0, 2))


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
    b = F * stretch * stretch * F.T
    I1 = b.trace()
    W = mu / 2 * (I1 * centre ** sp.Rational(-2, 3) - 3) + kappa / 2 * (centre - 1) ** 2
    m.minimise(W)
    stress = mu * centre ** sp.Rational(-5, 3) * (b - I1 / 3 * sp.eye(3))
    stress += kappa * (centre - 1) * sp.eye(3)
    sigma = {f"sigma_{n}": stress[i, j] for n, i, j in ENTRIES}
    m.fields(J=centre, pressure=-kappa * (centre - 1), **sigma)
