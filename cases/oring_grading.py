"""Where the mesh of the section is to be fine: at both edges of its contact, and below them.

Film and dry contact differ most at the edges of the contact, where the dry pressure begins like a
square root: the inlet draws the film in just outside one edge, the exit dip lies just inside the
other. Both are similar at all speeds, their length falls with U^(2/5) (Snoeijer, Eggers and Venner,
Phys. Fluids 25, 2013, 101705), so segments that shrink in proportion to the distance from the edge
resolve them at every speed, and one mesh serves both strokes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cases.oring_section import OringSection, uniform_disc
from runtime.mesh import LONG, Disc
from runtime.spacing import graded

Array = NDArray[np.float64]

PASSES = 2
"""Meshes in a row, each graded by the contact on the one before."""

RATE = 0.25
"""Growth of the segments with the distance from the edges."""

COARSEST = 24
"""The arc is at least as many of its longest segments long, at density 2."""

_DENSITY = 2  # for which the sizes are chosen; other densities divide or join its segments
_CORNERS, _TOP, _LAYER_GROWTH, _ROW_GROWTH = (0.93, 0.62), 90.0, 20.0, 5.0


def graded_disc(section: OringSection, x: Array) -> Disc:
    """The disc whose mesh is fine at the contact edges of the contact state x of the section."""
    disc = uniform_disc(section.parameters)
    spots = contact_edges(section, x)
    length = arc_positions(section)[-1]
    spacing = graded(length, spots, LONG * _DENSITY, coarsest=length / COARSEST, rate=RATE)
    return replace(
        disc,
        spacing=spacing,
        top=_TOP,
        corner_radius=_CORNERS,
        layer_growth=_LAYER_GROWTH,
        row_growth=_ROW_GROWTH,
    )


def arc_positions(section: OringSection) -> Array:
    """Lengths (arc nodes,) along the undeformed arc from its sealed end, mm."""
    disc, nodes = section.disc, section.mesh.arc_nodes
    z, r = (section.mesh.points[nodes] - disc.centre).T
    angle = np.arctan2(z, -r)
    return np.asarray(disc.radius * (angle - angle[0]))


def contact_edges(section: OringSection, x: Array) -> tuple[float, float]:
    """Where the contact of the state x begins and ends along the arc, mm.

    The pressure begins like a square root: its square is a straight line, whose zero is taken from
    the second and third node that touch. Raises ValueError where fewer than three do.
    """
    s, pressure = arc_positions(section), -x[section.layout.part("rod")]
    touching = np.flatnonzero(pressure > 0.0)
    if len(touching) < 3:
        raise ValueError(
            f"contact_edges: {len(touching)} nodes touch the rod; at least 3 are needed to find "
            "the edges of the contact: use a finer mesh (larger density)"
        )
    first, last = (_zero(s[i], pressure[i] ** 2) for i in (touching[1:3], touching[-2:-4:-1]))
    return max(first, float(s[0])), min(last, float(s[-1]))


def _zero(s: Array, y: Array) -> float:
    """Where the straight line through two points is zero."""
    return float(s[0] - y[0] * (s[1] - s[0]) / (y[1] - y[0]))
