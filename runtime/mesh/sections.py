"""Structured quadrilateral mesh of a circular section, an O-grid refined towards one arc of it.

The grid is the image of index space under one mapping that does not know the density, so the nodes
of density d are among those of density 2 d, and every boundary node lies exactly on the circle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from math import cos, pi, radians, sin

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mesh.spacing import Spacing

LONG, SHORT, LAYERS = 27, 6, 3  # segments at density 1: bottom and top, each side, layers around


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
    def parts(self) -> tuple[int, int, int]:
        """Segments of the arc and of each side, and layers, at density 1."""
        return self.long, SHORT, self.layers

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


@dataclass(frozen=True, eq=False)
class SectionMesh:
    """Quadrilaterals of a section and its boundary.

    points: (V, 2) reference (z, r) in mm. quads: (Q, 4), counterclockwise. boundary: (B,) nodes in
    counterclockwise order from the first node of the arc; segment i joins boundary[i] and
    boundary[i + 1] (cyclic), its outward normal is (dr, -dz)/length. arc: number of segments
    on the refined arc, which come first. places: (B,) arc lengths of the boundary nodes on the
    undeformed outline, mm, rising, from that of the first node. length: of the whole outline, mm,
    by which places are periodic. regions: name -> numbers of the quads that are of one material.
    """

    points: Array
    quads: Integers
    boundary: Integers
    arc: int
    places: Array
    length: float
    regions: Mapping[str, Integers] = field(default_factory=dict)

    @property
    def segments(self) -> Integers:
        """All boundary segments, (B, 2) node numbers."""
        return np.stack([self.boundary, np.roll(self.boundary, -1)], axis=1)

    @property
    def arc_segments(self) -> Integers:
        """Segments of the arc, (arc, 2), from its first to its last end."""
        return self.segments[: self.arc]

    @property
    def arc_nodes(self) -> Integers:
        """Nodes of the arc, (arc + 1,)."""
        return self.boundary[: self.arc + 1]

    @property
    def arc_places(self) -> Array:
        """Lengths (arc + 1,) along the undeformed arc from its first node, mm."""
        return np.asarray(self.places[: self.arc + 1] - self.places[0])

    @property
    def outer_nodes(self) -> Integers:
        """Boundary nodes that are not interior to the arc, from its last end round to its first."""
        return np.concatenate([self.boundary[self.arc :], self.boundary[:1]])

    @property
    def outer_segments(self) -> Integers:
        """Boundary segments that are not on the arc, (B - arc, 2), in the same order."""
        return self.segments[self.arc :]


def disc_mesh(disc: Disc, density: int | Fraction) -> SectionMesh:
    """O-grid with `long` d segments on the arc: 27 d, 66 d around and 360 d^2 quadrilaterals.

    density: a multiple of 1/3, at least 2/3. Raises ValueError for others.
    """
    if density < Fraction(2, 3) or (3 * density) % 1:
        raise ValueError(
            f"disc_mesh: density {density} is not allowed, it is a multiple of 1/3 and at least 2/3"
        )
    long, short, layers = (int(n * density) for n in disc.parts)
    loop = _loop(disc, long, short)
    ring = disc.centre + disc.radius * disc.direction(loop[0])
    inner = loop[1]
    depth = graded_steps(layers, disc.layer_growth)
    layer_points = ring[None] + depth[:-1, None, None] * (inner - ring)[None]
    block = _central_block(disc, inner, long, short)
    points = np.concatenate([layer_points.reshape(-1, 2), block.reshape(-1, 2)])
    quads = np.concatenate([_layer_quads(long, short, layers), _block_quads(long, short, layers)])
    boundary = np.arange(2 * (long + short))
    places = disc.radius * loop[0]
    return SectionMesh(points, quads, boundary, long, places, 2.0 * pi * disc.radius)


def corner_jacobians(mesh: SectionMesh) -> Array:
    """Jacobian determinants (Q, 4) at the corners of every quadrilateral, relative to its area."""
    return corner_shares(mesh.points[mesh.quads])


def corner_shares(x: Array) -> Array:
    """The same of quadrilaterals with corners x (Q, 4, 2)."""
    forward, backward = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    cross = forward[..., 0] * backward[..., 1] - forward[..., 1] * backward[..., 0]
    return np.asarray(cross / (0.5 * np.abs(cross.sum(axis=1, keepdims=True)) * 0.5))


def graded_steps(count: int, growth: float) -> Array:
    """0 to 1 in `count` steps, (count + 1,); their lengths grow exponentially, in all by growth."""
    t = np.arange(count + 1) / count
    k = np.log(growth)
    return np.asarray(np.expm1(k * t) / np.expm1(k)) if growth != 1.0 else t


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
    ends = disc.direction(np.array([begin, end])) * np.array([[first], [last]])
    chord = ends[0] + t[:, None] * (ends[1] - ends[0])
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


def _layer_quads(long: int, short: int, layers: int) -> Integers:
    """Quadrilaterals between the boundary and the central block, (layers * around, 4)."""
    around = 2 * (long + short)
    outer = np.arange(layers * around).reshape(layers, around)
    rings = np.concatenate([outer, _block_loop(long, short, layers)[None]])
    following = np.roll(rings, -1, axis=1)
    quads = np.stack([rings[:-1], following[:-1], following[1:], rings[1:]], axis=-1)
    return quads.reshape(-1, 4)


def _block_numbers(long: int, short: int, layers: int) -> Integers:
    first = layers * 2 * (long + short)
    return first + np.arange((short + 1) * (long + 1)).reshape(short + 1, long + 1)


def _block_loop(long: int, short: int, layers: int) -> Integers:
    """Node numbers around the central block, counterclockwise from its lower left corner."""
    n = _block_numbers(long, short, layers)
    return np.concatenate([n[0, :-1], n[:-1, -1], n[-1, :0:-1], n[:0:-1, 0]])


def _block_quads(long: int, short: int, layers: int) -> Integers:
    n = _block_numbers(long, short, layers)
    quads = np.stack([n[:-1, :-1], n[:-1, 1:], n[1:, 1:], n[1:, :-1]], axis=-1)
    return quads.reshape(-1, 4)


def bottom_point(disc: Disc, angle: float) -> tuple[float, float]:
    """The point (z, r) of the circle at an angle from the bottom, in degrees."""
    a = radians(angle)
    return disc.centre_z + disc.radius * sin(a), disc.centre_r - disc.radius * cos(a)
