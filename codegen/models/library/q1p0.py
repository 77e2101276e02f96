"""Nearly incompressible neo-Hooke with one pressure in every cell (mean dilatation).

Cells: quad4, hex8, quad9, hex27
Source: Simo, Taylor and Pister (1985), CMAME 51, 177-208.
Benchmark: incompressible tube under inner pressure at large strain.
"""

import sympy as sp

from softehl import Fields, page

ENTRIES = (("xx", 0, 0), ("yy", 1, 1), ("zz", 2, 2), ("xy", 0, 1), ("yz", 1, 2), ("xz", 0, 2))


@page
def q1p0(m: Fields) -> None:
    """mu / 2 (J^(-2/3) I1 - 3) + p (J - 1) - p^2 / (2 kappa), p condensed."""
    u, p = m.vector("u"), m.internal("p")
    mu, kappa = m.parameters(mu="shear modulus [MPa]", kappa="bulk modulus [MPa]")
    m.require(mu > 0, kappa > 0)
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    I1 = (F.T * F).trace()
    W = mu / 2 * (I1 * J ** sp.Rational(-2, 3) - 3) + p * (J - 1) - p**2 / (2 * kappa)
    m.minimise(W)
    deviator = F * F.T - I1 / 3 * sp.eye(3)
    stress = mu * J ** sp.Rational(-5, 3) * deviator + p * sp.eye(3)
    m.fields(J=J, pressure=-p, **{f"sigma_{n}": stress[i, j] for n, i, j in ENTRIES})
