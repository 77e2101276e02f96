"""Near null space of a free body, which multigrid must keep."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from softehl.runtime.arrays import Array


def is_vector(names: Sequence[str], dimension: int) -> bool:
    """True if names are the components of one vector along all coordinates, in their order."""
    stems = {name.rpartition("_")[0] for name in names}
    axes = "".join(name.rpartition("_")[2] for name in names)
    return len(stems) == 1 and axes == "xyz"[:dimension]


def rigid_body_modes(points: Array, names: Sequence[str]) -> Array:
    """Translations of each unknown at points (n, dim), and rotations of displacements.

    (n len(names), k), node by node, of size 1.
    """
    n, dim = points.shape
    offsets = points - points.mean(axis=0)
    offsets /= float(np.abs(offsets).max(initial=0.0)) or 1.0
    turned = is_vector(names, dim)
    pairs = [(i, j) for i in range(dim) for j in range(i)] if turned else []
    width = len(names)
    modes = np.zeros((n, width, width + len(pairs)))
    modes[:, range(width), range(width)] = 1.0
    for k, (i, j) in enumerate(pairs, start=width):
        modes[:, i, k], modes[:, j, k] = offsets[:, j], -offsets[:, i]
    return modes.reshape(n * width, -1)
