"""Places where the mesh of a section is fine: both edges of its contact, and below them.

There `solve.inlet` has a length of the film for every speed, which is as K^(-6/5). So segments that
grow with the distance from the edges and are as K^(-6/5) at them resolve every speed, and one mesh
serves both strokes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.system import AIR_WALL, BORE, ROD, SEALED_WALL, WALLS
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records.gland import Gland
from softehl.cases.seal.section.layout import Layout
from softehl.cases.seal.section.uniform_layout import uniform_layout
from softehl.cases.seal.solve.inlet import film_thickness, inlet_length
from softehl.cases.seal.states.contacts import contact_edges
from softehl.runtime.arrays import Array
from softehl.runtime.mesh.o_grid import LONG
from softehl.runtime.mesh.spacing import Spot, graded

PASSES = 3
"""Meshes in a row, each graded by the contact on the one before."""

RATE = 0.3
"""Growth of the segments with the distance from the edges."""

COARSEST = 18
"""The arc is at least as many of its longest segments long, at density 2."""

_DENSITY = 2  # for which the sizes are chosen; other densities divide or join its segments


def graded_layout(system: SealSystem, x: Array) -> Layout:
    """The layout whose mesh is fine at the contact edges of the contact state x.

    Segments stay equal where the contact is too small to have edges.
    """
    layout = uniform_layout(system.parameters)
    length = system.section.places[-1]
    edges = contact_edges(system, x)
    if not edges:
        return layout
    steepest = max(edge.rise for edge in edges)
    spots = [
        Spot(min(max(edge.place, 0.0), length), (edge.rise / steepest) ** -0.6) for edge in edges
    ]
    spacing = graded(length, spots, LONG * _DENSITY, coarsest=length / COARSEST, rate=RATE)
    return layout.graded(spacing, layout.long)


REACH, FILMS = 0.15, 60.0
"""The arc that the contact places ends where the gap is this wide, mm, or so many films."""

STEEPEST, STEEPEST_NARROW = 55.0, 68.0
"""Or where the surface is this steep, degrees: beyond it is no film. The second where the gap is
narrower there than half of those films."""

_UPRIGHT = 85.0
"""A surface as steep as this lies on a wall. The arc ends before it: a film that rises along it has
no length, and on a finer mesh the section may touch the wall nearer to the rod."""

_FAR_SHORT, _GENTLE = 0.8, 35.0
"""An arc that ends at a gap of less than so much of what it is to have is made longer, where its
surface is not steeper than this, degrees: a wall is near where it is."""

MOST_SEGMENTS, FINEST = 60, 0.45
"""An arc that the contact places gets more segments, up to so many at density 1, until the finest
one at density 2 is so much of the inlet at the slowest speed."""

DEPTH = 2.5
"""Elements on such an arc are nowhere thicker than so many inlets at the slowest speed: with ten h*
was two per cent too small, with half as many as this it changes by 0.2 %."""

_THIRDS = 3  # of segments at density 1: meshes exist for thirds of a density
_PLACED_COARSEST, _FLAT_COARSEST = 12, 24
"""As COARSEST, of an arc that the contact places: on a round section, on one that may have flats,
along which the pressure hardly changes and the film does."""


def placed_layout(
    system: SealSystem,
    x: Array,
    p: Seal,
    most: int = MOST_SEGMENTS,
) -> Layout:
    """The layout of a case whose arc reaches as far as a film may matter in the contact state x.

    With k = K / K_max of each edge, segments are as k^-0.3 at it and grow by 0.3 k^0.5 outside and
    0.3 min(1 / k, 1.5) inside: at the flatter edge the dip is as wide as the inlet of the other
    one, and lies outside. The exponents were fitted to states at p_s / mu = 0, 1 and 2.7.
    most: segments at density 1 that it may get; a state that shows the edges only roughly is no
    reason for many.
    """
    s, edges = system.section.places, contact_edges(system, x)
    most_ends = uniform_layout(p).bounds(system.section.layout)
    ends = (
        _way_out(system, x, s, 0, most_ends[0]),
        _way_out(system, x, s, 1, most_ends[1]),
    )
    seen = system.section.layout.held(
        system.mesh, system.pressing(ROD, x), system.pressing(BORE, x), p.sealed_pressure
    )
    layout = uniform_layout(p).between(seen, ends)
    if p.mesh != "graded" or not edges:
        return layout
    length, steepest = ends[1] - ends[0], max(edge.rise for edge in edges)
    spots = []
    for edge in edges:
        k = min(edge.rise / steepest, 1.0) ** 0.5
        rates = RATE * k**0.5, RATE * min(1.0 / k, 1.5)
        place = min(max(edge.place - ends[0], 0.0), length)
        spots.append(Spot(place, k**-0.3, rates if edge.sealed else rates[::-1]))
    if p.opens:
        spots.append(_edge_spot(system, x, p, ends))
    parts, inlet = len(edges) // 2, inlet_length(p, steepest, min(p.speeds))
    coarsest = length / max(parts * _PLACED_COARSEST, _FLAT_COARSEST if layout.flat else 0)
    for long in range(layout.long, max(parts * most, layout.long) + 1, parts * _THIRDS):
        spacing = graded(length, spots, long * _DENSITY, coarsest=coarsest, rate=RATE)
        if length * spacing.smallest(long * _DENSITY) <= FINEST * inlet:
            break
    first = 0.25 * p.corner_fillet if p.opens else np.inf
    return layout.graded(spacing, long, DEPTH * inlet, first)


def _edge_spot(system: SealSystem, x: Array, p: Gland, ends: Sequence[float]) -> Spot:
    """Place at which the section meets the edge of the gap, on an arc between `ends`, mm."""
    nodes = system.mesh.arc_nodes
    centre = np.array([p.air_wall, 0.5 * p.rod_diameter])
    centre += p.corner_fillet + np.array([0.0, p.extrusion_gap])
    away = np.linalg.norm(system.deformed(x)[nodes] - centre, axis=1)
    place = system.section.places[int(np.argmin(away))]
    fine = 0.25 * p.corner_fillet
    return Spot(min(place, ends[1]) - ends[0], np.inf, most=fine)


def _way_out(system: SealSystem, x: Array, s: Array, side: int, bound: float) -> float:
    """Place on the arc (mm) of an end of the film: side 0 the sealed, 1 the air end.

    At most at `bound`, which may lie beyond the arc.
    """
    p = system.parameters
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
    steep = np.arctan2(np.diff(h), np.diff(z))
    for i in range(first, len(s) - 1):
        narrow = h[i] < 0.5 * films
        if np.degrees(steep[i]) >= (STEEPEST_NARROW if narrow else STEEPEST):
            # on a coarse mesh next to the contact, which the arc has to contain
            end = max(i, first + 1)
            upright = np.degrees(steep[i]) >= _UPRIGHT and not system.section.layout.flat
            on_wall = upright and end > first + 1
            return float(0.5 * (s[end - 1] + s[end]) if on_wall else s[end])
        if h[i + 1] >= reach:
            return float(np.interp(reach, h[i : i + 2], s[i : i + 2]))
    if h[-1] >= _FAR_SHORT * reach or not 0.0 < steep[-1] < np.radians(_GENTLE):
        return float(s[-1])
    wanted = (reach - h[-1]) / np.sin(steep[-1])
    longer = min(wanted, abs(bound - s[-1]), _free(system, x, side))
    return float(s[-1] + np.copysign(longer, bound - s[-1]))


def _free(system: SealSystem, x: Array, side: int) -> float:
    """Length of the outline (mm) beyond an end of the arc that touches no wall, nearly;
    inf for a section with flats, which lie on it from their corners on.
    """
    if system.section.layout.flat:
        return np.inf
    mesh, touching = system.mesh, set[int]()
    for wall in (SEALED_WALL, AIR_WALL):
        nodes = system.section.chains[WALLS[wall]][0]
        touching |= set(nodes[system.pressing(wall, x) > 0.0].tolist())
    nodes, places = mesh.boundary[mesh.arc :], mesh.places[mesh.arc :] - mesh.places[mesh.arc]
    if side == 0:
        nodes = np.append(mesh.boundary[:1], mesh.boundary[: mesh.arc : -1])
        places = np.append(0.0, mesh.length + mesh.places[0] - mesh.places[: mesh.arc : -1])
    first = next((k for k, node in enumerate(nodes) if int(node) in touching), len(nodes))
    if first in (0, len(nodes)):
        return 0.0 if first == 0 else float(places[-1])
    return float(0.5 * (places[first - 1] + places[first]))
