"""Places where the mesh of a contact ends, and where it is fine: at the edges of the contact.

There `solve.inlet` has a length of the film for every speed, which is as K^(-6/5). So segments that
are as K^(-6/5) at the edges, and grow with the distance from them, resolve every speed, and one
mesh serves both strokes. A film that asks for finer ones gets its own (`solve.film_layout`).
"""

from __future__ import annotations

import numpy as np

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.system import AIR_WALL, BORE, ROD, SEALED_WALL, WALLS
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records.gland import Gland
from softehl.cases.seal.section.layout import Layout
from softehl.cases.seal.section.uniform_layout import uniform_layout
from softehl.cases.seal.solve.inlet import film_thickness
from softehl.cases.seal.states.contacts import contact_edges
from softehl.runtime.arrays import Array
from softehl.runtime.mesh.spacing import Spot, graded

RATE = 0.3
"""Growth of the segments with the distance from the edges."""

COARSEST = 18
"""The arc is at least as many of its longest segments long, at density 2."""

_DENSITY = 2  # for which the sizes are chosen; other densities divide or join its segments

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

NO_WIDTH = 1e-6
"""Of the widest part of an arc, below which a part lies on a wall."""


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
        Spot(min(max(edge.place - begin, 0.0), length), (edge.rise / steepest) ** -0.6)
        for edge in edges
    ]
    first = np.inf
    if p.opens:
        spots.append(_edge_spot(system, x, p, (begin, begin + length)))
        first = spots[-1].most
    spacing = graded(length, spots, layout.long * _DENSITY, coarsest=length / COARSEST, rate=RATE)
    return layout.graded(spacing, layout.long, first=first)


def on_wall(system: SealSystem, x: Array) -> bool:
    """True if the arc in the contact state x (n,) goes up a wall, where a film has no length."""
    widths = np.diff(system.arc_film(x)[0])
    return bool(widths.min() <= NO_WIDTH * widths.max())


def _placed(system: SealSystem, x: Array, layout: Layout) -> Layout:
    """The layout with an arc that reaches as far as a film may matter in the contact state x."""
    seen, p = system.section.layout, system.parameters
    most = layout.bounds(seen)
    ends = _way_out(system, x, 0, most[0]), _way_out(system, x, 1, most[1])
    pressing = system.pressing(ROD, x), system.pressing(BORE, x)
    return layout.between(seen.held(system.mesh, *pressing, p.sealed_pressure), ends)


def _edge_spot(system: SealSystem, x: Array, p: Gland, ends: tuple[float, float]) -> Spot:
    """Place at which the section meets the edge of the gap, on an arc between `ends`, mm."""
    nodes = system.mesh.arc_nodes
    centre = np.array([p.air_wall, 0.5 * p.rod_diameter])
    centre += p.corner_fillet + np.array([0.0, p.extrusion_gap])
    away = np.linalg.norm(system.deformed(x)[nodes] - centre, axis=1)
    place = system.section.places[int(np.argmin(away))]
    fine = 0.25 * p.corner_fillet
    return Spot(min(place, ends[1]) - ends[0], np.inf, most=fine)


def _way_out(system: SealSystem, x: Array, side: int, bound: float) -> float:
    """Place on the arc (mm) of an end of the film: side 0 the sealed, 1 the air end.

    At most at `bound`, which may lie beyond the arc.
    """
    p, s = system.parameters, system.section.places
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
