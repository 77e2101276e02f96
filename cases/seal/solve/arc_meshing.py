"""Meshing of the arc: places of its nodes and of its ends, for a contact and for a film.

Of a contact the mesh is fine at the edges. There `solve.inlet` has a length of the film for every
speed, which is as K^(-6/5). So segments that are as K^(-6/5) at the edges, and grow with the
distance from them, resolve every speed, and one mesh serves both strokes.

A film says what contact cannot: a groove between two lobes has a pressure of its own, a lip is
pulled down by suction, an instroke drags its inlet along the arc. Its mesh is fine where h or p
changes.
"""

from __future__ import annotations

from math import ceil

import numpy as np
from scipy.integrate import cumulative_trapezoid

from softehl.cases.seal.equations.definition import BORE, ROD
from softehl.cases.seal.equations.system import SealSystem
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records import Gland
from softehl.cases.seal.meshing.spacing import STATIONS, Spacing, Spot, graded
from softehl.cases.seal.section.layout import RATE, Layout, uniform_layout
from softehl.cases.seal.solve.inlet import film_thickness
from softehl.cases.seal.states.contacts import contact_edges
from softehl.cases.seal.states.mesh_indicators import INLET
from softehl.cases.seal.states.section_view import film_pressure
from softehl.runtime.arrays import Array, Integers

COARSEST, COARSEST_OF_FILM = 18, 24
"""An arc is at least as many of its longest segments long at density 2: for contact, for a film."""

CYCLES = 3
"""Meshes that are made, at most, for a contact, for a film, for the coarser one of its estimate."""

DENSITY, _THIRDS = 2, 3
"""Density that the sizes are for; others divide or join segments. Segments at density 1 are a
multiple of three, because meshes exist for thirds of a density."""

REACH, FILMS = 0.15, 60.0
"""The arc that the contact places ends where the gap is this wide, mm, or so many films."""

STEEPEST, STEEPEST_NARROW = 55.0, 68.0
"""Or where the surface is this steep, degrees: beyond it is no film. The second where the gap is
narrower there than half of those films: without it films of 40 um lack 2 % of their friction."""

NO_WIDTH = 1e-6
"""Of the widest part of an arc, below which a part lies on a wall."""

THINNING, RISE = 0.3, 0.05
"""Changes along a segment at density 2: of ln h where the film is thin, of p over its maximum."""

DEPTH = 2.5
"""Elements below the arc are nowhere thicker than so many of its shortest segments: with ten h* was
two per cent too small, with half as many as this it changes by 0.2 %."""

_CLOSED = 1e-3  # of that thickness: rough surfaces may interpenetrate


def contact_layout(system: SealSystem, x: Array, p: Seal) -> Layout:
    """The layout of a case for the contact state x (n,) on another mesh.

    Segments stay equal where the contact is too small to have edges.
    """
    edges, layout = contact_edges(system, x), uniform_layout(p)
    if p.given_arc is None:
        layout = _placed(system, x, layout)
    if p.mesh != "graded" or not edges:
        return layout
    begin, length = layout.film[0], layout.film[1] - layout.film[0]
    begin -= system.section.layout.film[0]
    steepest = max(edge.rise for edge in edges)
    spots = [
        Spot(min(max(edge.position - begin, 0.0), length), (edge.rise / steepest) ** -0.6)
        for edge in edges
    ]
    first = np.inf
    if p.opens:
        spots.append(_edge_spot(system, x, p, (begin, begin + length)))
        first = spots[-1].maximum
    spacing = graded(length, spots, layout.long * DENSITY, coarsest=length / COARSEST, rate=RATE)
    return layout.graded(spacing, layout.long, first=first)


def on_wall(system: SealSystem, x: Array) -> bool:
    """True if the arc in the contact state x (n,) goes up a wall, where a film has no length."""
    widths = np.diff(system.arc_film(x)[0])
    return bool(widths.min() <= NO_WIDTH * widths.max())


def _placed(system: SealSystem, x: Array, layout: Layout) -> Layout:
    """The layout with an arc that reaches as far as a film may matter in the contact state x."""
    seen, p = system.section.layout, system.parameters
    arc_ends = _way_out(system, x, 0), _way_out(system, x, 1)
    sealed = seen.with_sealed_ends(
        system.mesh,
        rod=system.pressing(ROD, x),
        housing=system.pressing(BORE, x),
        p_s=p.sealed_pressure,
    )
    return layout.between(sealed, arc_ends)


