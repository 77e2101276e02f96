"""Interior facet of the discontinuous Galerkin film, equations (22)-(24), signs put right.

Unknowns: u_z1 u_r1 u_z2 u_r2 u_z3 u_r3, then the pressures at the Gauss-Lobatto-Legendre points of
segment 1-2 and of segment 2-3.  Parameters: rod_radius rod_speed viscosity pressure_viscosity.

Written as the bilinear expression itself, evaluated for one test function after another.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from tests.reference.differentiate import Arguments, Matrix, Number, Vector, mp, mpf
from tests.reference.rules import lagrange, lobatto

MOVED = 6


@dataclass(frozen=True)
class Side:
    """One side of the facet: outward normal, trace of p, dp/dx, and the oil there."""

    normal: int
    trace: Number
    slope: Number
    conductance: Number  # h^3 / (12 eta)
    drag: Number  # U h / 2
    tests: tuple[tuple[Number, Number], ...]  # value and d/dx of each shape function

    @property
    def flux(self) -> Number:
        """q of (14)."""
        return self.drag - self.conductance * self.slope


@lru_cache
def _ends(order: int) -> tuple[tuple[Vector, Vector], tuple[Vector, Vector]]:
    nodes = lobatto(order + 1)[0]
    return lagrange(nodes, mpf(1)), lagrange(nodes, mpf(-1))


def sides(a: Arguments, dofs: Vector) -> list[Side]:
    """The segment that ends at the facet, then the one that begins there."""
    rod_radius, speed, eta_0, alpha = a.parameters
    z = [a.X[k] + dofs[k] for k in (0, 2, 4)]
    h = a.X[3] + dofs[3] - rod_radius
    count = (len(dofs) - MOVED) // 2
    pressures = (dofs[MOVED : MOVED + count], dofs[MOVED + count :])
    result = []
    for k, (p, (values, slopes)) in enumerate(zip(pressures, _ends(count - 1), strict=True)):
        stretch = (z[k + 1] - z[k]) / 2
        trace = mp.fdot(values, p)
        result.append(
            Side(
                normal=(1, -1)[k],
                trace=trace,
                slope=mp.fdot(slopes, p) / stretch,
                conductance=h**3 / (12 * eta_0 * mp.exp(alpha * trace)),
                drag=speed * h / 2,
                tests=tuple((v, s / stretch) for v, s in zip(values, slopes, strict=True)),
            )
        )
    return result


def residual(a: Arguments, dofs: Vector) -> Vector:
    """[p n] <dq> - [dp n] <q>, and no force on the solid."""
    both = sides(a, dofs)
    jump = sum(side.trace * side.normal for side in both)
    flux = sum(side.flux for side in both) / 2
    rows: Vector = [mpf(0)] * MOVED
    for side in both:
        for value, slope in side.tests:
            test_flux = -side.conductance * slope / 2
            rows.append(jump * test_flux - value * side.normal * flux)
    return rows


def fields(a: Arguments, dofs: Vector) -> Matrix:
    """x h jump flux flux_jump."""
    minus, plus = sides(a, dofs)
    h = a.X[3] + dofs[3] - a.parameters[0]
    mean = (minus.flux + plus.flux) / 2
    return [[a.X[2] + dofs[2], h, minus.trace - plus.trace, mean, minus.flux - plus.flux]]
