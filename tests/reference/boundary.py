"""Follower pressure (8) and augmented-Lagrangian contact (9)-(10)."""

from __future__ import annotations

from collections.abc import Sequence

from tests.reference.differentiate import PI, Matrix, Number, Vector, jacobian, mp, mpf
from tests.reference.rules import gauss


def residual_pressure(X: Sequence[Number], u: Sequence[Number], pressure: Number) -> Vector:
    """Integral of pressure n . delta u 2 pi r ds over the deformed segment, N.

    n ds = (dr, -dz); the integrand is a quadratic, two Gauss points integrate it exactly.
    """
    z1, r1, z2, r2 = (a + b for a, b in zip(X, u, strict=True))
    forces = [mpf(0)] * 4
    for xi, weight in zip(*gauss(2), strict=True):
        shapes = ((1 - xi) / 2, (1 + xi) / 2)
        ring = 2 * PI * (shapes[0] * r1 + shapes[1] * r2) * weight * pressure
        for a in (0, 1):
            forces[2 * a] += ring * shapes[a] * (r2 - r1) / 2
            forces[2 * a + 1] -= ring * shapes[a] * (z2 - z1) / 2
    return forces


def tangent_pressure(X: Sequence[Number], u: Vector, pressure: Number) -> Matrix:
    """Differences of the residual."""
    return jacobian(lambda v: residual_pressure(X, v, pressure), u)


def residual_contact(
    X: Sequence[Number],
    dofs: Sequence[Number],
    data: Sequence[Number],
    parameters: Sequence[Number],
) -> Vector:
    """Node against an obstacle: (u_z, u_r, lambda) with gap g and augmented pressure l + rho g."""
    n_z, n_r, c, area, rho = data
    offset, force_weight = parameters
    gap = n_z * (X[0] + dofs[0]) + n_r * (X[1] + dofs[1]) - c - offset
    augmented = dofs[2] + rho * gap
    if augmented > 0:
        return [mpf(0), mpf(0), -area * dofs[2] / rho]
    push = force_weight * area * augmented
    return [push * n_z, push * n_r, area * gap]


def tangent_contact(
    X: Sequence[Number], dofs: Vector, data: Sequence[Number], parameters: Sequence[Number]
) -> Matrix:
    """Differences of the residual (the state must not sit on the switch)."""
    return jacobian(lambda v: residual_contact(X, v, data, parameters), dofs)


def residual_friction(
    X: Sequence[Number],
    dofs: Sequence[Number],
    data: Sequence[Number],
    parameters: Sequence[Number],
) -> Vector:
    """(u_z, u_r, lambda, tau): open, sticking where |tau + rho s| <= mu p, else slipping."""
    n_z, n_r, c, area, rho, z_old, r_old = data
    offset, friction = parameters
    normal = dofs[2] + rho * (n_z * (X[0] + dofs[0]) + n_r * (X[1] + dofs[1]) - c - offset)
    if normal > 0:
        return [mpf(0), mpf(0), -area * dofs[2] / rho, -area * dofs[3] / rho]
    slip = n_r * (dofs[0] - z_old) - n_z * (dofs[1] - r_old)
    along, most = dofs[3] + rho * slip, -friction * normal
    equation = area * slip
    if abs(along) > most:
        along = most if along > 0 else -most
        equation = area * (along - dofs[3]) / rho
    forces = [area * (normal * n_z + along * n_r), area * (normal * n_r - along * n_z)]
    return [*forces, area * (normal - dofs[2]) / rho, equation]


def tangent_friction(
    X: Sequence[Number], dofs: Vector, data: Sequence[Number], parameters: Sequence[Number]
) -> Matrix:
    """Differences of the residual (the state must not sit on a switch)."""
    return jacobian(lambda v: residual_friction(X, v, data, parameters), dofs)


def distance(z: Number, r: Number, wall: Number, lip: Number, fillet: Number) -> Vector:
    """Signed distance of (z, r) from the corner and its gradient, case by case."""
    to_z, to_r = z - (wall + fillet), r - (lip + fillet)  # from the centre of the fillet
    if to_z < 0 and to_r < 0:
        radius = mp.sqrt(to_z**2 + to_r**2)
        return [radius - fillet, to_z / radius, to_r / radius]
    before_wall, below_lip = wall - z, lip - r
    nearer = before_wall > below_lip if to_z >= 0 and to_r >= 0 else to_z < 0
    return [before_wall, mpf(-1), mpf(0)] if nearer else [below_lip, mpf(0), mpf(-1)]


def residual_corner(
    X: Sequence[Number],
    dofs: Sequence[Number],
    data: Sequence[Number],
    parameters: Sequence[Number],
) -> Vector:
    """(u_z, u_r, lambda) of a node against the rounded corner."""
    area, rho = data
    gap, n_z, n_r = distance(X[0] + dofs[0], X[1] + dofs[1], *parameters)
    augmented = dofs[2] + rho * gap
    if augmented > 0:
        return [mpf(0), mpf(0), -area * dofs[2] / rho]
    return [area * augmented * n_z, area * augmented * n_r, area * gap]


def tangent_corner(
    X: Sequence[Number], dofs: Vector, data: Sequence[Number], parameters: Sequence[Number]
) -> Matrix:
    """Differences of the residual (the state must not sit on a switch)."""
    return jacobian(lambda v: residual_corner(X, v, data, parameters), dofs)


def energy_corner(
    X: Sequence[Number],
    dofs: Sequence[Number],
    data: Sequence[Number],
    parameters: Sequence[Number],
) -> Number:
    """lambda g + rho g^2 / 2 in contact, else -lambda^2 / (2 rho), times the area."""
    area, rho = data
    gap = distance(X[0] + dofs[0], X[1] + dofs[1], *parameters)[0]
    closed = dofs[2] + rho * gap <= 0
    return area * (dofs[2] * gap + rho * gap**2 / 2 if closed else -(dofs[2] ** 2) / (2 * rho))
