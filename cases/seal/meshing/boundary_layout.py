"""Nodes along an outline, and the largest thickness of the strip of layers along it.

Both follow from the largest ball that touches the outline at a place, inside and outside: segments
and strip are small where the section or a mouth is narrow.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise
from math import ceil, radians

import numpy as np
from scipy.integrate import cumulative_trapezoid

from softehl.cases.seal.meshing.outline import Outline
from softehl.cases.seal.meshing.spacing import Spacing
from softehl.runtime.arrays import Array

AROUND = 60
"""The outline is at least so many of its longest segments long, at density 1."""

DEPTH = 0.035
"""Thickness of the strip, in twice the area over the length of the outline (radius of a disc)."""

SMOOTH = 0.02
"""Normals are means over at least so much of the outline to either side, mm."""

# On an X-ring and a U-cup h* changes by 0.35 % at most with half or twice of DEPTH, _RATE, _TURN
# and _SLOPE and with 40 to 90 AROUND, by 0.02 % with half or twice of _SHORTEST and _CLEAREST.
_RATE = 0.5  # growth of the segments outside the film with the distance from it, at density 1
_TURN = 0.4  # rad, by which the outline turns on a segment
_SHORTEST = 0.4  # of the film's last segments: no arc makes those beside it shorter
_PINNED = radians(15.0)  # a corner that turns by more has a node
_STATIONS = 720  # at which balls are looked for
_CLEAREST, _SLOPE = 0.3, 0.3  # thickness of the strip in the radius of the ball; its growth
_SEGMENT, _ACROSS = 0.5, 1.5  # segments in the radius of the ball inside, and outside
_STEPS = 27 * 64  # of the table of a spacing


@dataclass(frozen=True, eq=False)
class BoundaryLayout:
    """Nodes of the boundary for every density.

    parts: begin and end of each part of the outline, rising from the start of the film on, its
    spacing and number of segments at density 1; the film is the first. reach: (stations,) radius
    of the largest ball inside that touches the outline at equal distances from s = 0 on.
    """

    outline: Outline
    parts: tuple[tuple[float, float, Spacing | None, int], ...]
    reach: Array

    @classmethod
    def of(
        cls,
        outline: Outline,
        film: tuple[float, float],
        spacing: Spacing | None,
        long: int,
        smallest: float = 0.0,
    ) -> BoundaryLayout:
        """With `long` segments at density 1 between the places of the film, None = equal ones.

        smallest: length at density 1, mm, below which no corner makes the others.
        """
        length, first = outline.length, film[0]
        last = first + (film[1] - first) % length
        reach = ball_radii(outline, 1.0)
        s = np.linspace(last, first + length, 4001)
        wide, end_sizes = (
            np.maximum(reach, smallest / _SEGMENT),
            _film_sizes(last - first, spacing, long),
        )
        size = _sizes(outline, s, wide, end_sizes)
        index = cumulative_trapezoid(1.0 / size, s, initial=0)
        corners = np.sort(first + (outline.corners(_PINNED) - first) % length)
        distance = 0.2 * length / AROUND
        corners = corners[(corners > last + distance) & (corners < first + length - distance)]
        parts = [(first, last, spacing, long)]
        for a, b in pairwise([last, *corners.tolist(), first + length]):
            begin, end = np.interp([a, b], s, index)
            # corners are at ends of the triangles' sides, which are two segments, at any density
            odd = 3 * (long % 2) if len(parts) == 1 else 0
            count = odd + 6 * max(1 - odd // 3, ceil((end - begin - odd) / 6 - 0.2))
            positions = np.interp(np.linspace(begin, end, _STEPS + 1), index, s)
            parts.append((a, b, Spacing((positions - a) / (b - a)), count))
        return cls(outline, tuple(parts), reach)

    def positions(self, density: Fraction) -> Array:
        """s of the boundary nodes, rising from the start of the film."""
        per_segment = []
        for a, b, spacing, count in self.parts:
            n = int(count * density)
            t = np.arange(n) / n
            per_segment.append(a + (b - a) * (spacing(t) if spacing else t))
        return np.concatenate(per_segment)

    def lengths(self, density: Fraction, s: Array) -> Array:
        """Lengths (n,) of the longer segment of this density at nodes at s, mm."""
        positions = self.positions(density)
        after = np.diff(np.append(positions, positions[0] + self.outline.length))
        longer = np.maximum(after, np.roll(after, 1))
        return np.asarray(np.interp(s, positions, longer, period=self.outline.length))

    def depth(self, s: Array) -> Array:
        """Thickness (n,) of the strip, mm."""
        length = self.outline.length
        local_depth = np.minimum(_usual_depth(self.outline), _CLEAREST * self.reach)
        stations = np.arange(_STATIONS) * length / _STATIONS
        distance = np.abs(s[:, None] - stations) % length
        distance = np.minimum(distance, length - distance)
        return np.asarray((local_depth + _SLOPE * distance).min(axis=1))


def _usual_depth(outline: Outline) -> float:
    return DEPTH * 2.0 * outline.area / outline.length


def _film_sizes(length: float, spacing: Spacing | None, long: int) -> tuple[float, float]:
    """Lengths of the first and the last segment of the film at density 1."""
    if spacing is None:
        return length / long, length / long
    at = spacing(np.array([1.0 / long, 1.0 - 1.0 / long]))
    return length * float(at[0]), length * float(1.0 - at[1])


def _sizes(outline: Outline, s: Array, reach: Array, film: tuple[float, float]) -> Array:
    """Lengths (n,) of segments at s, from the end of the film round to its start."""
    stations = np.arange(_STATIONS) * outline.length / _STATIONS
    clear = np.minimum(_SEGMENT * reach, _ACROSS * ball_radii(outline, -1.0))
    bend = np.abs(outline.curvature(s)) + 1e-9 / outline.length
    size = np.minimum(np.interp(s, stations, clear, period=outline.length), _TURN / bend)
    upper = np.minimum(film[1] + _RATE * (s - s[0]), film[0] + _RATE * (s[-1] - s))
    lower = np.maximum(film[1] - _RATE * (s - s[0]), film[0] - _RATE * (s[-1] - s))
    size = np.maximum(size, np.maximum(_SHORTEST * lower, 0.02 * outline.length / AROUND))
    size = np.minimum(np.minimum(size, upper), outline.length / AROUND)
    size = np.minimum.accumulate(size - _RATE * s) + _RATE * s
    return np.asarray(np.minimum.accumulate((size + _RATE * s)[::-1])[::-1] - _RATE * s)


def normals(outline: Outline, s: Array, over: Array | float) -> Array:
    """Inward unit normals (n, 2), across the chords between s - over and s + over."""
    chord = outline.at(s + over) - outline.at(s - over)
    chord /= np.linalg.norm(chord, axis=1)[:, None]
    return np.stack([-chord[:, 1], chord[:, 0]], axis=1)


@lru_cache(maxsize=8)
def ball_radii(outline: Outline, side: float) -> Array:
    """Radii (stations,) of the largest balls that touch the outline: inside (1) or outside (-1).

    Points within two strips along the outline do not count: corners stay blunt. Kept for the
    next mesh of the same outline, and not to be written into.
    """
    s = np.arange(_STATIONS) * outline.length / _STATIONS
    over = max(SMOOTH, _usual_depth(outline))
    x, n = outline.at(s), side * normals(outline, s, over)
    away = x[None] - x[:, None]
    inwards = (away * n[:, None]).sum(axis=2)
    distance = np.abs(s[:, None] - s)
    distance = np.minimum(distance, outline.length - distance)
    seen = (inwards > 1e-9) & (distance > 2.0 * over)
    radii = (away**2).sum(axis=2) / (2.0 * np.where(seen, inwards, 1.0))
    result = np.asarray(radii.min(axis=1, where=seen, initial=np.inf))
    result.flags.writeable = False
    return result
