"""Thickness of a body beneath its boundary."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mesh.mesh import Faces

_ASKEW = np.array([0.2, 0.5, 0.84])
_OPPOSITE, _BENEATH = -0.5, 0.5  # cosines: which faces look the other way, and lie below


def thickness(points: Array, boundary: Faces, faces: Integers) -> Array:
    """Distance (n,) from faces (n, k) of a boundary to the nearest face of it that lies beneath
    and looks the other way; infinite where there is none.
    """
    thicknesses = np.full(len(faces), np.inf)
    for k, (below, distance, cosine) in enumerate(_beneath(points, boundary, faces)):
        opposite = (cosine < _OPPOSITE) & (below > _BENEATH * distance)
        thicknesses[k] = distance[opposite].min(initial=np.inf)
    return thicknesses


def inner_radii(points: Array, boundary: Faces, faces: Integers) -> Array:
    """Radius (n,) of the largest circle inside that touches each line from within: half of the
    thickness, and towards a corner of the body less and less.
    """
    radii = np.full(len(faces), np.inf)
    for k, (below, distance, _) in enumerate(_beneath(points, boundary, faces)):
        mask = below > 1e-9 * distance
        radii[k] = (distance[mask] ** 2 / (2.0 * below[mask])).min(initial=np.inf)
    return radii


def _beneath(
    points: Array, boundary: Faces, faces: Integers
) -> Iterator[tuple[Array, Array, Array]]:
    """For each face, of all faces of the boundary: how far they lie beneath, their distance, and
    the cosine between both normals; (m,) each.
    """
    parts = [_centres_and_normals(points, f) for f in boundary.values() if len(f)]
    far, out = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
    for x, n in zip(*_centres_and_normals(points, faces), strict=True):
        across = x - far
        yield across @ n, np.linalg.norm(across, axis=1), out @ n


def in_chains(lines: Integers) -> Integers:
    """Lines (n, k), each from its first to its second node, in the order of their chains."""
    at = {int(a): k for k, a in enumerate(lines[:, 0])}
    inner = np.isin(lines[:, 0], lines[:, 1])
    order: dict[int, None] = {}
    for first in [*np.flatnonzero(~inner).tolist(), *range(len(lines))]:
        k: int | None = first
        while k is not None and k not in order:
            order[k] = None
            k = at.get(int(lines[k, 1]))
    return np.asarray(lines[list(order)])


def by_normals(points: Array, faces: Integers) -> Integers:
    """Faces (n, k) in the order of their normals along a direction that no mesh is built along:
    two that face each other are far apart in it, neighbours are not.
    """
    normals = _centres_and_normals(points, faces)[1]
    return np.asarray(faces[np.argsort(normals @ _ASKEW, kind="stable")])


def _centres_and_normals(points: Array, faces: Integers) -> tuple[Array, Array]:
    """Of lines or faces (n, k) as their body has them; normals look outward, of length one."""
    if points.shape[1] == 2:
        end_points = points[faces[:, :2]]
        along = end_points[:, 1] - end_points[:, 0]
        across = np.stack([along[:, 1], -along[:, 0]], axis=1)
    else:
        end_points = points[faces[:, : 4 if faces.shape[1] in (4, 8, 9) else 3]]
        across = np.cross(end_points[:, 1] - end_points[:, 0], end_points[:, -1] - end_points[:, 0])
    return end_points.mean(axis=1), across / np.linalg.norm(across, axis=1, keepdims=True)
