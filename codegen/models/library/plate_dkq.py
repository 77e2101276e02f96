"""Thin plate of Kirchhoff, four nodes (DKQ).

Cells: quad4
Source: Batoz and Ben Tahar (1982), IJNME 18, 1655-1677.
Benchmark: simply supported and clamped square plate under pressure.
"""

import sympy as sp

from softehl import Definition, Model, kinematics, quadrature, shapes

HALF = sp.Rational(1, 2)


def plate_dkq() -> Definition:
    """Deflection w; theta_x, theta_y are its slopes with the opposite sign.

    w is cubic along sides; at their middles the slope along is that of w. The pressure acts on a
    bilinear w. A point at height z moves by z theta.
    """
    m = Model("plate_dkq", nodes=4, rule=quadrature.gauss(2, 2), doc="Plate, DKQ.")
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
    H = sp.Matrix(2, 2, lambda i, k: sum(g[k] * theta[i][a] for a, g in enumerate(e.dN)))
    # quadratic part along each side, zero at the nodes
    for a, (xi_a, eta_a) in enumerate(((0, -1), (1, 0), (0, 1), (-1, 0))):
        b = (a + 1) % 4
        side = [x[b] - x[a] for x in X]
        mean = sum(s * (r[a] + r[b]) / 2 for s, r in zip(side, theta, strict=True))
        length = m.define(f"length_{a}", m.norm(side))
        part = m.define(f"part_{a}", -3 * (w[b] - w[a] + mean) / (2 * length**2))
        bubble = (
            (1 - xi**2) * (1 + eta_a * eta) / 2 if eta_a else (1 - eta**2) * (1 + xi_a * xi) / 2
        )
        slope = sp.Matrix([[sp.diff(bubble, xi), sp.diff(bubble, eta)]]) * e.inverse
        H += part * sp.Matrix(side) * slope
    k_xx, k_yy, k_xy = H[0, 0], H[1, 1], (H[0, 1] + H[1, 0]) / 2
    D = E * t**3 / (12 * (1 - nu**2))
    bending = D / 2 * ((k_xx + k_yy) ** 2 - 2 * (1 - nu) * (k_xx * k_yy - k_xy**2))
    load = p * sum(n * v for n, v in zip(shapes.quad4(xi, eta), w, strict=True))
    m.potential(m.integral("Pi", (bending - load) * e.detJ))
    m.fields(M_xx=D * (k_xx + nu * k_yy), M_yy=D * (k_yy + nu * k_xx), M_xy=D * (1 - nu) * k_xy)
    return m.finish()
