"""Ogden solid in principal stretches: equal stretches need no care."""

from typing import Any

import sympy as sp

from softehl.codegen.elements import quadrature, shapes
from softehl.codegen.language import kinematics as kin
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model


def ogden() -> Definition:
    """8-node solid, W = sum_p mu_p/alpha_p sum_k (lbar_k^alpha_p - 1) + kappa/2 (J - 1)^2."""
    m = Model("ogden_hex8", nodes=8, rule=quadrature.gauss(2, 3), doc=ogden.__doc__)
    X = m.coordinates("X", "Y", "Z")
    u = m.nodal_unknowns("u", "v", "w")
    mu_1, alpha_1, mu_2, alpha_2, kappa = m.parameters(
        mu_1="first modulus [MPa]",
        alpha_1="first exponent",
        mu_2="second modulus [MPa]",
        alpha_2="second exponent",
        kappa="bulk modulus [MPa]",
    )
    e = kin.isoparametric(m, X, shapes.hex8_gradient(*m.point()))
    F = kin.deformation_gradient(m, e.dN, u)
    C = m.define("C", F.T * F)

    def energy(l1: Any, l2: Any, l3: Any) -> Any:
        J = l1 * l2 * l3
        isochoric = sum(
            mu / alpha * (J ** (-alpha / 3) * (l1**alpha + l2**alpha + l3**alpha) - 3)
            for mu, alpha in ((mu_1, alpha_1), (mu_2, alpha_2))
        )
        return isochoric + kappa / 2 * (J - 1) ** 2

    W = m.principal("W", C, energy)
    m.potential(m.integral("Pi", W * e.detJ))
    m.fields(W=W, J=sp.sqrt(C.det()))
    m.offer(tasks=["energy", "residual", "tangent", "fields"])
    return m.finish()
