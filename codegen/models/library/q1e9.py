"""Neo-Hooke with an enhanced deformation gradient: 9 modes in space, 4 in the plane (Q1E9).

Cells: hex8, quad4
Source: Simo and Armero (1992), IJNME 33, 1413-1449.
Benchmark: incompressible tube under inner pressure at large strain.
"""

import sympy as sp

from softehl import Fields, ModelError, page


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
    W = mu / 2 * ((F.T * F).trace() * J ** sp.Rational(-2, 3) - 3) + kappa / 2 * (J - 1) ** 2
    m.minimise(W)
    m.fields(J=J, pressure=-kappa * (J - 1))
