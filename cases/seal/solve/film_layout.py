"""Places of the nodes of the arc for a known film: close together where h or p changes.

The film says what contact cannot: a groove between two lobes has a pressure of its own, a lip is
pulled down by suction, an instroke drags its inlet along the arc.
"""

from __future__ import annotations

from math import ceil

import numpy as np
from scipy.integrate import cumulative_trapezoid

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.section.layout import Layout
from softehl.cases.seal.solve.contact_layout import RATE
from softehl.cases.seal.states.film_signs import INLET
from softehl.cases.seal.states.section_view import film_pressure
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mesh.spacing import STATIONS, Spacing

THINNING, RISE = 0.3, 0.05
"""Changes along a segment at density 2: of ln h where the film is thin, of p over its maximum."""

THIN = INLET[0]
"""Film, of that at the inlet, from which on its thickness does not decide about the segments."""

COARSEST = 24
"""The arc is so many of its longest segments long."""

DEPTH = 2.5
"""Elements below the arc are nowhere thicker than so many of its shortest segments: with ten h* was
two per cent too small, with half as many as this it changes by 0.2 %."""

_CLOSED = 1e-3  # of that thickness: rough surfaces may interpenetrate
_DENSITY, _THIRDS = 2, 3
"""Density that the sizes are for; segments at density 1 are a multiple of three, because meshes
exist for thirds of a density."""


def film_layout(system: SealSystem, x: Array, thickness: float) -> Layout:
    """The layout of a mesh for a film x (n,), also of one that is not steady yet.

    Its mesh is nowhere coarser: what is carried from one to the next then hardly changes.
    thickness: of the film at its inlet, mm, near enough.
    """
    s, size = sizes(system, x, thickness)
    at, long_before = system.section.places, system.section.layout.long
    before = np.diff(at) * system.mesh.arc / (long_before * _DENSITY)
    size = np.minimum(size, before[_segments(at, s)])
    index = _index(s, size)
    long = _THIRDS * ceil(index[-1] / (_DENSITY * _THIRDS))
    layout = system.section.layout
    return layout.graded(Spacing.of(s, index), long, DEPTH * float(size.min()))


def misfit(system: SealSystem, x: Array, thickness: float, density: float) -> float:
    """Largest number of segments that a film x (n,) asks for in the place of one of its mesh."""
    s, size = sizes(system, x, thickness)
    wanted = np.diff(np.interp(system.section.places, s, _index(s, size)))
    return float(wanted.max()) * density / _DENSITY


def _index(s: Array, size: Array) -> Array:
    """Number of segments (n,) from the beginning of the arc to places s (n,)."""
    return np.asarray(cumulative_trapezoid(1.0 / size, s, initial=0))


def sizes(system: SealSystem, x: Array, thickness: float) -> tuple[Array, Array]:
    """Places (n,) along the arc, mm, and lengths (n,) of the segments there, at density 2."""
    at, (_, h), p = system.section.places, system.arc_film(x), film_pressure(system, x)
    dx = np.diff(at)
    log_h = np.log(np.maximum(h, _CLOSED * thickness))
    slope_h = np.abs(np.diff(log_h)) / dx
    slope_h[np.minimum(h[:-1], h[1:]) > THIN * thickness] = 0.0
    slope_p = np.abs(np.diff(p)) / dx
    wanted = np.maximum(slope_h / THINNING, slope_p / (RISE * np.abs(p).max()))
    longest = at[-1] / COARSEST
    segment = np.minimum(1.0 / np.maximum(wanted, 1e-12), longest)
    s = np.linspace(0.0, at[-1], STATIONS)
    there = segment[_segments(at, s)]
    step = RATE * (s[1] - s[0])
    for way in (slice(None), slice(None, None, -1)):  # no faster growth than RATE on either side
        place = step * np.arange(STATIONS)
        there[way] = np.minimum.accumulate(there[way] - place) + place
    return s, there


def _segments(at: Array, s: Array) -> Integers:
    """Numbers (n,) of the segments between nodes at places (m,) that hold the places s (n,)."""
    return np.clip(np.searchsorted(at, s, side="right") - 1, 0, len(at) - 2)
