"""Where the mesh of the section is to be fine: at both edges of its contact, and below them.

Film and dry contact differ most at the edges of the contact, where the dry pressure begins like a
square root, p = K sqrt(distance): the inlet draws the film in just outside one edge, the exit dip
lies just inside the other. Balance of viscous and elastic forces there, K / sqrt(l) = eta U / h^2
with h = K l^(3/2) / E, gives both the length l = (eta U E^2 / K^3)^(2/5) at every speed (Snoeijer,
Eggers and Venner, Phys. Fluids 25, 2013, 101705). So segments that grow with the distance from the
edges and are as K^(-6/5) at them resolve every speed, and one mesh serves both strokes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from softehl.cases.seal.equations import SealSystem
from softehl.cases.seal.section import SealSection, uniform_disc
from softehl.runtime.arrays import Array
from softehl.runtime.mesh.sections import LONG, Disc
from softehl.runtime.mesh.spacing import Spot, graded

PASSES = 2
"""Meshes in a row, each graded by the contact on the one before."""

RATE = 0.3
"""Growth of the segments with the distance from the edges."""

COARSEST = 18
"""The arc is at least as many of its longest segments long, at density 2."""

_DENSITY = 2  # for which the sizes are chosen; other densities divide or join its segments
_CORNERS, _TOP, _LAYER_GROWTH, _ROW_GROWTH = (0.965, 0.62), 90.0, 20.0, 5.0


def graded_disc(system: SealSystem, x: Array) -> Disc:
    """The disc whose mesh is fine at the contact edges of the contact state x.

    Segments stay equal where the contact is too small to have edges.
    """
    disc = uniform_disc(system.parameters)
    length = arc_positions(system.section)[-1]
    edges = contact_edges(system, x)
    if not edges:
        return disc
    steepest = max(edge.rise for edge in edges)
    spots = [
        Spot(min(max(edge.place, 0.0), length), (edge.rise / steepest) ** -0.6) for edge in edges
    ]
    spacing = graded(length, spots, LONG * _DENSITY, coarsest=length / COARSEST, rate=RATE)
    return replace(
        disc,
        spacing=spacing,
        top=_TOP,
        corner_radius=_CORNERS,
        layer_growth=_LAYER_GROWTH,
        row_growth=_ROW_GROWTH,
    )


def arc_positions(section: SealSection) -> Array:
    """Lengths (arc nodes,) along the undeformed arc from its sealed end, mm."""
    disc, nodes = section.disc, section.mesh.arc_nodes
    z, r = (section.mesh.points[nodes] - disc.centre).T
    angle = np.arctan2(z, -r)
    return np.asarray(disc.radius * (angle - angle[0]))


@dataclass(frozen=True)
class Edge:
    """An edge of the contact: its place on the arc, mm, and K^2 of its pressure, MPa^2/mm."""

    place: float
    rise: float


def contact_edges(system: SealSystem, x: Array) -> list[Edge]:
    """Where and how steeply the contact of the state x begins and ends along the arc.

    The square of the pressure is a straight line there, taken from the second and third node that
    touch; none where fewer than three do.
    """
    s, pressure = arc_positions(system.section), -system.rod_multipliers(x)
    touching = np.flatnonzero(pressure > 0.0)
    if len(touching) < 3:
        return []
    return [_edge(s[i], pressure[i] ** 2) for i in (touching[1:3], touching[-2:-4:-1])]


def _edge(s: Array, y: Array) -> Edge:
    """The zero of the straight line through two points, and its slope."""
    slope = (y[1] - y[0]) / (s[1] - s[0])
    return Edge(float(s[0] - y[0] / slope), abs(float(slope)))
