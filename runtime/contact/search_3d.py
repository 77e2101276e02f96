"""Contact search in 3-D: pairs of opposite faces, and triangles of their overlap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.contact.mortar_overlap import CORNER, common_part, mean_normal
from softehl.runtime.contact.mortar_pair import MULTIPLIERS, MortarPairKernel
from softehl.runtime.contact.search import (
    Balls,
    ContactSide,
    by_kind,
    facing,
    limits,
    nodes_of,
    without_common_corners,
)
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.mesh.cells import CELLS


@dataclass(frozen=True, eq=False)
class FaceContact:
    """A contact between `sides`, which have the multipliers, and `others`.

    points: (p, 3) of the mesh. displacements (p, 3), multipliers (p, 4): numbers of the unknowns
    at each node, -1 where there are none. kernels: (kind, other kind) -> elements. alone: both are
    one surface, of which a pair has its first face as the side.
    """

    name: str
    points: Array
    displacements: Integers
    multipliers: Integers
    sides: tuple[ContactSide, ...]
    others: tuple[tuple[str, Integers], ...]
    kernels: dict[tuple[str, str], MortarPairKernel]
    friction: float = 0.0
    alone: bool = False

    @property
    def nodes(self) -> Integers:
        """Of all its faces."""
        return nodes_of(self.sides, self.others)

    def empty(self) -> list[ElementBlock]:
        """Its blocks without elements, which keep their places."""
        x = np.zeros(int(max(self.displacements.max(), self.multipliers.max())) + 1)
        none = np.empty(0, dtype=np.int64)
        kinds, corners = by_kind(self.sides, self.others, none, none), np.empty((0, 3, CORNER))
        return [self._block(a, b, (i, j, corners), x) for a, b, i, j in kinds]

    def blocks(self, x: Array, old: Array) -> list[ElementBlock]:
        """Elements of the pairs at unknowns x; old: of the step before."""
        moved = np.where(self.displacements >= 0, x[self.displacements], 0.0)
        if not np.isfinite(moved).all():
            return self.empty()
        points = self.points + moved
        result = []
        for a, b, i, j in by_kind(self.sides, self.others, *self._pairs(points)):
            side, (label, faces) = self.sides[a], self.others[b]
            cells = CELLS[side.kind], CELLS[label]
            part = common_part(cells[0], points[side.faces[i]], cells[1], points[faces[j]])
            result.append(self._block(a, b, (i[part.pairs], j[part.pairs], part.corners), old))
        return result

    def _pairs(self, node_points: Array) -> tuple[Integers, Integers]:
        """Numbers of sides and of others, both counted through their kinds, that may meet."""
        sides = [(s.kind, s.faces) for s in self.sides]
        side, other = facing(
            _balls(node_points, sides), _balls(node_points, self.others), limits(self.sides)
        )
        return without_common_corners(
            _corners(sides), _corners(self.others), side, other, alone=self.alone
        )

    def _block(
        self, a: int, b: int, overlaps: tuple[Integers, Integers, Array], old: Array
    ) -> ElementBlock:
        """Elements of triangles of sides of kind a and others of kind b."""
        side, (kind, faces) = self.sides[a], self.others[b]
        one, other, corners = overlaps
        side_faces = side.faces[one]
        nodes = np.concatenate([side_faces, faces[other]], axis=1)
        n, width = len(nodes), 3 * nodes.shape[1]
        moved = self.displacements[nodes].reshape(n, width)
        previous = np.where(moved >= 0, old[moved], 0.0)
        limits = [side.rho[one], np.full(n, self.friction), side.depth[one], side.reach[one]]
        corners_of_side = side_faces[:, : CELLS[side.kind].corners]
        multipliers = self.multipliers[corners_of_side].reshape(
            n, MULTIPLIERS * corners_of_side.shape[1]
        )
        return ElementBlock(
            f"{self.name}: {side.kind} on {kind}",
            self.kernels[side.kind, kind],
            self.points[nodes].reshape(n, width),
            np.ascontiguousarray(np.concatenate([moved, multipliers], axis=1)),
            np.concatenate(
                [previous, np.stack(limits, axis=1), corners.reshape(n, 3 * CORNER)], axis=1
            ),
            check_orientation=False,
        )


def _balls(node_points: Array, kinds: Sequence[tuple[str, Integers]]) -> Balls:
    """Centres, radii and normals of the faces of all kinds."""
    balls = []
    for kind, faces in kinds:
        corners = node_points[faces[:, : CELLS[kind].corners]]
        centre = corners.mean(axis=1)
        radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
        balls.append((centre, radius, mean_normal(CELLS[kind], corners)))
    centre, radius, normal = (np.concatenate([f[k] for f in balls]) for k in (0, 1, 2))
    return centre, radius, normal


def _corners(kinds: Sequence[tuple[str, Integers]]) -> Integers:
    """Corners of the faces of all kinds, (n, 4), the last one twice on triangles."""
    return np.concatenate([faces[:, [0, 1, 2, CELLS[kind].corners - 1]] for kind, faces in kinds])
