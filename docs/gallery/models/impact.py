"""An elastic body at large strain."""

import sympy as sp

import softehl


@softehl.page
def elastic(m):
    """Neo-Hooke; at small strain Hooke's law with the moduli mu and K."""
    mu, K = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]")
    F = m.deformation_gradient(m.vector("u"))
    J = m.define("J", F.det())
    I1 = (F.T * F).trace() * J ** sp.Rational(-2, 3)
    m.minimise(mu / 2 * (I1 - 3) + K / 2 * (J - 1) ** 2)