def _edge_spot(system: SealSystem, x: Array, p: Gland, arc_bounds: tuple[float, float]) -> Spot:
    """Place at which the section meets the edge of the gap, on an arc between `arc_bounds`, mm."""
    nodes = system.mesh.arc_nodes
    centre = np.array([p.air_wall, 0.5 * p.rod_diameter])
    centre += p.corner_fillet + np.array([0.0, p.extrusion_gap])
    away = np.linalg.norm(system.deformed(x)[nodes] - centre, axis=1)
    position = system.section.positions[int(np.argmin(away))]
    fine = 0.25 * p.corner_fillet
    return Spot(min(position, arc_bounds[1]) - arc_bounds[0], np.inf, maximum=fine)


def _way_out(system: SealSystem, x: Array, side: int) -> float:
    """Place on the arc (mm) of an end of the film: side 0 the sealed, 1 the air end."""
    p, s = system.parameters, system.section.positions
    z, h = system.arc_film(x)
    touching = np.flatnonzero(system.pressing(ROD, x) > 0.0)
    if not len(touching):
        return float(s[-side])
    if side == 0:
        z, h, s, first = -z[::-1], h[::-1], s[::-1], len(s) - 1 - touching[0]
    else:
        first = touching[-1]
    films = FILMS * film_thickness(p, contact_edges(system, x), max(p.speeds))
    reach = max(REACH, films)
    steep = np.degrees(np.arctan2(np.diff(h), np.diff(z)))
    for i in range(first, len(s) - 1):
        if steep[i] >= (STEEPEST_NARROW if h[i] < 0.5 * films else STEEPEST):
            # on a coarse mesh next to the contact, which the arc has to contain
            return float(s[max(i, first + 1)])
        if h[i + 1] >= reach:
            return float(np.interp(reach, h[i : i + 2], s[i : i + 2]))
    return float(s[-1])


def film_layout(system: SealSystem, x: Array, thickness: float) -> Layout:
    """The layout of a mesh for a film x (n,), also of one that is not steady yet.

    Its mesh is nowhere coarser: what is carried from one to the next then hardly changes.
    thickness: of the film at its inlet, mm, near enough.
    """
    s, size = sizes(system, x, thickness)
    at, long_before = system.section.positions, system.section.layout.long
    previous = np.diff(at) * system.mesh.arc / (long_before * DENSITY)
    size = np.minimum(size, previous[_segments(at, s)])
    index = _index(s, size)
    long = _THIRDS * ceil(index[-1] / (DENSITY * _THIRDS))
    layout = system.section.layout
    return layout.graded(Spacing.of(s, index), long, DEPTH * float(size.min()))


def misfit(system: SealSystem, x: Array, thickness: float) -> float:
    """Largest number of segments that a film x (n,) asks for in the place of one of its mesh."""
    s, size = sizes(system, x, thickness)
    segments_needed = np.diff(np.interp(system.section.positions, s, _index(s, size)))
    return float(segments_needed.max()) * float(system.section.density) / DENSITY


def _index(s: Array, size: Array) -> Array:
    """Number of segments (n,) from the beginning of the arc to places s (n,)."""
    return np.asarray(cumulative_trapezoid(1.0 / size, s, initial=0))


def sizes(system: SealSystem, x: Array, thickness: float) -> tuple[Array, Array]:
    """Places (n,) along the arc, mm, and lengths (n,) of the segments there, at density 2."""
    at, (_, h), p = system.section.positions, system.arc_film(x), film_pressure(system, x)
    dx = np.diff(at)
    log_h = np.log(np.maximum(h, _CLOSED * thickness))
    slope_h = np.abs(np.diff(log_h)) / dx
    slope_h[np.minimum(h[:-1], h[1:]) > INLET[0] * thickness] = 0.0  # too thick to decide
    slope_p = np.abs(np.diff(p)) / dx
    density_needed = np.maximum(slope_h / THINNING, slope_p / (RISE * np.abs(p).max()))
    longest = at[-1] / COARSEST_OF_FILM
    segment = np.minimum(1.0 / np.maximum(density_needed, 1e-12), longest)
    s = np.linspace(0.0, at[-1], STATIONS)
    lengths = segment[_segments(at, s)]
    step = RATE * (s[1] - s[0])
    for direction in (
        slice(None),
        slice(None, None, -1),
    ):  # no faster growth than RATE on either side
        offset = step * np.arange(STATIONS)
        lengths[direction] = np.minimum.accumulate(lengths[direction] - offset) + offset
    return s, lengths


def _segments(at: Array, s: Array) -> Integers:
    """Numbers (n,) of the segments between nodes at places (m,) that hold the places s (n,)."""
    return np.clip(np.searchsorted(at, s, side="right") - 1, 0, len(at) - 2)
