"""Contact of faces in space: each quadrature point of a face against the face that it looks at.

Where a point looks is found by Newton's method for all candidates at once; the kernel (page
`touch_44` and its like) starts there, so that its tangent has the motion of the partner.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.fem.assembly import ElementBlock
from softehl.runtime.fem.touching import FACING, SLANTED, Side, within
from softehl.runtime.kernels import Kernel, Rule
from softehl.runtime.mesh.cells import CELLS, Cell

_ITERATIONS = 12  # of bilinear faces; what has not converged by then is folded, and left out
_EDGE = 1e-9  # by which a partner may lie outside, in parent coordinates


@dataclass(frozen=True, eq=False)
class Partners:
    """Points, and what they look at: number of the point and of the face, parent coordinates and
    distance, (n, 3).
    """

    points: Integers
    faces: Integers
    start: Array


@dataclass(frozen=True, eq=False)
class FaceContact:
    """A contact between `sides`, which have the multiplier, and `others`.

    points: (p, 3) of the mesh. displacements (p, 3), multipliers (p, 1): numbers of the unknowns
    at each node, -1 where there are none. kernels: (kind, other kind) -> kernel.
    """

    name: str
    points: Array
    displacements: Integers
    multipliers: Integers
    sides: tuple[Side, ...]
    others: tuple[tuple[str, Integers], ...]
    kernels: dict[tuple[str, str], Kernel]

    def empty(self) -> list[ElementBlock]:
        """Its blocks without elements, which keep their places."""
        none = Partners(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 3)))
        return [
            self._block(side, b, q, none)
            for side in self.sides
            for q in range(len(_rule(side.kind)[1]))
            for b in range(len(self.others))
        ]

    def blocks(self, x: Array, old: Array) -> list[ElementBlock]:
        """Elements of the points and their partners at unknowns x; old: of the step before."""
        moved = np.where(self.displacements >= 0, x[self.displacements], 0.0)
        if not np.isfinite(moved).all():
            return self.empty()
        places, found = self.points + moved, []
        for side in self.sides:
            for q, at in enumerate(_rule(side.kind)[0]):
                partners = self._partners(side, at, places)
                found += [self._block(side, b, q, p) for b, p in enumerate(partners)]
        return found

    def _partners(self, side: Side, at: Array, places: Array) -> list[Partners]:
        """Partners of the points at one parent place, of each kind of the others."""
        cell = CELLS[side.kind]
        corners = places[side.faces]
        point = np.einsum("k,nkc->nc", cell.shape(at[None])[0], corners)
        normal = _normals(cell, corners, np.broadcast_to(at, (len(point), 2)))
        looks = [
            self._looks(side, point, normal, CELLS[kind], places[faces])
            for kind, faces in self.others
        ]
        distance = np.full(len(point), np.inf)
        for partners in looks:
            np.minimum.at(distance, partners.points, np.abs(partners.start[:, 2]))
        taken, nearest = np.zeros(len(point), dtype=bool), []
        for p in looks:
            kept = (np.abs(p.start[:, 2]) <= distance[p.points]) & ~taken[p.points]
            _, first = np.unique(p.points[kept], return_index=True)
            chosen = np.flatnonzero(kept)[first]
            taken[p.points[chosen]] = True
            nearest.append(Partners(p.points[chosen], p.faces[chosen], p.start[chosen]))
        return nearest

    def _looks(
        self, side: Side, point: Array, normal: Array, cell: Cell, corners: Array
    ) -> Partners:
        """Every face of one kind that a point looks at within its reach."""
        centre = corners.mean(axis=1)
        size = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1)
        tree = cKDTree(centre)
        nearest = SLANTED * tree.query(point)[0]
        radius = size.max() + np.maximum(side.reach, np.minimum(side.depth, nearest))
        one, other = within(tree, point, radius)
        across = np.cross(centre[other] - point[one], normal[one])
        near = np.linalg.norm(across, axis=1) <= size[other]  # else the line misses the face
        one, other = one[near], other[near]
        start, kept = _looked(cell, corners[other], point[one], normal[one])
        facing = np.einsum("nc,nc->n", _normals(cell, corners[other], start[:, :2]), normal[one])
        kept &= (facing < FACING) & (start[:, 2] < side.reach[one])
        kept &= start[:, 2] > -side.depth[one]
        return Partners(one[kept], other[kept], start[kept])

    def _block(self, side: Side, b: int, q: int, found: Partners) -> ElementBlock:
        """Elements of the points at the parent place q with others of kind b."""
        kind, faces = self.others[b]
        own = side.faces[found.points]
        nodes = np.concatenate([own, faces[found.faces]], axis=1)
        n, width = len(nodes), 3 * nodes.shape[1]
        moved = self.displacements[nodes].reshape(n, width)
        dofs = np.concatenate([moved, self.multipliers[own].reshape(n, own.shape[1])], axis=1)
        points, weights = _rule(side.kind)
        return ElementBlock(
            f"{self.name}: {side.kind} on {kind}, point {q + 1}",
            self.kernels[side.kind, kind],
            self.points[nodes].reshape(n, width),
            np.ascontiguousarray(dofs),
            np.concatenate([side.rho[found.points][:, None], found.start], axis=1),
            rule=Rule(points[q : q + 1].copy(), weights[q : q + 1].copy()),
            check_orientation=False,
        )


def _rule(kind: str) -> tuple[Array, Array]:
    return CELLS[kind].rule(4)


def _tangents(cell: Cell, corners: Array, at: Array) -> Array:
    """Slopes (n, 3, 2) of faces with these corners (n, k, 3), each at its parent place (n, 2)."""
    return np.asarray(np.einsum("nkd,nkc->ncd", cell.gradient(at), corners))


def _normals(cell: Cell, corners: Array, at: Array) -> Array:
    """Unit normals (n, 3), each at its parent place (n, 2)."""
    slopes = _tangents(cell, corners, at)
    across = np.cross(slopes[:, :, 0], slopes[:, :, 1])
    length = np.linalg.norm(across, axis=1, keepdims=True)
    return np.asarray(across / np.maximum(length, 1e-300))


def _looked(cell: Cell, corners: Array, point: Array, normal: Array) -> tuple[Array, Flags]:
    """Parent coordinates and distance (n, 3) at which lines from points along normals meet faces,
    and whether they do, inside.
    """
    start = np.zeros((len(point), 3))
    start[:, :2] = cell.nodes.mean(axis=0)
    step = np.full((len(point), 3), np.inf)
    with np.errstate(all="ignore"):
        for _ in range(_ITERATIONS):
            place = np.einsum("nk,nkc->nc", cell.shape(start[:, :2]), corners)
            K = np.concatenate(
                [_tangents(cell, corners, start[:, :2]), -normal[:, :, None]], axis=2
            )
            regular = np.abs(np.linalg.det(K)) > 0.0
            K[~regular] = np.eye(3)
            step = np.linalg.solve(K, (point + start[:, 2:] * normal - place)[:, :, None])[:, :, 0]
            start += np.clip(step, -1e3, 1e3)
            if np.abs(step[:, :2]).max(initial=0.0) < 1e-14:
                break
    x, y = start[:, 0], start[:, 1]
    if cell.corners == 4:
        inside = (np.abs(start[:, :2]) <= 1.0 + _EDGE).all(axis=1)
    else:
        inside = (x >= -_EDGE) & (y >= -_EDGE) & (x + y <= 1.0 + _EDGE)
    return start, inside & regular & (np.abs(step[:, :2]).max(axis=1, initial=0.0) < 1e-9)
