"""The mesh of a section: its quadrilaterals, its boundary, and how good its elements are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from softehl.runtime.arrays import Array, Integers

LAYERS = 3
"""Layers of elements along the outline at density 1."""


@dataclass(frozen=True, eq=False)
class SectionMesh:
    """Quadrilaterals of a section and its boundary.

    points: (V, 2) reference (z, r) in mm. quads: (Q, 4), counterclockwise. boundary: (B,) nodes in
    counterclockwise order from the first node of the arc; segment i joins boundary[i] and
    boundary[i + 1] (cyclic), its outward normal is (dr, -dz)/length. arc: number of segments
    on the refined arc, which come first. positions: (B,) arc lengths of the boundary nodes on the
    undeformed outline, mm, rising, from that of the first node. length: of the whole outline, mm,
    by which places are periodic. regions: name -> numbers of the quads that are of one material.
    """

    points: Array
    quads: Integers
    boundary: Integers
    arc: int
    positions: Array
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
        return np.asarray(self.positions[: self.arc + 1] - self.positions[0])

    @property
    def outer_nodes(self) -> Integers:
        """Boundary nodes that are not interior to the arc, from its last end round to its first."""
        return np.concatenate([self.boundary[self.arc :], self.boundary[:1]])

    @property
    def outer_segments(self) -> Integers:
        """Boundary segments that are not on the arc, (B - arc, 2), in the same order."""
        return self.segments[self.arc :]


def corner_jacobians(mesh: SectionMesh) -> Array:
    """Jacobian determinants (Q, 4) at the corners of every quadrilateral, relative to its area."""
    return corner_shares(mesh.points[mesh.quads])


def corner_shares(x: Array) -> Array:
    """Quality of quadrilaterals with corners x (Q, 4, 2)."""
    forward, backward = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    cross = forward[..., 0] * backward[..., 1] - forward[..., 1] * backward[..., 0]
    return np.asarray(cross / (0.5 * np.abs(cross.sum(axis=1, keepdims=True)) * 0.5))


def graded_steps(count: int, growth: float) -> Array:
    """0 to 1 in `count` steps, (count + 1,); their lengths grow exponentially, in all by growth."""
    t = np.arange(count + 1) / count
    k = np.log(growth)
    return np.asarray(np.expm1(k * t) / np.expm1(k)) if growth != 1.0 else t


def grid_cells(numbers: Integers) -> Integers:
    """Quadrilaterals (n m, 4) of a grid of node numbers (n + 1, m + 1)."""
    n = numbers
    return np.stack([n[:-1, :-1], n[:-1, 1:], n[1:, 1:], n[1:, :-1]], axis=-1).reshape(-1, 4)
