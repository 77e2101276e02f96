"""Quadrilaterals divided into k by k smaller ones, their nodes on given curves at the border."""

from __future__ import annotations

import numpy as np

from softehl.runtime.arrays import Array, Flags, Integers


def subdivided(
    points: Array, quads: Integers, loop: Integers, curve: Array, k: int
) -> tuple[Array, Integers, Integers]:
    """Points (n', 2), quadrilaterals (q k^2, 4) and border (m k,) of a mesh divided k by k.

    points: (n, 2), of which the first n of the result are these. loop: (m,) nodes of a closed
    border. curve: (m k, 2) points of the finer border, every k-th of them at its nodes. Sides are
    straight but at the border; inside nodes lie by transfinite interpolation.
    """
    sides = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, which = np.unique(sides, axis=0, return_inverse=True)
    t = np.arange(k + 1)[:, None] / k
    edge_points = (1 - t) * points[edges[:, :1]] + t * points[edges[:, 1:]]  # (e, k + 1, 2)
    inner = len(points) + np.arange(len(edges) * (k - 1)).reshape(len(edges), k - 1)
    numbers = np.concatenate([edges[:, :1], inner, edges[:, 1:]], axis=1)
    following = np.roll(loop, -1)
    at = _rows(edges, np.sort(np.stack([loop, following], axis=1), axis=1))
    runs = curve[(np.arange(len(loop))[:, None] * k + np.arange(k + 1)) % len(curve)]
    forward = (loop < following)[:, None]
    edge_points[at] = np.where(forward[..., None], runs, runs[:, ::-1])
    border = np.where(forward, numbers[at], numbers[at][:, ::-1])[:, :-1].ravel()
    sides_of = which.reshape(-1, 4)
    turned: Flags = quads > np.roll(quads, -1, axis=1)
    grid, middle = _grids(numbers, edge_points, sides_of, turned)
    first = len(points) + inner.size
    if k > 1:
        grid[:, 1:-1, 1:-1] = first + np.arange(len(quads) * (k - 1) ** 2).reshape(-1, k - 1, k - 1)
    cells = np.stack([grid[:, :-1, :-1], grid[:, :-1, 1:], grid[:, 1:, 1:], grid[:, 1:, :-1]], -1)
    moved = points.copy()
    moved[loop] = curve[::k]
    every = np.concatenate([moved, edge_points[:, 1:-1].reshape(-1, 2), middle.reshape(-1, 2)])
    return every, cells.reshape(-1, 4), border


def _rows(table: Integers, rows: Integers) -> Integers:
    """Places of rows (m, 2) in a sorted table (e, 2) that holds them."""
    base = int(table.max()) + 1
    return np.searchsorted(table[:, 0] * base + table[:, 1], rows[:, 0] * base + rows[:, 1])


def _grids(
    numbers: Integers, points: Array, sides: Integers, turned: Flags
) -> tuple[Integers, Array]:
    """Node numbers (q, k + 1, k + 1), the borders of them set, and inner points (q, (k-1)^2, 2)."""
    q, k = len(sides), numbers.shape[1] - 1
    run = [np.where(turned[:, i, None], numbers[sides[:, i], ::-1], numbers[sides[:, i]])
           for i in range(4)]  # fmt: skip
    path = [np.where(turned[:, i, None, None], points[sides[:, i], ::-1], points[sides[:, i]])
            for i in range(4)]  # fmt: skip
    grid = np.zeros((q, k + 1, k + 1), dtype=np.int64)
    grid[:, 0], grid[:, :, -1], grid[:, -1], grid[:, :, 0] = (
        run[0], run[1], run[2][:, ::-1], run[3][:, ::-1],
    )  # fmt: skip
    bottom, right, top, left = path[0], path[1], path[2][:, ::-1], path[3][:, ::-1]
    s = (np.arange(k + 1) / k)[None, None, :, None]
    t = (np.arange(k + 1) / k)[None, :, None, None]
    lines = (1 - t) * bottom[:, None] + t * top[:, None]
    lines = lines + (1 - s) * left[:, :, None] + s * right[:, :, None]
    low = (1 - s) * bottom[:, None, :1] + s * bottom[:, None, -1:]
    high = (1 - s) * top[:, None, :1] + s * top[:, None, -1:]
    block = lines - (1 - t) * low - t * high
    return grid, block[:, 1:-1, 1:-1]
