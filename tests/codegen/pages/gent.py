"""Gent solid: rubber whose chains have a finite length."""

import sympy as sp

from softehl.codegen.elements import quadrature, shapes
from softehl.codegen.language import kinematics as kin
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model


def gent() -> Definition:
    """4-node plane strain solid, W = -mu Jm/2 ln(1 - (I1bar - 3)/Jm) + kappa/2 (J - 1)^2."""
    m = Model("gent", nodes=4, rule=quadrature.gauss(2, 2), unroll=True, doc=gent.__doc__)
    X = m.coordinates("X", "Y")
    u = m.nodal_unknowns("u", "v")
    mu, Jm, kappa = m.parameters(
        mu="shear modulus [MPa]",
        Jm="limit of I1bar - 3",
        kappa="bulk modulus [MPa]",
    )
    e = kin.isoparametric(m, X, shapes.quad4_gradient(*m.point()))
    F = kin.deformation_gradient(m, e.dN, u)
    J = m.define("J", F.det())
    I1 = m.define("I1", J ** sp.Rational(-2, 3) * ((F.T * F).trace() + 1))

    W = -mu * Jm / 2 * sp.log(1 - (I1 - 3) / Jm) + kappa / 2 * (J - 1) ** 2
    m.potential(m.integral("Pi", W * e.detJ))

    P = m.derivative("P", W, F)
    sigma = P * F.T / J
    m.fields(J=J, sigma_xx=sigma[0, 0], sigma_yy=sigma[1, 1], sigma_xy=sigma[0, 1])
    return m.finish()
