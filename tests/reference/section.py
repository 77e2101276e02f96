"""Mean rotation held by a moment, mean axial place by a force, and the weak axial spring."""

from __future__ import annotations

from collections.abc import Sequence

from tests.reference.differentiate import Matrix, Number, Vector, gradient, hessian, mp, mpf
from tests.reference.solids import gauss_points


def energy_rotation(
    X: Sequence[Number], dofs: Sequence[Number], parameters: Sequence[Number]
) -> Number:
    """(M / I) times the integral of (Z-Zc) u_r - (R-Rc) u_z - angle rho^2 over the area, N mm."""
    centre_z, centre_r, polar_moment, angle = parameters
    total = mpf(0)
    for at in gauss_points(X):
        z = mp.fsum(s * X[2 * a] for a, s in enumerate(at.shapes)) - centre_z
        r = mp.fsum(s * X[2 * a + 1] for a, s in enumerate(at.shapes)) - centre_r
        u_z = mp.fsum(s * dofs[2 * a] for a, s in enumerate(at.shapes))
        u_r = mp.fsum(s * dofs[2 * a + 1] for a, s in enumerate(at.shapes))
        total += (z * u_r - r * u_z - angle * (z * z + r * r)) * at.area
    return dofs[8] / polar_moment * total


def residual_rotation(X: Sequence[Number], dofs: Vector, parameters: Sequence[Number]) -> Vector:
    """Gradient of the potential."""
    return gradient(lambda v: energy_rotation(X, v, parameters), dofs)


def tangent_rotation(X: Sequence[Number], dofs: Vector, parameters: Sequence[Number]) -> Matrix:
    """Second differences of the potential."""
    return hessian(lambda v: energy_rotation(X, v, parameters), dofs)


def energy_axial(
    X: Sequence[Number], dofs: Sequence[Number], parameters: Sequence[Number]
) -> Number:
    """(N / A) times the integral of u_z - place over the area of the element, N mm."""
    area, place = parameters
    total = mpf(0)
    for at in gauss_points(X):
        u_z = mp.fsum(s * dofs[2 * a] for a, s in enumerate(at.shapes))
        total += (u_z - place) * at.area
    return dofs[8] / area * total


def residual_axial(X: Sequence[Number], dofs: Vector, parameters: Sequence[Number]) -> Vector:
    """Gradient of the potential."""
    return gradient(lambda v: energy_axial(X, v, parameters), dofs)


def tangent_axial(X: Sequence[Number], dofs: Vector, parameters: Sequence[Number]) -> Matrix:
    """Second differences of the potential."""
    return hessian(lambda v: energy_axial(X, v, parameters), dofs)


def energy_spring(X: Sequence[Number], u: Sequence[Number], stiffness: Number) -> Number:
    """stiffness / 2 times the integral of u_z^2 over the area, N mm (no factor 2 pi R)."""
    total = mpf(0)
    for at in gauss_points(X):
        u_z = mp.fsum(s * u[2 * a] for a, s in enumerate(at.shapes))
        total += u_z * u_z * at.area
    return stiffness / 2 * total


def residual_spring(X: Sequence[Number], u: Vector, stiffness: Number) -> Vector:
    """Gradient of the potential."""
    return gradient(lambda v: energy_spring(X, v, stiffness), u)


def tangent_spring(X: Sequence[Number], u: Vector, stiffness: Number) -> Matrix:
    """Second differences of the potential."""
    return hessian(lambda v: energy_spring(X, v, stiffness), u)
