"""Plate of Reissner and Mindlin, four nodes, with assumed transverse shears.

Cells: quad4
Source: Bathe and Dvorkin (1985), IJNME 21, 367-383.
Benchmark: simply supported square plate under pressure, thin and thick.
"""

import sympy as sp

from softehl import Definition, Model, kinematics, quadrature, shapes

HALF = sp.Rational(1, 2)


def plate_mitc4() -> Definition:
    """Deflection w; a point at height z moves by z theta_x, z theta_y along x and y."""
    m = Model("plate_mitc4", nodes=4, rule=quadrature.gauss(2, 2), doc="Plate, MITC4.")
    X = m.coordinates("X", "Y")
    (w,) = m.nodal_unknowns("w")
    theta = m.nodal_unknowns("theta_x", "theta_y")
    E, nu, t, p = m.parameters(
        E="Young's modulus [MPa]",
        nu="Poisson's ratio",
        t="thickness [mm]",
        p="pressure along the deflection [MPa]",
    )
    m.require(E > 0, nu > -1, nu <= HALF, t > 0)
    xi, eta = m.point()
    e = kinematics.isoparametric(m, X, shapes.quad4_gradient(xi, eta))
    H = [[sum(g[k] * r[a] for a, g in enumerate(e.dN)) for k in (0, 1)] for r in theta]
    k_xx, k_yy, k_xy = H[0][0], H[1][1], (H[0][1] + H[1][0]) / 2
    D = E * t**3 / (12 * (1 - nu**2))
    bending = D / 2 * ((k_xx + k_yy) ** 2 - 2 * (1 - nu) * (k_xx * k_yy - k_xy**2))

    def along(a: int, b: int) -> sp.Expr:
        """Covariant shear at the middle of an edge from node b to node a."""
        turned = sum((x[a] - x[b]) * (r[a] + r[b]) / 4 for x, r in zip(X, theta, strict=True))
        return m.define(f"shear_{a}{b}", (w[a] - w[b]) / 2 + turned)

    covariant = sp.Matrix(
        [
            (1 - eta) / 2 * along(1, 0) + (1 + eta) / 2 * along(2, 3),
            (1 - xi) / 2 * along(3, 0) + (1 + xi) / 2 * along(2, 1),
        ]
    )
    shear = e.inverse.T * covariant
    G = E / (2 + 2 * nu)
    N = shapes.quad4(xi, eta)
    load = p * sum(n * v for n, v in zip(N, w, strict=True))
    energy = bending + sp.Rational(5, 12) * G * t * shear.dot(shear)
    m.potential(m.integral("Pi", (energy - load) * e.detJ))
    m.fields(M_xx=D * (k_xx + nu * k_yy), M_yy=D * (k_yy + nu * k_xx), M_xy=D * (1 - nu) * k_xy)
    return m.finish()
