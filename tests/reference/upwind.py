"""Upwinding of the bubble load of a film segment, by integrals in which p_b itself stands.

Unknowns: u_z1 u_r1 u_z2 u_r2 and the pressures at the Gauss-Lobatto-Legendre points, end 1 to 2.
Parameters: rod_radius rod_speed viscosity shear_modulus upwinding force_weight.
"""

from __future__ import annotations

from collections.abc import Sequence

from tests.reference.differentiate import PI, Arguments, Number, Vector, mp, mpf
from tests.reference.rules import gauss, lagrange, lobatto


def bubble_load(X: Sequence[Number], dofs: Sequence[Number], pressures: Sequence[Number]) -> Number:
    """Integral of 2 pi r p_b n_r ds, p_b = p - its linear interpolant, n_r ds = -dz, N."""
    z1, r1, z2, r2 = (X[i] + dofs[i] for i in range(4))
    nodes = lobatto(len(pressures))[0]
    total = mpf(0)
    for xi, weight in zip(*gauss(len(pressures) // 2 + 1), strict=True):
        one, two = (1 - xi) / 2, (1 + xi) / 2
        p = mp.fdot(lagrange(nodes, xi)[0], pressures)
        p_b = p - one * pressures[0] - two * pressures[-1]
        total -= 2 * PI * (one * r1 + two * r2) * p_b * weight * (z2 - z1) / 2
    return total


def share(X: Sequence[Number], dofs: Sequence[Number], parameters: Sequence[Number]) -> Number:
    """delta = w Pe^2 / (9 + Pe^2), Pe = 3 eta_0 |U / 2| dx^2 / (pi G h_m^3).

    w = 1 / (1 + (5 (h2 - h1) / h_m)^2) where the film widens downstream, 1 elsewhere.
    """
    rod_radius, speed, viscosity, shear_modulus = parameters[:4]
    z1, r1, z2, r2 = (X[i] + dofs[i] for i in range(4))
    h_m = (r1 + r2) / 2 - rod_radius
    peclet = 3 * viscosity * abs(speed) / 2 * (z2 - z1) ** 2 / (PI * shear_modulus * h_m**3)
    widening = 5 * (r2 - r1) / h_m
    weight = 1 / (1 + widening**2) if speed * widening > 0 else mpf(1)
    return weight * peclet**2 / (9 + peclet**2)


def residual(a: Arguments, dofs: Vector) -> Vector:
    """Radial forces (N) that are taken from node 1 and given to node 2."""
    strength, force_weight = a.parameters[4:]
    factor = force_weight * strength * share(a.X, dofs, a.parameters) / 2
    moved = factor * bubble_load(a.X, dofs, dofs[4:])
    return [mpf(0), -moved, mpf(0), moved] + [mpf(0)] * (len(dofs) - 4)
