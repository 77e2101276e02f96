"""Films with void fraction, moving surface, squeeze, flow factors and asperities (physics of
docs/film-physics.md), written down once more with mpmath.

Unknowns: u_z1 u_r1 u_z2 u_r2, pressures and then void fractions at the Gauss-Lobatto-Legendre
points. F_3/2 is a parabolic cylinder function here, flow factors are the published formulas.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

from tests.reference.differentiate import PI, Arguments, Matrix, Number, Vector, mp, mpf
from tests.reference.rheology import thinned
from tests.reference.rules import gauss, lagrange, lobatto
from tests.reference.upwind import bubble_load


def effective(H: Number) -> Number:
    """h / sigma of flow and shear."""
    return H if mpf(1) / 2 <= H else 1 / (4 - 4 * H)


def mean_gap(H: Number) -> Number:
    """E max(H + s, 0) of a normal variable s: H P(s > -H) + density(H)."""
    return H * mp.ncdf(H) + mp.npdf(H)


def asperities(H: Number, order: Number = 1.5) -> Number:
    """Greenwood's F_n(H)."""
    order = mpf(order)
    cylinder = mp.pcfd(-order - 1, H)
    return mp.gamma(order + 1) / mp.sqrt(2 * PI) * mp.exp(-(H**2) / 4) * cylinder


def phi_p(H: Number) -> Number:
    """Pressure flow."""
    return 1 - mpf(9) / 10 * mp.exp(-mpf(56) / 100 * H)


def phi_s(H: Number) -> Number:
    """Shear flow, its far end joined to the fit at 5."""
    if H > 5:
        return phi_s(mpf(5)) * mp.exp(-(H - 5) / 4)
    power = H ** (mpf(98) / 100)
    return mpf(1899) / 1000 * power * mp.exp(-mpf(92) / 100 * H + H**2 * 5 / 100)


def phi_f(H: Number) -> Number:
    """Mean of h / (h + s) over heights of density 35/32 (1 - s^2)^3, cut at 3 sigma / 100."""
    z = H / 3
    cubic = (1 - z**2) ** 3
    if z > 1:
        rest = z / 15 * (66 + z**2 * (30 * z**2 - 80))
        return 35 * z / 32 * (cubic * mp.log((z + 1) / (z - 1)) + rest)
    terms = (-55, 132, 345, -160, -405, 60, 147)
    rest = sum(c * z**k for k, c in enumerate(terms)) / 60
    return 35 * z / 32 * (cubic * mp.log(300 * (z + 1)) + rest)


def phi_fs(H: Number) -> Number:
    """Shear stress by the difference of the surfaces, its far end joined to the fit at 5."""
    if H > 5:
        return phi_fs(mpf(5)) * mp.exp(-mpf(818) / 1000 * (H - 5))
    power = H ** (mpf(231) / 100)
    return mpf(111) / 10 * power * mp.exp(-mpf(238) / 100 * H + H**2 * 11 / 100)


def phi_fp(H: Number) -> Number:
    """Shear stress by the pressure gradient."""
    return 1 - mpf(14) / 10 * mp.exp(-mpf(66) / 100 * H)


@dataclass(frozen=True)
class Place:
    """A point of the segment: where it is, its subcell, and the film there."""

    shapes: tuple[Number, Number]
    cell: int
    ends: tuple[Number, Number]
    xi: Number
    z_xi: Number
    hats: tuple[Number, Number]
    width: Number
    dx: Number
    weight: Number
    x: Number
    r: Number
    h: Number
    w: Number


Words = dict[str, Number]


