"""Places of points in a mesh of quadrilaterals: the cell of each, and its place in the cell."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from softehl.runtime.arrays import Array, Integers

_NEIGHBOURS = (8, 8, 32, 128)  # cells looked at, by their middles, until one holds the point
_ITERATIONS = 8
_WITHIN = 1e-12  # of the size of the mesh: a point so near to a cell is in it
_FURTHEST = 4.0  # parent coordinates up to which values are extrapolated
CORNERS = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
"""Parent coordinates of the corners of a quadrilateral."""


def shapes(at: Array) -> Array:
    """Bilinear shape functions (n, 4) at parent points (n, 2)."""
    return np.asarray(0.25 * (1.0 + CORNERS[:, 0] * at[:, :1]) * (1.0 + CORNERS[:, 1] * at[:, 1:]))


def located(points: Array, quads: Integers, at: Array) -> tuple[Integers, Array]:
    """The quadrilateral (n,) of each point at (n, 2), and the parent coordinates (n, 2) there.

    A point outside belongs to the nearest one; its coordinates are beyond 1, by up to a cell and a
    half.
    """
    corners = points[quads]
    tree, low, high = cKDTree(corners.mean(axis=1)), corners.min(axis=1), corners.max(axis=1)
    cell, parent = np.zeros(len(at), dtype=np.int64), np.zeros((len(at), 2))
    within = _WITHIN * float(np.ptp(points, axis=0).max())
    left, best = np.arange(len(at)), np.full(len(at), np.inf)
    most = within  # at first only cells that hold a point
    for count in _NEIGHBOURS:
        near = tree.query(at[left], k=min(count, len(quads)))[1].reshape(len(left), -1)
        x = at[left][:, None]
        beside = np.maximum(np.maximum(low[near] - x, x - high[near]), 0.0)  # of the box of a cell
        row, slot = np.nonzero(_length(beside) <= np.minimum(best[left], most)[:, None])
        corner, point = corners[near[row, slot]], at[left[row]]
        away, xi = np.full(near.shape, np.inf), np.zeros((*near.shape, 2))
        inside = _inverse(corner, point)
        feet = np.einsum("na,nad->nd", shapes(np.clip(inside, -1.0, 1.0)), corner)
        away[row, slot], xi[row, slot] = _length(feet - point), inside
        rows, first = np.arange(len(left)), away.argmin(axis=1)
        better = away[rows, first] < np.minimum(best[left], np.nextafter(most, np.inf))
        chosen = left[better]
        cell[chosen] = near[rows, first][better]
        parent[chosen] = xi[rows, first][better]
        best[chosen] = away[rows, first][better]
        left, most = left[best[left] > within], np.inf
        if not len(left):
            break
    return cell, np.clip(parent, -_FURTHEST, _FURTHEST)


def _length(x: Array) -> Array:
    return np.asarray(np.sqrt(x[..., 0] ** 2 + x[..., 1] ** 2))


def interpolated(
    points: Array, quads: Integers, values: Array, at: Array, reach: float = 1.0
) -> Array:
    """Nodal values (V, k) at points at (n, 2), bilinear in the cells: (n, k).

    reach: parent coordinates up to which a point outside is extrapolated to.
    """
    cell, parent = located(points, quads, at)
    weights = shapes(np.clip(parent, -reach, reach))
    return np.asarray(np.einsum("na,nak->nk", weights, values[quads[cell]]))


def _inverse(x: Array, at: Array) -> Array:
    """Parent coordinates (n, 2) of points (n, 2) in cells with corners x (n, 4, 2)."""
    a = x.mean(axis=1)
    b, c, d = (
        np.einsum("a,nad->nd", signs, x) / 4.0 for signs in (*CORNERS.T, CORNERS.prod(axis=1))
    )
    xi = np.zeros((len(x), 2))
    for _ in range(_ITERATIONS):
        s, t = xi[:, :1], xi[:, 1:]
        miss = at - (a + b * s + c * t + d * s * t)
        u, v = b + d * t, c + d * s
        det = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
        det = np.where(np.abs(det) > 1e-300, det, 1e-300)
        step_s = (miss[:, 0] * v[:, 1] - miss[:, 1] * v[:, 0]) / det
        step_t = (u[:, 0] * miss[:, 1] - u[:, 1] * miss[:, 0]) / det
        xi = np.clip(xi + np.stack([step_s, step_t], axis=-1), -1e3, 1e3)
    return xi
