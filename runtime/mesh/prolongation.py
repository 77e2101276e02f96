"""From a mesh to the one of twice its density, and back: nodal, element and chain values.

The nodes of both meshes are images of index space under one mapping (`mesh.sections`), so that
values are interpolated in the indices of each of its five blocks. `long` is that of the disc.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.interpolate import make_interp_spline

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mesh.sections import LAYERS, LONG, SHORT


def node_blocks(density: int, long: int = LONG) -> list[Integers]:
    """Node numbers of the blocks as grids: bottom, right, top and left layers, then the centre.

    Blocks share the nodes at which they meet.
    """
    long, short, layers = long * density, SHORT * density, LAYERS * density
    around = 2 * (long + short)
    rings = np.arange(layers * around).reshape(layers, around)
    centre = layers * around + np.arange((short + 1) * (long + 1)).reshape(short + 1, long + 1)
    inner = [centre[0, :-1], centre[:-1, -1], centre[-1, :0:-1], centre[:0:-1, 0]]
    rings = np.concatenate([rings, np.concatenate(inner)[None]])
    rings = np.concatenate([rings, rings[:, :1]], axis=1)
    ends = np.cumsum([0, long, short, long, short])
    return [rings[:, a : b + 1] for a, b in pairwise(ends)] + [centre]


def prolong_nodes(values: Array, density: int, long: int = LONG) -> Array:
    """Nodal values (V', k) at twice the density from those, (V, k), at `density`: cubic splines."""
    coarse, fine = node_blocks(density, long), node_blocks(2 * density, long)
    result = np.empty((max(int(block.max()) for block in fine) + 1, values.shape[1]))
    for old, new in zip(coarse, fine, strict=True):
        result[new] = _halve(_halve(values[old], axis=0), axis=1)
    return result


def restrict_nodes(values: Array, density: int, long: int = LONG) -> Array:
    """Nodal values (V', k) at half the density from those, (V, k), at an even `density`."""
    coarse, fine = node_blocks(density // 2, long), node_blocks(density, long)
    result = np.empty((max(int(block.max()) for block in coarse) + 1, values.shape[1]))
    for new, old in zip(coarse, fine, strict=True):
        result[new] = values[old[::2, ::2]]
    return result


def restrict_elements(values: Array, density: int, long: int = LONG) -> Array:
    """Element values (Q',) at half the density, means of four of those, (Q,), at `density`."""
    long, short, layers = long * density, SHORT * density, LAYERS * density
    around = 2 * (long + short)
    grids = (
        values[: layers * around].reshape(layers, -1),
        values[layers * around :].reshape(short, -1),
    )
    return np.concatenate([_fours(grid).ravel() for grid in grids])


def _fours(grid: Array) -> Array:
    """Means of two by two cells."""
    rows, columns = grid.shape
    return np.asarray(grid.reshape(rows // 2, 2, columns // 2, 2).mean(axis=(1, 3)))


def _halve(values: Array, axis: int) -> Array:
    """Cubic spline through values at the integers, taken at the halves."""
    count = values.shape[axis]
    order = min(3, count - 1)
    spline = make_interp_spline(np.arange(count), values, k=order, axis=axis)
    return np.asarray(spline(np.arange(2 * count - 1) / 2.0))


def prolong_elements(values: Array, density: int, long: int = LONG) -> Array:
    """Element values (Q',) at twice the density from those, (Q,), at `density`: bilinear."""
    long, short, layers = long * density, SHORT * density, LAYERS * density
    around = 2 * (long + short)
    ring = values[: layers * around].reshape(layers, around)
    ring = np.concatenate([ring[:, -1:], ring, ring[:, :1]], axis=1)  # it closes upon itself
    outer = _split(_split(ring, 0), 1)[:, 2:-2]
    centre = _split(_split(values[layers * around :].reshape(short, long), 0), 1)
    return np.concatenate([outer.ravel(), centre.ravel()])


def _split(values: Array, axis: int) -> Array:
    """Values of cells at the centres of their halves; constant beyond the outermost centres."""
    count = values.shape[axis]
    at = np.clip((np.arange(2 * count) + 0.5) / 2.0 - 0.5, 0.0, count - 1.0)
    left = np.minimum(at.astype(np.int64), max(count - 2, 0))
    right = np.minimum(left + 1, count - 1)
    shape = [1, 1]
    shape[axis] = -1
    part = (at - left).reshape(shape)
    return np.asarray((1 - part) * values.take(left, axis) + part * values.take(right, axis))


def prolong_chain(values: Array) -> Array:
    """Values (2 n - 1,) at the nodes and middles of a chain from those, (n,), at its nodes."""
    result = np.empty(2 * len(values) - 1)
    result[::2] = values
    result[1::2] = 0.5 * (values[:-1] + values[1:])
    return result


def restrict_chain(values: Array) -> Array:
    """Values (n,) at every other node of a chain, from those, (2 n - 1,), at all of them."""
    return values[::2].copy()


def prolong_loop(values: Array) -> Array:
    """Values (2 n,) at the nodes and middles of a closed chain from those, (n,), at its nodes."""
    return prolong_chain(np.append(values, values[:1]))[:-1]
