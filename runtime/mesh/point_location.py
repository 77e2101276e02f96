"""Point location: the cells that hold points, and the parent coordinates there.

Cells are found by trees of their centres, one for each kind and size, and by boxes that hold them;
Newton's method inverts their maps, for all pairs of points and cells at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.mesh.cells import CELLS, Cell, lagrange

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

_ITERATIONS = 25
_STEADY = 1e-11  # a smaller step is the last one: that after it would be of its square
_BEYOND = 0.5  # of the parent element: as far outside it Newton's method may go
_CHUNK = 1_000_000  # coordinates of nodes at a time

_Pairs: TypeAlias = tuple[Integers, Integers, Integers, Array]
"""Numbers of kinds, numbers of points, rows of cells and parent coordinates of pairs."""


@dataclass(frozen=True, eq=False)
class Located:
    """Pairs of a point and a cell that holds it, by points, then kinds, then numbers of the cells.

    point: (m,) numbers of the points. kind: (m,) numbers in `kinds`. row: (m,) of that kind.
    parent: (m, 3), of which a cell has as many columns as dimensions.
    """

    kinds: tuple[str, ...]
    point: Integers
    kind: Integers
    row: Integers
    parent: Array

    def by_kind(self) -> Iterator[tuple[str, Integers]]:
        """Each kind, and which pairs (k,) have it."""
        for number, kind in enumerate(self.kinds):
            rows = np.flatnonzero(self.kind == number)
            if len(rows):
                yield kind, rows

    @cached_property
    def first(self) -> Integers:
        """The first pair of each point that has one, (p,)."""
        return np.unique(self.point, return_index=True)[1]


class PointLocator:
    """Cells of a mesh, made ready to be asked which of them hold points.

    points: (n, dim). cells: kind -> nodes (m, k). near: how far a point may be outside a cell that
    holds it. Of cells that hold a point only those of the highest dimension are told.
    """

    def __init__(self, points: Array, cells: Mapping[str, Integers], tolerance: float) -> None:
        self.points, self.cells, self.tolerance = (
            np.asarray(points, dtype=np.float64),
            cells,
            tolerance,
        )
        order = sorted(cells, key=lambda kind: -CELLS[kind].dimension)
        self.kinds = tuple(kind for kind in order if len(cells[kind]))

    @cached_property
    def _sets(self) -> dict[str, list[_Boxes]]:
        return {
            kind: list(_boxes(CELLS[kind], self.points[self.cells[kind]], self.tolerance))
            for kind in self.kinds
        }

    @cached_property
    def _nodes(self) -> cKDTree:
        from scipy.spatial import cKDTree  # late: slow to import

        used = [nodes.ravel() for nodes in self.cells.values()]
        return cKDTree(self.points[np.unique(np.concatenate(used))])

    def holding(self, queries: Array, masks: Mapping[str, Flags] | None = None) -> Located:
        """Cells that hold the places (n, dim), of the chosen ones: kind -> (m,) booleans."""
        queries = np.asarray(queries, dtype=np.float64)
        left, done = np.arange(len(queries)), 0
        pairs: list[_Pairs] = []
        for number, kind in enumerate(self.kinds):
            if CELLS[kind].dimension != done:  # nothing of a lower dimension where a cell is
                done = CELLS[kind].dimension
                for _, point, *_ in pairs:
                    left = np.setdiff1d(left, point)
            point, row = self._candidates(kind, queries[left], np.zeros(len(left)))
            point = left[point]
            if masks is not None:
                in_cells = masks.get(kind, np.zeros(len(self.cells[kind]), np.bool_))[row]
                point, row = point[in_cells], row[in_cells]
            parent, distance = self._feet(kind, row, queries[point])
            inside = distance <= self.tolerance
            pairs.append(
                (np.full(inside.sum(), number), point[inside], row[inside], parent[inside])
            )
        return self._sorted(pairs)

    def nearest(self, queries: Array) -> Located:
        """The nearest cell of each place (n, dim), and the parent coordinates of its point that
        is nearest.
        """
        queries = np.asarray(queries, dtype=np.float64)
        reach = np.zeros(len(queries))
        pairs, distances = self._pairs(queries, reach)
        inside = np.zeros(len(queries), np.bool_)
        for (_, point, *_), distance in zip(pairs, distances, strict=True):
            inside[point[distance <= self.tolerance]] = True
        outside = np.flatnonzero(~inside)
        if len(outside):  # no cell is further than the next node
            reach = np.asarray(self._nodes.query(queries[outside])[0])
            more, further = self._pairs(queries[outside], reach)
            pairs += [(kind, outside[point], row, parent) for kind, point, row, parent in more]
            distances += further
        kind_of, point, row, parent = (np.concatenate(part) for part in zip(*pairs, strict=True))
        order = np.lexsort((row, kind_of, np.concatenate(distances), point))
        nearest_pairs = order[np.unique(point[order], return_index=True)[1]]
        return Located(
            self.kinds,
            point[nearest_pairs],
            kind_of[nearest_pairs],
            row[nearest_pairs],
            parent[nearest_pairs],
        )

    def _pairs(self, queries: Array, reach: Array) -> tuple[list[_Pairs], list[Array]]:
        """Of each kind the places (n, dim) with cells within reach (n,), and their distances."""
        pairs, distances = [], []
        for number, kind in enumerate(self.kinds):
            point, row = self._candidates(kind, queries, reach)
            parent, distance = self._feet(kind, row, queries[point])
            pairs.append((np.full(len(row), number), point, row, parent))
            distances.append(distance)
        return pairs, distances

    def _sorted(self, pairs: list[_Pairs]) -> Located:
        if not pairs:
            none = np.empty(0, np.int64)
            return Located(self.kinds, none, none, none, np.empty((0, 3)))
        number, point, row, parent = (np.concatenate(part) for part in zip(*pairs, strict=True))
        order = np.lexsort((row, number, point))
        return Located(self.kinds, point[order], number[order], row[order], parent[order])

    def _candidates(self, kind: str, queries: Array, reach: Array) -> tuple[Integers, Integers]:
        """Pairs of a place and a cell whose box is no further from it than the reach (n,)."""
        points, rows = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
        for boxes in self._sets[kind]:
            lists = boxes.tree.query_ball_point(queries, boxes.radius + reach, return_sorted=False)
            count = np.fromiter(map(len, lists), np.int64, len(lists))
            point = np.repeat(np.arange(len(queries)), count)
            members = np.concatenate([np.empty(0, np.int64), *lists]).astype(np.int64)
            x = queries[point]
            away = np.maximum(np.maximum(boxes.low[members] - x, x - boxes.high[members]), 0.0)
            close = np.linalg.norm(away, axis=1) <= reach[point]
            points.append(point[close])
            rows.append(boxes.rows[members[close]])
        return np.concatenate(points), np.concatenate(rows)

    def _feet(self, kind: str, rows: Integers, queries: Array) -> tuple[Array, Array]:
        """Of each cell the parent coordinates (m, 3) of its point that is near the place, and how
        far that is from it (m,).
        """
        cell, nodes = CELLS[kind], self.cells[kind]
        parent, distance = np.zeros((len(rows), 3)), np.zeros(len(rows))
        step = max(1, _CHUNK // (len(cell.nodes) * self.points.shape[1]))
        for first in range(0, len(rows), step):
            part = slice(first, first + step)
            x = self.points[nodes[rows[part]]]
            xi, away = _inverse(cell, x, queries[part], self.tolerance)
            parent[part, : cell.dimension], distance[part] = xi, away
        return parent, distance


@dataclass(frozen=True, eq=False)
class _Boxes:
    """Cells of one kind that have about the same size.

    rows: (m,) numbers of the cells. low, high: (m, dim) corners of boxes that hold them. tree: of
    the middles of the boxes; radius: of the largest around its middle.
    """

    rows: Integers
    low: Array
    high: Array
    tree: cKDTree
    radius: float


def _boxes(cell: Cell, x: Array, tolerance: float) -> Iterator[_Boxes]:
    """Cells with nodes x (m, k, dim), those of sizes between two powers of two together."""
    from scipy.spatial import cKDTree  # late: slow to import

    low, high = x[:, 0].copy(), x[:, 0].copy()
    for corner in range(1, cell.corners):  # much faster than min(axis=1)
        np.minimum(low, x[:, corner], out=low)
        np.maximum(high, x[:, corner], out=high)
    if cell.order > 1:
        straight = np.einsum("kc,ncd->nkd", cell.corner_shape, x[:, : cell.corners])
        bulge = _bulge(cell.name) * np.abs(x - straight).max(axis=1)
        low, high = low - bulge, high + bulge
    low, high = low - tolerance, high + tolerance
    middle, radius = 0.5 * (low + high), 0.5 * np.linalg.norm(high - low, axis=1)
    size = np.frexp(radius)[1]
    for power in np.unique(size):
        rows = np.flatnonzero(size == power)
        tree = cKDTree(middle[rows], compact_nodes=False, balanced_tree=False)
        yield _Boxes(rows, low[rows], high[rows], tree, float(radius[rows].max()))


@cache
def _bulge(kind: str) -> float:
    """Largest sum of the absolute shape functions of the nodes that are no corners: so many times
    as these nodes are off their places in a straight cell the cell may be off it.
    """
    cell = CELLS[kind]
    line = np.linspace(-1.0, 1.0, 41)
    if not cell.exponents:  # of products of lines no more than the product of their sums
        return (
            1.05 * float(np.abs(lagrange(cell.line, line)[0]).sum(axis=1).max()) ** cell.dimension
        )
    at = np.stack(np.meshgrid(*[line] * cell.dimension), -1)
    at = cell.clipped(at.reshape(-1, cell.dimension), 0.0)
    return 1.05 * float(np.abs(cell.shape(at)[:, cell.corners :]).sum(axis=1).max())


def _inverse(cell: Cell, x: Array, queries: Array, tolerance: float) -> tuple[Array, Array]:
    """Parent coordinates (m, d), in the parent element, of points of cells with nodes x (m, k, dim)
    near the places (m, dim), and their distances (m,).
    """
    centre = cell.nodes[: cell.corners].mean(axis=0)
    xi = np.broadcast_to(centre, (len(x), cell.dimension)).copy()
    if not cell.dimension:
        return xi, np.linalg.norm(x[:, 0] - queries, axis=1)
    xi = _newton(cell, x, queries, xi)
    distance = _distance(cell, x, queries, xi)
    if cell.order > 1:  # of a cell that is bent the nearest node may be the better start
        again = np.flatnonzero(distance > tolerance)
        start = cell.nodes[np.linalg.norm(x[again] - queries[again, None], axis=2).argmin(axis=1)]
        other = _newton(cell, x[again], queries[again], 0.9 * start + 0.1 * centre)
        better = _distance(cell, x[again], queries[again], other)
        improved = again[better < distance[again]]
        xi[improved] = other[better < distance[again]]
        distance = _distance(cell, x, queries, xi)
    return cell.clipped(xi, 0.0), distance


def _distance(cell: Cell, x: Array, queries: Array, xi: Array) -> Array:
    """Distances (m,) of the places from the points of the cells at xi, taken into the cells."""
    feet = np.einsum("mk,mkd->md", cell.shape(cell.clipped(xi, 0.0)), x)
    return np.asarray(np.linalg.norm(feet - queries, axis=1))


def _newton(cell: Cell, x: Array, queries: Array, xi: Array) -> Array:
    """Parent coordinates (m, d) of the points of the cells that are nearest to the places, not far
    outside the parent element.
    """
    xi, active = xi.copy(), np.arange(len(x))
    for _ in range(_ITERATIONS):
        miss = queries[active] - np.einsum("mk,mkd->md", cell.shape(xi[active]), x[active])
        slope = np.einsum("mkc,mkd->mdc", cell.gradient(xi[active]), x[active])
        new = cell.clipped(xi[active] + _solved(slope, miss), _BEYOND)
        moving = np.abs(new - xi[active]).max(axis=1) > _STEADY
        xi[active] = new
        active = active[moving]
        if not len(active):
            break
    return xi


def _solved(slope: Array, miss: Array) -> Array:
    """Least-squares solutions (m, c) of slope (m, d, c) times them = miss (m, d)."""
    d, c = slope.shape[1:]
    if d != c:
        turned = slope.transpose(0, 2, 1)
        slope, miss = turned @ slope, np.einsum("mcd,md->mc", turned, miss)
    if c == 1:
        size = slope[:, 0]
        return np.divide(miss, size, out=np.zeros_like(miss), where=size != 0.0)
    singular = np.linalg.det(slope) == 0.0
    if singular.any():
        slope = np.where(singular[:, None, None], np.eye(c), slope)
        miss = np.where(singular[:, None], 0.0, miss)
    return np.asarray(np.linalg.solve(slope, miss[:, :, None])[:, :, 0])
