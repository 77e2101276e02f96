"""Neo-Hooke with an enhanced deformation gradient: 9 modes in space, 4 in the plane (Q1E9).

Cells: hex8, quad4
Source: Simo and Armero (1992), IJNME 33, 1413-1449.
Benchmark: incompressible tube under inner pressure at large strain.
"""

import sympy as sp

from softehl import Fields, ModelError, page

ENTRIES = (("xx", 0, 0), ("yy", 1, 1), ("zz", 2, 2), ("xy", 0, 1), ("yz", 1, 2), ("xz", 0, 2))


@page
def q1e9(m: Fields) -> None:
    """The gradient has modes of the cell beside those of u; they are condensed."""
    if m.geometry == "axisymmetric":
        raise ModelError("q1e9 has no hoop strain: it is for plane strain and space")
    u = m.vector("u")
    size = len(u)
    a = sp.Matrix(size, size, m.internal("a", size**2))
    mu, kappa = m.parameters(mu="shear modulus [MPa]", kappa="bulk modulus [MPa]")
    m.require(mu > 0, kappa > 0)
    jacobian, centre = m.jacobian, m.centroid(m.jacobian)
    added = sp.zeros(3)
    modes = a * sp.diag(*m.parent) * centre.inv()
    added[:size, :size] = centre.det() / jacobian.det() * modes
    F = m.define("enhanced", m.deformation_gradient(u) + added)
    J = m.define("J", F.det())
    I1 = (F.T * F).trace()
    m.minimise(mu / 2 * (I1 * J ** sp.Rational(-2, 3) - 3) + kappa / 2 * (J - 1) ** 2)
    stress = mu * J ** sp.Rational(-5, 3) * (F * F.T - I1 / 3 * sp.eye(3))
    stress += kappa * (J - 1) * sp.eye(3)
    sigma = {f"sigma_{n}": stress[i, j] for n, i, j in ENTRIES}
    m.fields(J=J, pressure=-kappa * (J - 1), **sigma)
