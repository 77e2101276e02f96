"""Ogden's rubber in principal stretches: the 3-D solid with 8 nodes."""

import sympy as sp

from softehl import Definition, Model, kinematics, quadrature, shapes


def ogden() -> Definition:
    """W = sum_p mu_p / alpha_p (sum_i lambda_i^alpha_p - 3 - alpha_p ln J) + lame / 2 (ln J)^2."""
    m = Model("ogden", nodes=8, rule=quadrature.gauss(2, 3), doc=ogden.__doc__)
    X = m.coordinates("X", "Y", "Z")
    u = m.nodal_unknowns("u_x", "u_y", "u_z")
    mu_1, alpha_1, mu_2, alpha_2, lame = m.parameters(
        mu_1="first modulus [MPa]",
        alpha_1="first exponent",
        mu_2="second modulus [MPa]",
        alpha_2="second exponent",
        lame="first Lame parameter [MPa]",
    )
    xi, eta, zeta = m.point()
    e = kinematics.isoparametric(m, X, shapes.hex8_gradient(xi, eta, zeta))
    F = kinematics.deformation_gradient(m, e.dN, u)
    C = m.define("C", F.T * F)

    def energy(a, b, c):
        log_J = sp.log(a * b * c)
        terms = [
            mu / alpha * (a**alpha + b**alpha + c**alpha - 3 - alpha * log_J)
            for mu, alpha in ((mu_1, alpha_1), (mu_2, alpha_2))
        ]
        return sum(terms) + lame / 2 * log_J**2

    m.potential(m.integral("Pi", m.principal("W", C, energy) * e.detJ))
    m.offer(tasks=["residual", "tangent"])
    return m.finish()
