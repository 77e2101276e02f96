"""Axisymmetric four-node solids: plain, F-bar and two Taylor-expanded, in (Z, R).

8 node coordinates (reference), 8 displacements and the parameters (mu_1, mu_2, kappa); energies in
N mm, residuals in N. The one expanded about its means takes any isochoric `law`, whose parameters
come before kappa.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from tests.reference import material
from tests.reference.differentiate import (
    PI,
    STEP,
    Arguments,
    Matrix,
    Number,
    Potential,
    Vector,
    gradient,
    mp,
    mpf,
)
from tests.reference.rules import gauss

CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))
Coordinates = Sequence[Number]
Law = Callable[..., Number]
"""Isochoric term of an energy, of a deformation gradient and its own parameters."""


@dataclass(frozen=True)
class Point:
    """Geometry of one point: shape functions, gradients by (Z, R), radius, det dX/dxi, weight."""

    shapes: Vector
    gradients: list[tuple[Number, Number]]
    radius: Number
    area: Number

    def deformation(self, u: Sequence[Number]) -> Vector:
        """F = 1 + Grad u with the hoop stretch 1 + u_r / R."""
        zz = 1 + mp.fsum(g[0] * u[2 * a] for a, g in enumerate(self.gradients))
        zr = mp.fsum(g[1] * u[2 * a] for a, g in enumerate(self.gradients))
        rz = mp.fsum(g[0] * u[2 * a + 1] for a, g in enumerate(self.gradients))
        rr = 1 + mp.fsum(g[1] * u[2 * a + 1] for a, g in enumerate(self.gradients))
        tt = 1 + mp.fsum(s * u[2 * a + 1] for a, s in enumerate(self.shapes)) / self.radius
        return [zz, zr, rz, rr, tt]

    def work(self, P: Sequence[Number]) -> Vector:
        """Nodal forces P . Grad (delta phi) per unit reference volume."""
        forces = []
        for shape, (along_z, along_r) in zip(self.shapes, self.gradients, strict=True):
            forces.append(P[0] * along_z + P[1] * along_r)
            forces.append(P[2] * along_z + P[3] * along_r + P[4] * shape / self.radius)
        return forces

    def mean(self, values: Sequence[Number], component: int) -> Number:
        """A component of nodal values (two a node), interpolated."""
        return mp.fsum(s * values[2 * a + component] for a, s in enumerate(self.shapes))

    @property
    def volume(self) -> Number:
        """2 pi R dA for unit weight, mm^3."""
        return 2 * PI * self.radius * self.area


def point(X: Coordinates, xi: Number, eta: Number) -> Point:
    """The bilinear map and its inverse transposed Jacobian at (xi, eta)."""
    shapes = [(1 + a * xi) * (1 + b * eta) / 4 for a, b in CORNERS]
    slopes = [(a * (1 + b * eta) / 4, b * (1 + a * xi) / 4) for a, b in CORNERS]
    z_xi, z_eta = (mp.fsum(s[k] * X[2 * a] for a, s in enumerate(slopes)) for k in (0, 1))
    r_xi, r_eta = (mp.fsum(s[k] * X[2 * a + 1] for a, s in enumerate(slopes)) for k in (0, 1))
    det = z_xi * r_eta - z_eta * r_xi
    gradients = [((s * r_eta - t * r_xi) / det, (t * z_xi - s * z_eta) / det) for s, t in slopes]
    radius = mp.fsum(s * X[2 * a + 1] for a, s in enumerate(shapes))
    return Point(shapes, gradients, radius, det)


def gauss_places() -> list[tuple[Number, Number]]:
    """The 2x2 Gauss points (unit weights)."""
    line = gauss(2)[0]
    return [(xi, eta) for eta in line for xi in line]


def gauss_points(X: Coordinates) -> list[Point]:
    """Geometry of the 2x2 Gauss points."""
    return [point(X, xi, eta) for xi, eta in gauss_places()]


def plain(a: Arguments) -> Potential:
    """Integral of (3) over the element."""
    points = gauss_points(a.X)
    return lambda u: plain_energy(points, u, a.parameters)


def plain_energy(points: list[Point], u: Sequence[Number], parameters: Sequence[Number]) -> Number:
    """The same with the geometry of its points."""
    return mp.fsum(at.volume * material.energy(at.deformation(u), *parameters) for at in points)


def modified_gradient(at: Point, centre: Point, u: Sequence[Number]) -> tuple[Vector, Number]:
    """Fbar = (J0/J)^(1/3) F and J/J0, with J0 at the centroid (xi = eta = 0)."""
    F = at.deformation(u)
    ratio = material.determinant(F) / material.determinant(centre.deformation(u))
    return [mp.cbrt(1 / ratio) * entry for entry in F], ratio


def fbar(a: Arguments, u: Vector) -> Vector:
    """Forces of P_eff = (J/J0)^(2/3) P(Fbar)."""
    centre, total = point(a.X, mpf(0), mpf(0)), [mpf(0)] * 8
    for at in gauss_points(a.X):
        Fbar, ratio = modified_gradient(at, centre, u)
        factor = mp.cbrt(ratio) ** 2
        stress = [factor * entry for entry in material.first_piola(Fbar, *a.parameters)]
        forces = at.work(stress)
        total = [t + at.volume * f for t, f in zip(total, forces, strict=True)]
    return total


def taylor_points(X: Coordinates) -> tuple[list[Point], Point]:
    """Gauss points whose gradients and shape functions are first-order expansions at the centre.

    The hoop term keeps the exact radius of the point, the weight the Jacobian of the centre.
    """
    centre, points = point(X, mpf(0), mpf(0)), []
    ahead, behind = point(X, STEP, mpf(0)), point(X, -STEP, mpf(0))
    above, below = point(X, mpf(0), STEP), point(X, mpf(0), -STEP)
    for xi, eta in gauss_places():
        gradients = [
            tuple(
                centre.gradients[a][k]
                + xi * (ahead.gradients[a][k] - behind.gradients[a][k]) / (2 * STEP)
                + eta * (above.gradients[a][k] - below.gradients[a][k]) / (2 * STEP)
                for k in (0, 1)
            )
            for a in range(4)
        ]
        shapes = [(1 + a * xi + b * eta) / 4 for a, b in CORNERS]
        points.append(Point(shapes, gradients, point(X, xi, eta).radius, centre.area))
    return points, centre


def taylor(a: Arguments) -> Potential:
    """Isochoric part at the expanded Gauss points, volumetric part at the centre only."""
    points, centre = taylor_points(a.X)
    mu_1, mu_2, kappa = a.parameters

    def energy(u: Vector) -> Number:
        shear = mp.fsum(
            at.volume * material.isochoric(at.deformation(u), mu_1, mu_2) for at in points
        )
        I3 = material.third_invariant(centre.deformation(u))
        return shear + 4 * centre.volume * material.volumetric(I3, kappa)

    return energy


def mean_points(X: Coordinates) -> tuple[list[Point], Point]:
    """Gauss points with expansions about the means over the element, and the means themselves.

    Means of dN_a and N_a / R are weighted with 2 pi R dA, by 4 x 4 points; the first-order terms
    are differences at the centre, less their own means. Shapes are those that, over the radius of
    the point, give the hoop term.
    """
    line, weights = gauss(4)
    places = [(x, y, v * w) for x, v in zip(line, weights) for y, w in zip(line, weights)]  # noqa: B905
    fine = [(xi, eta, w, point(X, xi, eta)) for xi, eta, w in places]
    volume = mp.fsum(w * at.volume for _, _, w, at in fine)

    def mean(value: Callable[[Number, Number, Point], Number]) -> Number:
        return mp.fsum(w * at.volume * value(xi, eta, at) for xi, eta, w, at in fine) / volume

    def terms(at: Point, a: int) -> Vector:
        return [*at.gradients[a], at.shapes[a] / at.radius]

    middle = mean(lambda xi, eta, at: xi), mean(lambda xi, eta, at: eta)
    zeroth = [[mean(lambda xi, eta, at: terms(at, a)[k]) for k in range(3)] for a in range(4)]  # noqa: B023
    ahead, behind = point(X, STEP, mpf(0)), point(X, -STEP, mpf(0))
    above, below = point(X, mpf(0), STEP), point(X, mpf(0), -STEP)
    radius = mean(lambda xi, eta, at: at.radius)
    points = []
    for xi, eta in gauss_places():
        exact, rows = point(X, xi, eta), []
        for a in range(4):
            by_xi = differences_of(terms(ahead, a), terms(behind, a))
            by_eta = differences_of(terms(above, a), terms(below, a))
            rows.append(
                [
                    g + (xi - middle[0]) * k + (eta - middle[1]) * n
                    for g, k, n in zip(zeroth[a], by_xi, by_eta, strict=True)
                ]
            )
        shapes = [row[2] * exact.radius for row in rows]
        points.append(Point(shapes, [(r[0], r[1]) for r in rows], exact.radius, exact.area))
    area = volume / (2 * PI * radius)
    whole = Point([z[2] * radius for z in zeroth], [(z[0], z[1]) for z in zeroth], radius, area)
    return points, whole


def differences_of(ahead: Vector, behind: Vector) -> Vector:
    """Central differences from values one STEP ahead and behind."""
    return [(a - b) / (2 * STEP) for a, b in zip(ahead, behind, strict=True)]


def taylor_mean(a: Arguments, law: Law = material.isochoric) -> Potential:
    """Isochoric part at the Gauss points, volumetric part of the mean gradient."""
    points, whole = mean_points(a.X)
    *own, kappa = a.parameters

    def energy(u: Vector) -> Number:
        shear = mp.fsum(at.volume * law(at.deformation(u), *own) for at in points)
        I3 = material.third_invariant(whole.deformation(u))
        return shear + whole.volume * material.volumetric(I3, kappa)

    return energy


def plain_fields(a: Arguments, u: Vector) -> Matrix:
    """z, r, J and the Cauchy stress zz, rr, tt, zr at the Gauss points of the plain element."""
    return [_row(a, u, at, at.deformation(u)) for at in gauss_points(a.X)]


def fbar_fields(a: Arguments, u: Vector) -> Matrix:
    """The same of Fbar: J is that of the centroid, the stress is P_eff F^T / J."""
    centre = point(a.X, mpf(0), mpf(0))
    return [_row(a, u, at, modified_gradient(at, centre, u)[0]) for at in gauss_points(a.X)]


def taylor_fields(a: Arguments, u: Vector) -> Matrix:
    """J of the centre; Cauchy stress = isochoric Kirchhoff stress of the point / J + dW_v/dJ."""
    return _expanded(taylor_points(a.X), a, u, material.isochoric)


def taylor_mean_fields(a: Arguments, u: Vector, law: Law = material.isochoric) -> Matrix:
    """The same with J of the mean gradient."""
    return _expanded(mean_points(a.X), a, u, law)


def _expanded(geometry: tuple[list[Point], Point], a: Arguments, u: Vector, law: Law) -> Matrix:
    rows, (expanded, whole) = [], geometry
    *own, kappa = a.parameters
    J = material.determinant(whole.deformation(u))
    mean = gradient(lambda x: material.volumetric(x[0] ** 2, kappa), [J])[0]
    for at, exact in zip(expanded, gauss_points(a.X), strict=True):
        zz, zr, rz, rr, tt = F = at.deformation(u)
        P = gradient(lambda G: law(G, *own), F)
        stress = [
            (P[0] * zz + P[1] * zr) / J + mean,
            (P[2] * rz + P[3] * rr) / J + mean,
            P[4] * tt / J + mean,
            (P[0] * rz + P[1] * rr) / J,
        ]
        rows.append([*_place(a, u, exact), J, *stress])
    return rows


def _row(a: Arguments, u: Vector, at: Point, F: Vector) -> Vector:
    return [*_place(a, u, at), material.determinant(F), *material.cauchy(F, *a.parameters)]


def _place(a: Arguments, u: Vector, at: Point) -> Vector:
    return [at.mean(a.X, k) + at.mean(u, k) for k in (0, 1)]
