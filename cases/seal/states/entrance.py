"""The wedge of oil before an arc that begins within its film, and the pressure it has built up.

An inlet may be longer than the part of a section that can have a film, behind the tip of a lip or
on a given arc. The gap before the arc is that of the deformed section, and (14) holds there too.
Its pressure is small and hardly deforms the section; the film begins with it.
"""

from __future__ import annotations

import numpy as np

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.loads import Stroke
from softehl.runtime.arrays import Array


def wedge(system: SealSystem, stroke: Stroke, x: Array) -> tuple[Array, Array]:
    """Way and gap (n,), mm, from the end of the film x (n,) at which a stroke has its inlet.

    As far as the surface faces the rod and leaves it; a step of no length where it turns away at
    once, as one that is pressed against a wall.
    """
    loop, out = system.deformed(x)[system.mesh.boundary], stroke == "out"
    z, r = (np.concatenate([loop[:1], loop[:0:-1]]) if out else loop[system.mesh.arc :]).T
    way, gap = (z[0] - z if out else z - z[0]), r - system.rod_radius
    return facing(way, gap)


def facing(way: Array, gap: Array) -> tuple[Array, Array]:
    """The part of a surface (n,) that faces the rod and leaves it, from its first node on."""
    turns, narrows = np.diff(way) <= 0.0, np.diff(gap) <= 0.0
    if turns[0] and not narrows[0]:
        return way[[0, 0]], gap[:2]
    ends = np.flatnonzero(turns | narrows)
    last = int(ends[0]) + 1 if len(ends) else len(way)
    return way[:last], gap[:last]


def built_up(way: Array, gap: Array, flow: float, h_star: float) -> float:
    """Pressure (MPa) at the narrow end of a wedge; inf where the gap does not widen.

    flow: eta |U|, N/mm. The integral of 6 eta U (h - h*) / h^3, exact between straight parts.
    """
    if len(way) < 2:
        return np.inf
    a, b = gap[:-1], gap[1:]
    parts = np.diff(way) * (1.0 / (a * b) - 0.5 * h_star * (a + b) / (a * b) ** 2)
    return float(6.0 * flow * parts.sum())


def wedge_friction(
    system: SealSystem, way: Array, gap: Array, flow: float, h_star: float
) -> tuple[float, float]:
    """Friction (N) on the rod below a wedge against its motion: of the sliding alone, and in all.

    The integrals of eta U / h and of eta U (4 / h - 3 h* / h^2), as `built_up`.
    """
    a, b = gap[:-1], gap[1:]
    inverse = float((np.diff(way) * np.log(b / a) / (b - a)).sum())
    square = float((np.diff(way) / (a * b)).sum())
    around = system.around * flow
    return around * inverse, around * (4.0 * inverse - 3.0 * h_star * square)
