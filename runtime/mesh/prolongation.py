"""From a mesh to one of another density of it: nodal, element and chain values.

The nodes of both meshes are images of index space under one mapping (`mesh.sections`), so that
values are interpolated in the indices of each of its five blocks. `parts` are those of the disc.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from scipy.interpolate import make_interp_spline

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mesh.sections import LAYERS, LONG, SHORT

Parts: TypeAlias = tuple[int, int, int]

PARTS: Parts = LONG, SHORT, LAYERS


def node_blocks(density: int | Fraction, parts: Parts = PARTS) -> list[Integers]:
    """Node numbers of the blocks as grids: bottom, right, top and left layers, then the centre.

    Blocks share the nodes at which they meet.
    """
    long, short, layers = (int(n * density) for n in parts)
    around = 2 * (long + short)
    rings = np.arange(layers * around).reshape(layers, around)
    centre = layers * around + np.arange((short + 1) * (long + 1)).reshape(short + 1, long + 1)
    inner = [centre[0, :-1], centre[:-1, -1], centre[-1, :0:-1], centre[:0:-1, 0]]
    rings = np.concatenate([rings, np.concatenate(inner)[None]])
    rings = np.concatenate([rings, rings[:, :1]], axis=1)
    ends = np.cumsum([0, long, short, long, short])
    return [rings[:, a : b + 1] for a, b in pairwise(ends)] + [centre]


def prolong_nodes(values: Array, density: int, parts: Parts = PARTS) -> Array:
    """Nodal values (V', k) at twice the density from those, (V, k), at `density`."""
    return resampled_nodes(values, density, 2 * density, parts)


def resampled_nodes(
    values: Array, old: int | Fraction, new: int | Fraction, parts: Parts = PARTS
) -> Array:
    """Nodal values (V', k) at a density from those, (V, k), at another one: cubic splines."""
    before, after = node_blocks(old, parts), node_blocks(new, parts)
    result = np.empty((max(int(block.max()) for block in after) + 1, values.shape[1]))
    for given, wanted in zip(before, after, strict=True):
        along = _splined(values[given], wanted.shape[0], axis=0)
        result[wanted] = _splined(along, wanted.shape[1], axis=1)
    return result


def resampled_elements(
    values: Array, old: int | Fraction, new: int | Fraction, parts: Parts = PARTS
) -> Array:
    """Element values (Q',) at a density from those, (Q,), at another one: bilinear."""
    long, short, layers = (int(n * old) for n in parts)
    wide, high, deep = (int(n * new) for n in parts)
    around = 2 * (long + short)
    ring = values[: layers * around].reshape(layers, around)
    ring = np.concatenate([ring[:, -1:], ring, ring[:, :1]], axis=1)  # it closes upon itself
    turn = 1.0 + _centres(around, 2 * (wide + high))
    outer = _between(_between(ring, _centres(layers, deep), 0), turn, 1)
    block = values[layers * around :].reshape(short, long)
    centre = _between(_between(block, _centres(short, high), 0), _centres(long, wide), 1)
    return np.concatenate([outer.ravel(), centre.ravel()])


def restrict_nodes(values: Array, density: int, parts: Parts = PARTS) -> Array:
    """Nodal values (V', k) at half the density from those, (V, k), at an even `density`."""
    coarse, fine = node_blocks(density // 2, parts), node_blocks(density, parts)
    result = np.empty((max(int(block.max()) for block in coarse) + 1, values.shape[1]))
    for new, old in zip(coarse, fine, strict=True):
        result[new] = values[old[::2, ::2]]
    return result


def restrict_elements(values: Array, density: int, parts: Parts = PARTS) -> Array:
    """Element values (Q',) at half the density, means of four of those, (Q,), at `density`."""
    long, short, layers = (int(n * density) for n in parts)
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


def _splined(values: Array, new: int, axis: int) -> Array:
    """Cubic spline through values at equal distances, at `new` equally spaced places."""
    count = values.shape[axis]
    spline = make_interp_spline(np.arange(count), values, k=min(3, count - 1), axis=axis)
    return np.asarray(spline(np.arange(new) * (count - 1) / (new - 1)))


def prolong_elements(values: Array, density: int, parts: Parts = PARTS) -> Array:
    """Element values (Q',) at twice the density from those, (Q,), at `density`."""
    return resampled_elements(values, density, 2 * density, parts)


def _centres(old: int, new: int) -> Array:
    """Where the centres of `new` cells are, counted in the centres of `old` ones."""
    return (np.arange(new) + 0.5) * old / new - 0.5


def _between(values: Array, at: Array, axis: int) -> Array:
    """Values of cells, linear between their centres and constant beyond the outermost."""
    count = values.shape[axis]
    at = np.clip(at, 0.0, count - 1.0)
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