def places(arguments: Arguments, dofs: Vector, given: Words) -> Iterator[Place]:
    """Two Gauss points on every subcell; `ends` are thicknesses at those of the subcell."""
    z1, r1, z2, r2 = (arguments.X[i] + dofs[i] for i in range(4))
    nodes = lobatto(len(dofs[4:]) // 2)[0]
    gaps = [(1 - x) / 2 * r1 + (1 + x) / 2 * r2 - given["rod_radius"] for x in nodes]
    w = [given["rate"] * dofs[2 * k] + arguments.data[k] for k in (0, 1)]
    for cell, (a, b) in enumerate(pairwise(nodes)):
        for point, weight in zip(*gauss(2), strict=True):
            xi = (a + b) / 2 + (b - a) / 2 * point
            one, two = (1 - xi) / 2, (1 + xi) / 2
            r, own = one * r1 + two * r2, weight * (b - a) / 2
            yield Place(
                *((one, two), cell, (gaps[cell], gaps[cell + 1]), xi, (z2 - z1) / 2),
                *(((b - xi) / (b - a), (xi - a) / (b - a)),),
                *((b - a) * (z2 - z1) / 2, own * (z2 - z1) / 2, own),
                *(one * z1 + two * z2, r, r - given["rod_radius"], one * w[0] + two * w[1]),
            )


@dataclass(frozen=True)
class Film:
    """What flows and rubs at a place."""

    p: Number
    slope: Number
    flux: Number
    tau: Number
    tau_rod: Number
    p_a: Number
    tau_a: Number
    h_T: Number
    eta: Number
    rest: tuple[Number, ...]  # void fractions at the ends; driving where the oil thins


def film_at(at: Place, dofs: Vector, given: Words, rough: bool) -> Film:
    """Flux and stresses; void fractions come from where the oil comes from.

    The flux has the means of h^-2 and h^-3 over the wedge of the subcell, as far as its pressure
    goes; stresses and load have the polynomial.
    """
    half = len(dofs[4:]) // 2
    p_ends = dofs[4 + at.cell : 6 + at.cell]
    void = dofs[4 + half + at.cell], dofs[4 + half + at.cell + 1]
    p_cell, slope_cell = mp.fdot(at.hats, p_ends), (p_ends[1] - p_ends[0]) / at.width
    shapes = lagrange(lobatto(half)[0], at.xi)
    p, slope = (mp.fdot(s, dofs[4 : 4 + half]) for s in shapes)
    slope /= at.z_xi
    V = given["rod_speed"] - at.w
    full = 1 - (void[0] if V > 0 else void[1])
    eta, eta_cell = (
        given["viscosity"] * mp.exp(given["pressure_viscosity"] * v) for v in (p, p_cell)
    )
    sigma = given["roughness"] if rough else mpf(1)
    a, b = (sigma * effective(g / sigma) if rough else g for g in at.ends)
    mean_2, mean_3 = 1 / (a * b), (a + b) / 2 / (a * b) ** 2
    if not rough:
        carried = at.h * mean_2 / mean_3 / ((a + b) / 2)
        how = [given[name] for name in THINNING if name in given]
        _, driving_cell = thinned(V, (a + b) / 2, eta_cell, slope_cell, how)
        q = V / 2 * full * carried - driving_cell / (12 * eta_cell * mean_3)
        middle, driving = thinned(V, at.h, eta, slope, how)
        drag, back = middle * full, at.h / 2 * slope
        zero, more = mpf(0), (driving,) if how else ()
        return Film(p, slope, q, drag - back, drag + back, zero, zero, at.h, eta, (*void, *more))
    c = given["roughness_difference"]
    H = at.h / sigma
    E = effective(H)
    h_T, h_e = sigma * mean_gap(H), sigma * E
    carried = (h_T + c * sigma * phi_s(E)) * mean_2 / mean_3 / ((a + b) / 2)
    q = V / 2 * full * carried - phi_p(E) * slope_cell / (12 * eta_cell * mean_3)
    p_a = given["asperity_stiffness"] * asperities(H)
    tau_a = given["boundary_friction"] * p_a * V / mp.hypot(V, given["boundary_speed"])
    drag = eta * V / h_e * (phi_f(E) + c * phi_fs(E)) * full
    back = phi_fp(E) * h_e / 2 * slope
    tau, tau_rod = drag - back + tau_a, drag + back + tau_a
    return Film(p, slope, q, tau, tau_rod, p_a, tau_a, h_T, eta, void)


SEGMENT = (
    *("rod_radius", "rod_speed", "viscosity", "pressure_viscosity"),
    *("force_weight", "shear_weight", "rate"),
)
THINNING = ("critical_stress", "thinning_exponent", "thinning_plateau")
ROUGH = (
    *(*SEGMENT, "roughness", "roughness_difference"),
    *("asperity_stiffness", "boundary_friction", "boundary_speed"),
)


def _given(parameters: Sequence[Number], rough: bool) -> Words:
    """Parameters by their names: those of an oil that thins stand before the rate."""
    names: tuple[str, ...] = SEGMENT
    if more := 0 if rough else len(parameters) - len(SEGMENT):
        names = *SEGMENT[:-1], *THINNING[:more], *SEGMENT[-1:]
    return dict(zip(ROUGH if rough else names, parameters, strict=True))


def residual_film(a: Arguments, dofs: Vector, rough: bool) -> Vector:
    """Forces on the nodes (N), then a row for every pressure; none for the void fractions."""
    given = _given(a.parameters, rough)
    half = len(dofs[4:]) // 2
    forces, rows = [mpf(0)] * 4, [mpf(0)] * (2 * half)
    dz, dr = (a.X[2 + k] + dofs[2 + k] - a.X[k] - dofs[k] for k in (0, 1))
    for at in places(a, dofs, given):
        film = film_at(at, dofs, given, rough)
        ring = 2 * PI * at.r * given["force_weight"] * at.weight / 2
        load, drag = film.p + film.p_a, given["shear_weight"] * film.tau * mp.hypot(dz, dr)
        for node, shape in enumerate(at.shapes):
            forces[2 * node] += ring * shape * (load * dr - drag)
            forces[2 * node + 1] -= ring * shape * load * dz
        for end, sign in ((0, -1), (1, 1)):
            rows[at.cell + end] += sign * film.flux * at.dx / at.width
    return forces + rows


def fields_film(a: Arguments, dofs: Vector, rough: bool) -> Matrix:
    """x dx h p tau flux tau_rod eta h_T p_a tau_a v_out v_in at the points; see Film.rest."""
    given = _given(a.parameters, rough)
    found = []
    for at in places(a, dofs, given):
        f = film_at(at, dofs, given, rough)
        known = [at.x, at.dx, at.h, f.p, f.tau, f.flux, f.tau_rod, f.eta, f.h_T, f.p_a, f.tau_a]
        found.append([*known, *f.rest])
    return found


def residual_void(arguments: Arguments, dofs: Vector) -> Vector:
    """Fischer and Burmeister, as it is printed; 1e-30 is less than the rounding of a kernel."""
    p_c, p_ref, v_ref = arguments.parameters
    a, b = (dofs[0] - p_c) / p_ref, dofs[1] / v_ref
    return [mpf(0), a + b - mp.sqrt(a**2 + b**2)]


def contents(
    a: Arguments, dofs: Vector, rough: bool
) -> Iterator[tuple[Number, Number, Number, Number]]:
    """At each pressure: half the lengths of its subcells, slope z', h_T and content h_T v z'."""
    half = len(dofs[4:]) // 2
    nodes = lobatto(half)[0]
    z1, r1, z2, r2 = (a.X[i] + dofs[i] for i in range(4))
    for i, xi in enumerate(nodes):
        h = (1 - xi) / 2 * r1 + (1 + xi) / 2 * r2 - a.parameters[0]
        h_T = a.parameters[2] * mean_gap(h / a.parameters[2]) if rough else h
        length = (nodes[min(i + 1, half - 1)] - nodes[max(i - 1, 0)]) / 2
        slope = (z2 - z1) / 2
        yield length, slope, h_T, h_T * (1 - dofs[4 + half + i]) * slope


def residual_squeeze(a: Arguments, dofs: Vector, rough: bool) -> Vector:
    """data: rate of the contents of the steps before, one for every pressure."""
    rows = [
        -length * (a.parameters[1] * content + rest)
        for (length, _, _, content), rest in zip(contents(a, dofs, rough), a.data, strict=True)
    ]
    return [mpf(0)] * 4 + rows + [mpf(0)] * len(rows)


def fields_squeeze(a: Arguments, dofs: Vector, rough: bool) -> Matrix:
    """content dx v h_T at the pressures."""
    n = len(dofs[4:]) // 2
    found = contents(a, dofs, rough)
    return [
        [content, length * slope, dofs[4 + n + i], h_T]
        for i, (length, slope, h_T, content) in enumerate(found)
    ]


def residual_upwind(a: Arguments, dofs: Vector) -> Vector:
    """`tests.reference.upwind` with sigma Hp(h_m / sigma) for h_m."""
    sigma, rod_radius, speed, viscosity, shear_modulus, strength, force_weight = a.parameters
    z1, r1, z2, r2 = (a.X[i] + dofs[i] for i in range(4))
    h = sigma * effective(((r1 + r2) / 2 - rod_radius) / sigma)
    peclet = 3 * viscosity * abs(speed) / 2 * (z2 - z1) ** 2 / (PI * shear_modulus * h**3)
    widening = 5 * (r2 - r1) / h
    weight = 1 / (1 + widening**2) if speed * widening > 0 else mpf(1)
    delta = weight * peclet**2 / (9 + peclet**2)
    moved = force_weight * strength * delta / 2 * bubble_load(a.X, dofs, dofs[4:])
    return [mpf(0), -moved, mpf(0), moved] + [mpf(0)] * (len(dofs) - 4)


CONSERVING = ("film_conserving", "film_conserving_eyring", "film_conserving_carreau")

RESIDUALS: dict[str, Callable[[Arguments, Vector], Vector]] = {
    **{name: partial(residual_film, rough=False) for name in CONSERVING},
    "film_rough": partial(residual_film, rough=True),
    "film_void": residual_void,
    "film_squeeze": partial(residual_squeeze, rough=False),
    "film_squeeze_rough": partial(residual_squeeze, rough=True),
    "film_upwind_rough": residual_upwind,
}
FIELDS: dict[str, Callable[[Arguments, Vector], Matrix]] = {
    **{name: partial(fields_film, rough=False) for name in CONSERVING},
    "film_rough": partial(fields_film, rough=True),
    "film_squeeze": partial(fields_squeeze, rough=False),
    "film_squeeze_rough": partial(fields_squeeze, rough=True),
}
