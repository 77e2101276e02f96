"""Rubber whose isochoric energy is a network of two invariants."""

import sympy as sp

import softehl


@softehl.material
def learned(m):
    """W(I1_bar - 3, I2_bar - 3) + kappa / 4 (J^2 - 1 - 2 ln J)."""
    (kappa,) = m.parameters(kappa="bulk modulus [MPa]")
    C, J = m.F.T * m.F, m.define("J", m.F.det())
    I1, I2 = C.trace(), (C.trace() ** 2 - (C * C).trace()) / 2
    a = m.define("a", I1 * J ** sp.Rational(-2, 3) - 3)
    b = m.define("b", I2 * J ** sp.Rational(-4, 3) - 3)
    W = m.network("W", [a, b], layers=(8,), convex=True, monotone=True)
    m.energy(W + kappa / 4 * (J**2 - 1 - 2 * sp.log(J)))
