"""Structured quadrilateral mesh of a disc, an O-grid refined towards one arc of it.

The grid is the image of index space under one mapping that does not know the density, so the nodes
of density d are among those of density 2 d, and every boundary node lies exactly on the circle.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from math import inf, pi, radians

import numpy as np

from softehl.cases.seal.meshing.section_mesh import LAYERS, SectionMesh, graded_steps, grid_cells
from softehl.cases.seal.meshing.spacing import Spacing
from softehl.runtime.arrays import Array

LONG, SHORT = 27, 6
"""Segments at density 1: of the arc, and of each side block."""

MOST_LAYERS, STEEPEST_GROWTH = 6, 2.0
"""Layers at density 1, and the largest ratio of one to the one outside of it at density 2: 1.5
changes h* of an O-ring by 0.2 %, 3 by nothing."""

_SIDES = 35.0  # degrees that the side blocks need at least: with 25 their upper corners fold
_CORNERS, _TOP, _LAYER_GROWTH, _ROW_GROWTH = (0.965, 0.62), 90.0, 20.0, 5.0
"""Of fine grids: growths of half or twice that, tops at 80 and 105 degrees and layers of 0.025 to
0.05 radii change h* of an O-ring by 0.06 % at most. Growths of 8 and 2.4 and tops at 112 degrees
together doubled the time of one instroke at three shear moduli, density 4."""
_DENSITY = 2  # for which sizes are chosen; other densities divide or join its segments


@dataclass(frozen=True)
class Disc:
    """A circular section and how the grid is laid into it.

    centre_z, centre_r, radius: mm. arc_start, arc_end: ends of the refined arc, degrees from the
    bottom of the section, positive towards +z. top: upper ends of the side blocks,
    degrees from the bottom on either side.
    corner_radius: relative radius of the lower and of the upper corners of the central block.
    bulge: how round the edges of the central block are (bottom, sides, top), 0 = chord and
    1 = concentric arc. layer_growth, row_growth: ratio of the last to the first thickness
    of the layers (outside to inside) and of the rows of the central block (bottom to top).
    spacing: of the nodes along the arc and, fading, in the columns above it; None = equal.
    long: segments of the arc, and of the side opposite to it, at density 1. layers: how many there
    are at density 1.
    """

    centre_z: float
    centre_r: float
    radius: float
    arc_start: float
    arc_end: float
    top: float = 112.0
    corner_radius: tuple[float, float] = (0.85, 0.62)
    bulge: tuple[float, float, float] = (0.55, 0.3, 0.5)
    layer_growth: float = 1.8
    row_growth: float = 2.4
    spacing: Spacing | None = None
    long: int = LONG
    layers: int = LAYERS

    @property
    def corners(self) -> tuple[float, float, float, float]:
        """Angles (rad) at which the blocks meet: bottom left and right, top right and left."""
        start, end, top = radians(self.arc_start), radians(self.arc_end), radians(self.top)
        return start, end, top, 2.0 * np.pi - top

    def direction(self, angle: Array | float) -> Array:
        """Unit vectors (..., 2) in (z, r) at angles from the bottom (rad)."""
        return np.stack([np.sin(angle), -np.cos(angle)], axis=-1)

    @property
    def centre(self) -> Array:
        """Centre of the section, (2,) in (z, r)."""
        return np.array([self.centre_z, self.centre_r])


def disc_mesh(disc: Disc, density: int | Fraction) -> SectionMesh:
    """O-grid with `long` d segments on the arc: 27 d, 66 d around and 360 d^2 quadrilaterals.

    density: a multiple of 1/3, at least 2/3. Raises ValueError for others.
    """
    if density < Fraction(2, 3) or (3 * density) % 1:
        raise ValueError(
            f"disc_mesh: density {density} is not allowed, it is a multiple of 1/3 and at least 2/3"
        )
    long, short, layers = (int(n * density) for n in (disc.long, SHORT, disc.layers))
    angles, inner = _loop(disc, long, short)
    ring = disc.centre + disc.radius * disc.direction(angles)
    depth = graded_steps(layers, disc.layer_growth)
    layer_points = ring[None] + depth[:-1, None, None] * (inner - ring)[None]
    block = _central_block(disc, inner, long, short)
    points = np.concatenate([layer_points.reshape(-1, 2), block.reshape(-1, 2)])
    rings = np.arange(layers * len(ring)).reshape(layers, -1)
    n = rings.size + np.arange((short + 1) * (long + 1)).reshape(short + 1, long + 1)
    around = np.concatenate([n[0, :-1], n[:-1, -1], n[-1, :0:-1], n[:0:-1, 0]])
    rings = np.concatenate([rings, around[None]])
    quads = np.concatenate([grid_cells(np.append(rings, rings[:, :1], axis=1)), grid_cells(n)])
    boundary, positions = np.arange(len(ring)), disc.radius * angles
    return SectionMesh(points, quads, boundary, long, positions, 2.0 * pi * disc.radius)


def fine_disc(disc: Disc, depth: float, first: float = inf) -> Disc:
    """O-grid with layers as a film needs them.

    depth: of the outermost layer on the arc, mm, at most, as far as their number allows. first:
    size of the segment beyond the air end of the arc, mm, at most.
    """
    top = max(_TOP, disc.arc_end + _SIDES, _SIDES - disc.arc_start)
    side = disc.radius * np.radians(top - disc.arc_end)
    rows = _growth_to(first / side, SHORT * _DENSITY, _ROW_GROWTH)
    half = 0.5 * np.radians(disc.arc_end - disc.arc_start)  # layers are least deep at its ends
    inner = _CORNERS[0] * (disc.bulge[0] + (1.0 - disc.bulge[0]) * np.cos(half))
    layers, growth = _layers(depth / ((1.0 - inner) * disc.radius))
    return replace(
        disc,
        top=top,
        corner_radius=_CORNERS,
        layers=layers,
        layer_growth=growth,
        row_growth=rows,
    )


def _layers(first: float) -> tuple[int, float]:
    """Number of layers at density 1, and their growth; the first is this part of all."""
    for layers in range(LAYERS, MOST_LAYERS + 1, LAYERS):
        growth = _growth_to(first, layers * _DENSITY, _LAYER_GROWTH)
        if growth <= STEEPEST_GROWTH ** (layers * _DENSITY):
            return layers, growth
    return MOST_LAYERS, STEEPEST_GROWTH ** (MOST_LAYERS * _DENSITY)


def _growth_to(first: float, count: int, minimum: float) -> float:
    """Ratio of the last to the first of `count` parts of a line, the first of them this part."""
    growth = minimum
    while np.expm1(np.log(growth) / count) / (growth - 1.0) > first:
        growth *= 1.1
    return growth


def _columns(disc: Disc, long: int) -> Array:
    """Relative positions (long + 1,) of the nodes along the arc."""
    t = np.arange(long + 1) / long
    return disc.spacing(t) if disc.spacing else t


def _loop(disc: Disc, long: int, short: int) -> tuple[Array, Array]:
    """Angles of the boundary nodes and the points of the central block that they are joined to."""
    a = disc.corners
    low, high = (disc.radius * c for c in disc.corner_radius)
    bottom, sides, top = disc.bulge
    rows = graded_steps(short, disc.row_growth)
    pieces = [
        _edge(disc, a[0], a[1], low, low, bottom, _columns(disc, long)),
        _edge(disc, a[1], a[2], low, high, sides, rows),
        _edge(disc, a[2], a[3], high, high, top, np.arange(long + 1) / long),
        _edge(disc, a[3], a[0] + 2.0 * np.pi, high, low, sides, 1.0 - rows[::-1]),
    ]
    angles = np.concatenate([angle[:-1] for angle, _ in pieces])
    return angles, np.concatenate([points[:-1] for _, points in pieces])


def _edge(
    disc: Disc, begin: float, end: float, first: float, last: float, bulge: float, t: Array
) -> tuple[Array, Array]:
    """One edge of the central block, between chord and arc: boundary angles and points at t."""
    angle = begin + t * (end - begin)
    edge_points = disc.direction(np.array([begin, end])) * np.array([[first], [last]])
    chord = edge_points[0] + t[:, None] * (edge_points[1] - edge_points[0])
    arc = disc.direction(angle) * (first + t * (last - first))[:, None]
    return angle, disc.centre + (1.0 - bulge) * chord + bulge * arc


def _central_block(disc: Disc, loop: Array, long: int, short: int) -> Array:
    """Transfinite interpolation of the loop: (short + 1, long + 1, 2), bottom row first."""
    bottom = loop[: long + 1]
    right = loop[long : long + short + 1]
    top = loop[long + short : 2 * long + short + 1][::-1]
    left = np.concatenate([loop[2 * long + short :], loop[:1]])[::-1]
    t = graded_steps(short, disc.row_growth)[:, None, None]
    s = _columns(disc, long)[:, None]
    s = s + t * ((np.arange(long + 1) / long)[:, None] - s)
    edges = (1 - t) * bottom[None] + t * top[None] + (1 - s) * left[:, None] + s * right[:, None]
    corners = (1 - t) * ((1 - s) * bottom[0] + s * bottom[-1])
    corners = corners + t * ((1 - s) * top[0] + s * top[-1])
    block = np.asarray(edges - corners)
    block[0], block[-1], block[:, 0], block[:, -1] = bottom, top, left, right
    return block
