"""Follower pressure (8) and augmented-Lagrangian contact (9)-(10)."""

from __future__ import annotations

from tests.reference.differentiate import PI, Arguments, Number, Vector, mp, mpf
from tests.reference.rules import gauss


def pressure(a: Arguments, u: Vector) -> Vector:
    """Integral of pressure n . delta u 2 pi r ds over the deformed segment, N.

    n ds = (dr, -dz); the integrand is a quadratic, two Gauss points integrate it exactly.
    """
    z1, r1, z2, r2 = (x + v for x, v in zip(a.X, u, strict=True))
    forces = [mpf(0)] * 4
    for xi, weight in zip(*gauss(2), strict=True):
        shapes = ((1 - xi) / 2, (1 + xi) / 2)
        ring = 2 * PI * (shapes[0] * r1 + shapes[1] * r2) * weight * a.parameters[0]
        for k in (0, 1):
            forces[2 * k] += ring * shapes[k] * (r2 - r1) / 2
            forces[2 * k + 1] -= ring * shapes[k] * (z2 - z1) / 2
    return forces


def contact(a: Arguments, dofs: Vector) -> Vector:
    """Node against an obstacle: (u_z, u_r, lambda) with gap g and augmented pressure l + rho g."""
    n_z, n_r, c, area, rho = a.data
    offset, force_weight = a.parameters
    gap = n_z * (a.X[0] + dofs[0]) + n_r * (a.X[1] + dofs[1]) - c - offset
    augmented = dofs[2] + rho * gap
    if augmented > 0:
        return [mpf(0), mpf(0), -area * dofs[2] / rho]
    push = force_weight * area * augmented
    return [push * n_z, push * n_r, area * gap]


def friction(a: Arguments, dofs: Vector) -> Vector:
    """(u_z, u_r, lambda, tau): open, sticking where |tau + rho s| <= mu p, else slipping."""
    n_z, n_r, c, area, rho, z_old, r_old = a.data
    offset, coefficient = a.parameters
    normal = dofs[2] + rho * (n_z * (a.X[0] + dofs[0]) + n_r * (a.X[1] + dofs[1]) - c - offset)
    if normal > 0:
        return [mpf(0), mpf(0), -area * dofs[2] / rho, -area * dofs[3] / rho]
    slip = n_r * (dofs[0] - z_old) - n_z * (dofs[1] - r_old)
    along, most = dofs[3] + rho * slip, -coefficient * normal
    equation = area * slip
    if abs(along) > most:
        along = most if along > 0 else -most
        equation = area * (along - dofs[3]) / rho
    forces = [area * (normal * n_z + along * n_r), area * (normal * n_r - along * n_z)]
    return [*forces, area * (normal - dofs[2]) / rho, equation]


def distance(z: Number, r: Number, wall: Number, lip: Number, fillet: Number) -> Number:
    """Signed distance of (z, r) from the corner, case by case."""
    to_z, to_r = z - (wall + fillet), r - (lip + fillet)  # from the centre of the fillet
    if to_z < 0 and to_r < 0:
        return mp.sqrt(to_z**2 + to_r**2) - fillet
    before_wall, below_lip = wall - z, lip - r
    nearer = before_wall > below_lip if to_z >= 0 and to_r >= 0 else to_z < 0
    return before_wall if nearer else below_lip


def corner(a: Arguments, dofs: Vector) -> Number:
    """lambda g + rho g^2 / 2 in contact, else -lambda^2 / (2 rho), times the area, N mm."""
    area, rho = a.data
    gap = distance(a.X[0] + dofs[0], a.X[1] + dofs[1], *a.parameters)
    closed = dofs[2] + rho * gap <= 0
    return area * (dofs[2] * gap + rho * gap**2 / 2 if closed else -(dofs[2] ** 2) / (2 * rho))
