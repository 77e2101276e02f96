"""Incompressible neo-Hooke with a continuous pressure of one order less (Taylor and Hood).

Cells: quad9, tri6, hex27, tet10
Source: Sussman and Bathe (1987), Computers & Structures 26, 357-409.
Benchmark: incompressible tube under inner pressure at large strain.
"""

import sympy as sp

from softehl import Fields, page

ENTRIES = (("xx", 0, 0), ("yy", 1, 1), ("zz", 2, 2), ("xy", 0, 1), ("yz", 1, 2), ("xz", 0, 2))


@page
def taylor_hood(m: Fields) -> None:
    """mu / 2 (I1 - 3) + p (J - 1): p is the multiplier of J = 1."""
    u, p = m.vector("u"), m.scalar("p", order=1)
    (mu,) = m.parameters(mu="shear modulus [MPa]")
    m.require(mu > 0)
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    m.minimise(mu / 2 * ((F.T * F).trace() - 3) + p * (J - 1))
    stress = mu / J * F * F.T + p * sp.eye(3)
    m.fields(J=J, **{f"sigma_{n}": stress[i, j] for n, i, j in ENTRIES})
