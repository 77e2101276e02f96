"""Mesh indicators of a film: inlet, ends of the arc and the oil beyond them, oscillations.

An inlet may be longer than the part of a section that can have a film, behind the tip of a lip or
on a given arc. The gap before the arc is that of the deformed section, and (14) holds there too.
Its pressure is small and hardly deforms the section; the film begins with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, radians, tan

import numpy as np

from softehl.cases.seal.equations.loads import FilmLoads, Stroke
from softehl.cases.seal.equations.system import SealSystem
from softehl.cases.seal.states.contacts import CONTACT_FILM
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.postprocessing import (
    alternating_difference,
    first_below,
    interval_below,
)

EXIT_SLOPE = 40.0
"""Slope beyond which a film has ended, degrees: the corner of a flat, the heel of a cup. From 20 to
70 the verdicts on films of an X-ring, a U-cup and a square ring are the same."""

INLET = (10.0, 1.5)
"""Film thicknesses, in h*, between which the segments of the inlet are counted."""

THIN = 100.0
"""Films, h*, that count as contact where oscillations are looked for, if less than 20 um: those of
a film of 30 nm end far beyond the dip at its exit, which then is within the mid contact. Films of
0.2 um and more have the same index with 30 or 1000."""

MID_CONTACT = 0.1
"""Share of the contact that is left out at either end where oscillations are looked for."""


def wedge(system: SealSystem, stroke: Stroke, x: Array) -> tuple[Array, Array]:
    """Way and gap (n,), mm, from the end of the film x (n,) at which a stroke has its inlet.

    As far as the surface faces the rod and leaves it; a step of no length where it turns away at
    once, as one that is pressed against a wall.
    """
    loop, out = system.deformed(x)[system.mesh.boundary], stroke == "out"
    z, r = (np.concatenate([loop[:1], loop[:0:-1]]) if out else loop[system.mesh.arc :]).T
    distance, gap = (z[0] - z if out else z - z[0]), r - system.rod_radius
    return facing(distance, gap)


def facing(distance: Array, gap: Array) -> tuple[Array, Array]:
    """The part of a surface (n,) that faces the rod and leaves it, from its first node on."""
    turns, narrows = np.diff(distance) <= 0.0, np.diff(gap) <= 0.0
    if turns[0] and not narrows[0]:
        return distance[[0, 0]], gap[:2]
    stops = np.flatnonzero(turns | narrows)
    last = int(stops[0]) + 1 if len(stops) else len(distance)
    return distance[:last], gap[:last]


def built_up(distance: Array, gap: Array, flow: float, h_star: float) -> float:
    """Pressure (MPa) at the narrow end of a wedge; inf where the gap does not widen.

    flow: eta |U|, N/mm. The integral of 6 eta U (h - h*) / h^3, exact between straight parts.
    """
    if len(distance) < 2:
        return np.inf
    a, b = gap[:-1], gap[1:]
    parts = np.diff(distance) * (1.0 / (a * b) - 0.5 * h_star * (a + b) / (a * b) ** 2)
    return float(6.0 * flow * parts.sum())


def wedge_friction(
    system: SealSystem, distance: Array, gap: Array, flow: float, h_star: float
) -> tuple[float, float]:
    """Friction (N) on the rod below a wedge against its motion: of the sliding alone, and in all.

    The integrals of eta U / h and of eta U (4 / h - 3 h* / h^2), as `built_up`.
    """
    a, b = gap[:-1], gap[1:]
    inverse = float((np.diff(distance) * np.log(b / a) / (b - a)).sum())
    square = float((np.diff(distance) / (a * b)).sum())
    around = system.around * flow
    return around * inverse, around * (4.0 * inverse - 3.0 * h_star * square)


def end_gap(z: Array, h: Array) -> float:
    """Film thickness at the exit of the arc, mm; inf where the surface is too steep for a film.

    z, h: (nodes,) towards the exit.
    """
    steep = h[-1] - h[-2] > tan(radians(EXIT_SLOPE)) * (z[-1] - z[-2])  # also straight up
    return inf if steep else float(h[-1])


def lacking(at: Mapping[str, Array], film: FilmLoads, entrance: float) -> float:
    """Share of an inlet's pressure that its film lacks, as it is built up before the arc begins.

    at: fields of the film. entrance: what the wedge there builds up, MPa. The pressure of an inlet
    is that at its steepest rise, in excess of the pressure outside.
    """
    steepest = _steepest(at, film)
    if steepest is None:
        return inf
    outside = film.along(at["p"].ravel())[0] - film.entrance
    inlet = float(at["p"].ravel()[steepest] - outside)
    return abs(entrance - film.entrance) / inlet if inlet > 0.0 else inf


def _steepest(at: Mapping[str, Array], film: FilmLoads) -> int | None:
    """Place in the inlet at which the pressure rises most steeply, None if it does not rise."""
    x, p, slope = at["x"].ravel(), at["p"].ravel(), _slope(at).ravel()
    top = x[np.argmax(p)]
    inlet = x < top if film.rod_speed > 0.0 else x > top
    rise = np.where(inlet, np.copysign(1.0, film.rod_speed) * slope, -np.inf)
    steepest = int(np.argmax(rise))
    return steepest if rise[steepest] > 0.0 else None


def _slope(at: Mapping[str, Array]) -> Array:
    """p' at the points, MPa/mm; of an oil that thins that of a Newtonian one of the same flux."""
    return at["driving"] if "driving" in at else (at["tau_rod"] - at["tau"]) / at["h"]


def inlet_ratio(at: Mapping[str, Array], film: FilmLoads, h_star: float) -> float:
    """h* over sqrt(8 eta |U| / (9 p')), p' the steepest rise of the pressure in the inlet.

    at: fields of the film, (segments, points) each. By (14) p' = 6 eta U (h - h*) / h^3. This is
    largest at h = 3/2 h*, so that the ratio is 1 where the mesh shows the inlet.
    """
    steepest = _steepest(at, film)
    if steepest is None:
        return np.nan
    eta = at["eta"].ravel()[steepest]
    rise = abs(_slope(at).ravel()[steepest])
    return float(h_star / np.sqrt(8.0 * eta * film.speed / (9.0 * rise)))


def oscillation(x: Array, h: Array, level: float = CONTACT_FILM) -> float:
    """Oscillation index of the nodal film thickness h (nodes,) at x (nodes,), dimensionless.

    The largest alternating second difference D_i = h_(i-1) - 2 h_i + h_(i+1) over the mid contact,
    relative to the median of h there. Neighbours D_i, D_(i+1) of opposite sign count with the
    smaller of |D_i|, |D_(i+1)|. A zigzag of amplitude a about h has the index 4 a / h, a
    smooth film next to none. The mid contact is the middle four fifths of where h is below the
    level, mm: that of `contact_film`, or `THIN` films.
    """
    start, end = interval_below(x, h, level)
    margin = MID_CONTACT * (end - start)
    inside = h[(x >= start + margin) & (x <= end - margin)]
    return alternating_difference(inside) / float(np.median(inside)) if len(inside) else 0.0


def inlet_segments(h: Array, h_star: float) -> float:
    """Length of the inlet in segments; h (nodes,) from the inlet on.

    From where h, coming from outside, first falls below ten times h* to where it first falls below
    one and a half times h*: there the pressure rises that makes the film.
    """
    outer, inner = (first_below(h, level * h_star) for level in INLET)
    return inner - outer
