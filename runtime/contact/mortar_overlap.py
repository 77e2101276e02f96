"""Mortar overlap of two faces in 3-D, projected along the mean normal of the first: triangles.

Corners of the part are corners of the face, corners of the other one, or where their edges cross.
Each is told in a way that says how it moves with the nodes: parent coordinates xi + A v on the face
and eta + B v on the other, with the v for which both places lie on a line along the normal. A = 0
is a corner of the face, B = 0 one of the other; a column of each belongs to a crossing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.mesh.cells import Cell

CORNER = 12
"""Numbers that tell a corner: xi (2), A (2, 2) by columns, eta (2), B (2, 2) by columns."""
_ON = 1e-10  # of the length of an edge: a corner that is no further outside lies in a face
_ITERATIONS = 10


@dataclass(frozen=True, eq=False)
class Triangles:
    """pairs: number of the pair that each belongs to, (n,). corners: (n, 3, CORNER)."""

    pairs: Integers
    corners: Array


def common_part(one: Cell, one_corners: Array, other: Cell, other_corners: Array) -> Triangles:
    """Overlap of pairs of opposite faces with corners (n, a, 3) and (n, b, 3)."""
    a, b = one.corners, other.corners
    plane = _plane(one, one_corners[:, :a])
    S, M = (np.einsum("nkc,ncd->nkd", x, plane) for x in (one_corners[:, :a], other_corners[:, :b]))
    inside, within = _inside(S, M[:, ::-1]), _inside(M, S)
    alpha, beta, crosses = _crossings(S, M)
    n = len(one_corners)
    motion = np.zeros((n, a + b + a * b, CORNER))
    motion[:, :a, :2], motion[:, :a, 6:8] = one.nodes[:a], other.nodes[:b].mean(axis=0)
    motion[:, :a, [8, 11]] = 1.0
    motion[:, a : a + b, :2], motion[:, a : a + b, 6:8] = parents(one, S, M), other.nodes[:b]
    motion[:, a : a + b, [2, 5]] = 1.0
    along, across = (
        np.roll(c.nodes[:k], -1, axis=0) - c.nodes[:k] for c, k in ((one, a), (other, b))
    )
    i, j = (v.ravel() for v in np.indices((a, b)))
    motion[:, a + b :, :2] = one.nodes[i] + alpha[:, :, None] * along[i]
    motion[:, a + b :, 6:8] = other.nodes[j] + beta[:, :, None] * across[j]
    motion[:, a + b :, 2:4], motion[:, a + b :, 10:12] = along[i], across[j]
    points = np.concatenate(
        [S, M, S[:, i] + alpha[:, :, None] * (np.roll(S, -1, axis=1) - S)[:, i]], axis=1
    )
    valid = _once(points, np.concatenate([inside, within, crosses], axis=1), S)
    return _fan(points, valid, motion)


def parents(cell: Cell, corners: Array, queries: Array) -> Array:
    """Parent coordinates (n, m, 2) in faces with flat corners (n, k, 2) of places (n, m, 2)."""
    n, m = queries.shape[:2]
    xi = np.tile(cell.nodes[: cell.corners].mean(axis=0), (n * m, 1))
    x, target = np.repeat(corners, m, axis=0), queries.reshape(n * m, 2)
    flat = cell.linear
    with np.errstate(all="ignore"):
        for _ in range(1 if cell.corners == 3 else _ITERATIONS):
            error = target - np.einsum("nk,nkc->nc", flat.shape(xi), x)
            K = np.einsum("nkd,nkc->ncd", flat.gradient(xi), x)
            det = K[:, 0, 0] * K[:, 1, 1] - K[:, 0, 1] * K[:, 1, 0]
            step = np.stack(
                [
                    K[:, 1, 1] * error[:, 0] - K[:, 0, 1] * error[:, 1],
                    K[:, 0, 0] * error[:, 1] - K[:, 1, 0] * error[:, 0],
                ],
                axis=1,
            )
            xi = xi + np.clip(np.nan_to_num(step / det[:, None]), -10.0, 10.0)
    return xi.reshape(n, m, 2)


def mean_normal(cell: Cell, corners: Array) -> Array:
    """Unit normals (n, 3) in the middle of faces with corners (n, k, 3)."""
    middle = cell.nodes[: cell.corners].mean(axis=0)[None]
    gradient = np.einsum("kd,nkc->ncd", cell.linear.gradient(middle)[0], corners[:, : cell.corners])
    across = np.cross(gradient[:, :, 0], gradient[:, :, 1])
    return np.asarray(across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300))


def _plane(cell: Cell, corners: Array) -> Array:
    """Two directions across the mean normal, (n, 3, 2), right-handed with it."""
    normal = mean_normal(cell, corners)
    first = corners[:, 1] - corners[:, 0]
    first = first - np.einsum("nc,nc->n", first, normal)[:, None] * normal
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-300)
    return np.stack([first, np.cross(normal, first)], axis=2)


def _inside(points: Array, polygon: Array) -> Flags:
    """True for points (n, k, 2) in convex polygons (n, m, 2) that go round counterclockwise."""
    edge = np.roll(polygon, -1, axis=1) - polygon
    length = np.maximum(np.linalg.norm(edge, axis=2), 1e-300)
    offsets = points[:, :, None] - polygon[:, None]
    left = edge[:, None, :, 0] * offsets[..., 1] - edge[:, None, :, 1] * offsets[..., 0]
    return np.asarray((left >= -_ON * (length**2)[:, None]).all(axis=2))


def _crossings(S: Array, M: Array) -> tuple[Array, Array, Flags]:
    """Shares (n, a b) of the edges of both at which they cross, and whether they do."""
    n, a, b = len(S), S.shape[1], M.shape[1]
    e, f = (np.roll(x, -1, axis=1) - x for x in (S, M))
    e, f, offsets = e[:, :, None], f[:, None], M[:, None] - S[:, :, None]
    det = e[..., 0] * f[..., 1] - e[..., 1] * f[..., 0]
    size = np.linalg.norm(e, axis=3) * np.linalg.norm(f, axis=3)
    crossing = np.abs(det) > _ON * size
    det = np.where(crossing, det, 1.0)
    alpha = (offsets[..., 0] * f[..., 1] - offsets[..., 1] * f[..., 0]) / det
    beta = (offsets[..., 0] * e[..., 1] - offsets[..., 1] * e[..., 0]) / det
    for share in (alpha, beta):
        crossing &= (share > _ON) & (share < 1.0 - _ON)
    alpha, beta = (np.where(crossing, v, 0.0).reshape(n, a * b) for v in (alpha, beta))
    return alpha, beta, crossing.reshape(n, a * b)


def _once(points: Array, valid: Flags, S: Array) -> Flags:
    """True for points that do not repeat an earlier one."""
    size = np.linalg.norm(S - S.mean(axis=1, keepdims=True), axis=2).max(axis=1)
    away = np.abs(points[:, :, None] - points[:, None]).max(axis=3) > 2 * _ON * size[:, None, None]
    away |= ~valid[:, None, :]
    earlier = np.tri(points.shape[1], k=-1, dtype=bool)
    return np.asarray(valid & (away | ~earlier).all(axis=2))


def _fan(points: Array, valid: Flags, motion: Array) -> Triangles:
    """Triangles of the convex hull of the valid points of each pair."""
    count = valid.sum(axis=1)
    mean = (points * valid[:, :, None]).sum(axis=1) / np.maximum(count, 1)[:, None]
    offsets = points - mean[:, None]
    angle = np.where(valid, np.arctan2(offsets[..., 1], offsets[..., 0]), np.inf)
    order = np.argsort(angle, axis=1, kind="stable")
    pairs, corners = [], []
    for k in range(1, max(int(count.max(initial=0)) - 1, 1)):
        pair = np.flatnonzero(count > k + 1)
        triangle = order[pair][:, [0, k, k + 1]]
        pairs.append(pair)
        corners.append(motion[pair[:, None], triangle])
    pair_numbers = np.concatenate([np.empty(0, np.int64), *pairs])
    sort = np.argsort(pair_numbers, kind="stable")
    return Triangles(pair_numbers[sort], np.concatenate([np.empty((0, 3, CORNER)), *corners])[sort])
