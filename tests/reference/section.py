"""Mean rotation held by a moment, mean axial place by a force, and the weak axial spring."""

from __future__ import annotations

from tests.reference.differentiate import Arguments, Number, Vector, mp, mpf
from tests.reference.solids import gauss_points


def rotation(a: Arguments, dofs: Vector) -> Number:
    """(M / I) times the integral of (Z-Zc) u_r - (R-Rc) u_z - angle rho^2 over the area, N mm."""
    centre_z, centre_r, polar_moment, angle = a.parameters
    total = mpf(0)
    for at in gauss_points(a.X):
        z, r = at.mean(a.X, 0) - centre_z, at.mean(a.X, 1) - centre_r
        u_z, u_r = at.mean(dofs, 0), at.mean(dofs, 1)
        total += (z * u_r - r * u_z - angle * (z * z + r * r)) * at.area
    return dofs[8] / polar_moment * total


def axial(a: Arguments, dofs: Vector) -> Number:
    """(N / A) times the integral of u_z - place over the area of the element, N mm."""
    area, place = a.parameters
    return (
        dofs[8] / area * mp.fsum((at.mean(dofs, 0) - place) * at.area for at in gauss_points(a.X))
    )


def spring(a: Arguments, u: Vector) -> Number:
    """stiffness / 2 times the integral of u_z^2 over the area, N mm (no factor 2 pi R)."""
    return a.parameters[0] / 2 * mp.fsum(at.mean(u, 0) ** 2 * at.area for at in gauss_points(a.X))
