"""Reynolds film on a deformed segment, equations (13)-(18), (20)-(21) and (25)-(28).

Unknowns: u_z1 u_r1 u_z2 u_r2 and the pressures at the Gauss-Lobatto-Legendre points, end 1 to 2.
Parameters: rod_radius rod_speed viscosity pressure_viscosity cavitation_penalty force_weight
shear_weight, then those of `tests.reference.rheology`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

from tests.reference.differentiate import PI, Arguments, Matrix, Number, Vector, mp, mpf
from tests.reference.rheology import thinned
from tests.reference.rules import lagrange, lobatto, rule


@dataclass(frozen=True)
class FilmPoint:
    """State of the film at one quadrature point (names as in the paper)."""

    shapes: tuple[Number, Number]
    test: Vector
    test_slope: Vector  # d/dx of the pressure shape functions
    dx: Number
    ds: Number
    x: Number
    r: Number
    h: Number
    p: Number
    slope: Number  # dp/dx
    viscosity: Number
    flux: Number
    tau: Number
    tau_rod: Number
    driving: Number  # dp/dx of the same flux without thinning
    n_ds: tuple[Number, Number]


@lru_cache
def _tables(order: int, kind: str, count: int) -> list[tuple[Number, Number, Vector, Vector]]:
    nodes = lobatto(order + 1)[0]
    return [
        (xi, weight, *lagrange(nodes, xi)) for xi, weight in zip(*rule(kind, count), strict=True)
    ]


def film_points(a: Arguments, dofs: Vector) -> Iterator[FilmPoint]:
    """All quadrature points of the segment; what follows seven parameters is how the oil thins."""
    rod_radius, speed, eta_0, alpha = a.parameters[:4]
    z1, r1, z2, r2 = (a.X[i] + dofs[i] for i in range(4))
    pressures = dofs[4:]
    half_z, half_r = (z2 - z1) / 2, (r2 - r1) / 2
    for xi, weight, basis, slopes in _tables(len(pressures) - 1, a.kind, a.count):
        one, two = (1 - xi) / 2, (1 + xi) / 2
        r = one * r1 + two * r2
        h = r - rod_radius
        p = mp.fdot(basis, pressures)
        slope = mp.fdot(slopes, pressures) / _along(half_z, half_r)
        eta = eta_0 * mp.exp(alpha * p)
        middle, driving = thinned(speed, h, eta, slope, a.parameters[7:])
        yield FilmPoint(
            shapes=(one, two),
            test=basis,
            test_slope=[s / half_z for s in slopes],
            dx=weight * half_z,
            ds=weight * mp.sqrt(half_z**2 + half_r**2),
            x=one * z1 + two * z2,
            r=r,
            h=h,
            p=p,
            slope=slope,
            viscosity=eta,
            flux=speed / 2 * h - h**3 / (12 * eta) * driving,
            tau=middle - h / 2 * slope,
            tau_rod=middle + h / 2 * slope,
            driving=driving,
            n_ds=(weight * half_r, -weight * half_z),
        )


def _along(half_z: Number, half_r: Number) -> Number:
    """Half the length along the rod; towards that of the segment itself where it stands upright."""
    sine = half_r / mp.hypot(half_z, half_r)
    return mp.hypot(half_z, half_r * sine**4)


def residual(a: Arguments, dofs: Vector) -> Vector:
    """Forces of (18) on the two nodes (N), then the Reynolds rows (25)."""
    penalty, force_weight, shear_weight = a.parameters[4:7]
    forces, rows = [mpf(0)] * 4, [mpf(0)] * (len(dofs) - 4)
    for at in film_points(a, dofs):
        pull = (at.p * at.n_ds[0] - shear_weight * at.tau * at.ds, at.p * at.n_ds[1])
        for end in (0, 1):
            for k in (0, 1):
                forces[2 * end + k] += force_weight * pull[k] * at.shapes[end] * 2 * PI * at.r
        for i, (value, slope) in enumerate(zip(at.test, at.test_slope, strict=True)):
            rows[i] += (slope * at.flux + penalty * value * max(-at.p, mpf(0))) * at.dx
    return forces + rows


def fields(a: Arguments, dofs: Vector) -> Matrix:
    """x dx h p tau flux tau_rod eta at the quadrature points, driving where the oil thins."""
    found = []
    for at in film_points(a, dofs):
        more = [at.driving] if a.parameters[7:] else []
        found.append(
            [at.x, abs(at.dx), at.h, at.p, at.tau, at.flux, at.tau_rod, at.viscosity, *more]
        )
    return found
