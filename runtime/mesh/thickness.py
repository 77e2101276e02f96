"""How thick a body is beneath its boundary."""

from __future__ import annotations

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mesh.mesh import Faces

_OPPOSITE, _BENEATH = -0.5, 0.5  # cosines: which faces look the other way, and lie below


def thickness(points: Array, boundary: Faces, faces: Integers) -> Array:
    """Distance (n,) from lines (n, k) on the boundary of plane bodies to the nearest line of it
    that lies beneath and looks the other way; infinite where there is none.
    """
    every = np.concatenate([np.empty((0, 2), dtype=np.int64), *(f[:, :2] for f in boundary.values())])
    far, out = _centres_and_normals(points[every])
    found = np.full(len(faces), np.inf)
    for k, (x, n) in enumerate(zip(*_centres_and_normals(points[faces[:, :2]]), strict=True)):
        across = x - far
        distance = np.linalg.norm(across, axis=1)
        meant = (out @ n < _OPPOSITE) & (across @ n > _BENEATH * distance)
        found[k] = distance[meant].min(initial=np.inf)
    return found


def in_chains(lines: Integers) -> Integers:
    """Lines (n, k), each from its first node to its second, in the order of the chains they form."""
    at = {int(a): k for k, a in enumerate(lines[:, 0])}
    inner = np.isin(lines[:, 0], lines[:, 1])
    order: dict[int, None] = {}
    for first in [*np.flatnonzero(~inner).tolist(), *range(len(lines))]:
        k: int | None = first
        while k is not None and k not in order:
            order[k] = None
            k = at.get(int(lines[k, 1]))
    return np.asarray(lines[list(order)])


def _centres_and_normals(ends: Array) -> tuple[Array, Array]:
    """Of lines with ends (n, 2, 2), seen with their body on the left: outward, of length one."""
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    return ends.mean(axis=1), np.stack([along[:, 1], -along[:, 0]], axis=1) / length
