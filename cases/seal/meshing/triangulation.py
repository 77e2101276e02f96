"""Triangles in a polygon, graded from its edges inwards: Delaunay refinement, then relaxation.

The edges of the polygon stay as they are. Points go into the middles of the circles around
triangles that are too large or too flat (Chew, Guaranteed-quality triangular meshes, 1989), unless
they come too close to an edge; then every point moves to the middle of its neighbours.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import Delaunay

from softehl.cases.seal.meshing.outline_checks import cross
from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.mesh.mesh import MeshError

GRADE = 0.35
"""Growth of the size of triangles with the distance from the edges."""

_ROUNDS, _SWEEPS = 80, 12
_LARGE = 0.75  # radius of the circle around a triangle, of the size wanted, that is too large
_FLAT = 1.25  # the same of the shortest side: angles below 23 degrees
_CLEAR = 1.1  # radius about the middle of an edge, in halves of it, that points keep away from


def triangulate(polygon: Array, largest: float) -> tuple[Array, Integers]:
    """Points (n, 2), those of the polygon (m, 2) first, and triangles (t, 3), counterclockwise.

    polygon: counterclockwise, without crossings. largest: longest side inside, mm. Raises MeshError
    where edges of the polygon are too long for what faces them.
    """
    field = _Field(polygon, largest)
    points = polygon
    for _ in range(_ROUNDS):
        more = _centres_wanted(points, field)
        if not len(more):
            break
        points = np.concatenate([points, more])
    for _ in range(_SWEEPS):
        points = _relaxed(points, field)
    triangles = field.inside_triangles(points)
    used = np.unique(triangles)
    if not np.array_equal(used, np.arange(len(points))):
        points, triangles = points[used], np.searchsorted(used, triangles)
    _require_edges(len(polygon), triangles)
    return points, triangles


class _Field:
    """The polygon, and the size of triangles wanted at a point."""

    def __init__(self, polygon: Array, largest: float) -> None:
        self.polygon, self.largest = polygon, largest
        self.after = np.roll(polygon, -1, axis=0)
        self.middles = 0.5 * (polygon + self.after)
        self.lengths = np.linalg.norm(self.after - polygon, axis=1)

    def size(self, at: Array) -> Array:
        """(n,) lengths of sides wanted at points (n, 2)."""
        away = np.linalg.norm(at[:, None] - self.middles[None], axis=2)
        return np.asarray(np.minimum(self.largest, (self.lengths + GRADE * away).min(axis=1)))

    def clear(self, at: Array) -> Flags:
        """Which points (n,) are inside and not too close to an edge."""
        away = np.linalg.norm(at[:, None] - self.middles[None], axis=2)
        clear_of_boundary: Flags = (away > 0.5 * _CLEAR * self.lengths).all(axis=1)
        return self.inside(at) & clear_of_boundary

    def inside(self, at: Array) -> Flags:
        """Which points (n,) are inside the polygon."""
        z, r = at[:, None, 0], at[:, None, 1]
        a, b = self.polygon, self.after
        crosses = (a[:, 1] > r) != (b[:, 1] > r)
        rise = np.where(a[:, 1] == b[:, 1], 1.0, b[:, 1] - a[:, 1])
        left = z < a[:, 0] + (r - a[:, 1]) * (b[:, 0] - a[:, 0]) / rise
        return np.asarray((crosses & left).sum(axis=1) % 2 == 1)

    def inside_triangles(self, points: Array) -> Integers:
        """Delaunay triangles (t, 3) of points whose middles are inside, counterclockwise."""
        triangles = Delaunay(points).simplices.astype(np.int64)
        x = points[triangles]
        area = cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
        triangles[area < 0.0] = triangles[area < 0.0][:, ::-1]
        inside = self.inside(x.mean(axis=1)) & (np.abs(area) > 1e-14 * np.abs(area).max())
        return np.asarray(triangles[inside])


def _circles(x: Array) -> tuple[Array, Array]:
    """Middles (t, 2) and radii (t,) of the circles around triangles with corners x (t, 3, 2)."""
    b, c = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    bb, cc = (b**2).sum(axis=1), (c**2).sum(axis=1)
    middle = np.stack([c[:, 1] * bb - b[:, 1] * cc, b[:, 0] * cc - c[:, 0] * bb], axis=1)
    middle /= 2.0 * cross(b, c)[:, None]
    return x[:, 0] + middle, np.linalg.norm(middle, axis=1)


def _centres_wanted(points: Array, field: _Field) -> Array:
    """Points (k, 2) to be added, the middles of the worst triangles, far from one another."""
    x = points[field.inside_triangles(points)]
    centres, radii = _circles(x)
    shortest = np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2).min(axis=1)
    badness = np.maximum(radii / (_LARGE * field.size(x.mean(axis=1))), radii / (_FLAT * shortest))
    requested = (badness > 1.0) & field.clear(centres)
    centres, radii, badness = centres[requested], radii[requested], badness[requested]
    selected: list[int] = []
    for k in np.argsort(-badness, kind="stable"):
        away = np.linalg.norm(centres[selected] - centres[k], axis=1)
        if (away > radii[k]).all():
            selected.append(int(k))
    return np.asarray(centres[selected])


def _relaxed(points: Array, field: _Field) -> Array:
    """Inner points moved to the middle of their neighbours, where that keeps clear of edges."""
    triangles, fixed = field.inside_triangles(points), len(field.polygon)
    pairs = np.concatenate([triangles, np.roll(triangles, 1, axis=1)]).reshape(2, -1).T
    pairs = np.unique(np.concatenate([pairs, pairs[:, ::-1]]), axis=0)
    count = np.maximum(np.bincount(pairs[:, 0], minlength=len(points)), 1)
    sums = [np.bincount(pairs[:, 0], points[pairs[:, 1], d], len(points)) for d in (0, 1)]
    moved = np.stack(sums, axis=1) / count[:, None]
    keep = ~field.clear(moved)
    keep[:fixed] = True
    return np.where(keep[:, None], points, moved)


def _require_edges(count: int, triangles: Integers) -> None:
    """That every edge of the polygon is a side of one triangle, and nothing else is a border."""
    sides = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    edges_present = {(int(a), int(b)) for a, b in sides}
    border = {(a, b) for a, b in edges_present if (b, a) not in edges_present}
    missing = {(k, (k + 1) % count) for k in range(count)} ^ border
    if missing:
        raise MeshError(
            f"no triangles fit {len(missing)} of {count} edges of a polygon: they are too long for "
            "what faces them; more nodes are needed there"
        )
