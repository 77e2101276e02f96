"""Structured meshes: lines, rectangles, boxes of every kind of cell, and frames of members."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import permutations, product
from math import prod
from typing import TypeAlias

import numpy as np

from softehl.runtime.arrays import Array, Integers, count_of
from softehl.runtime.mesh.cells import CELLS, lobatto
from softehl.runtime.mesh.mesh import Mesh, MeshError
from softehl.runtime.mesh.partitioning import join_partitions
from softehl.runtime.mpi import world

KINDS = {
    (1, "quad"): ("line2", "line3", "line4", "line5", "line6", "line7"),
    (2, "quad"): ("quad4", "quad9", "quad16", "quad25", "quad36", "quad49"),
    (2, "serendipity"): ("", "quad8"),
    (2, "triangle"): ("tri3", "tri6"),
    (3, "hex"): ("hex8", "hex27", "hex64", "hex125", "hex216", "hex343"),
    (3, "serendipity"): ("", "hex20"),
    (3, "tetrahedron"): ("tet4", "tet10"),
    (3, "wedge"): ("wedge6", "wedge15"),
    (3, "lagrange_wedge"): ("", "wedge18"),
    (3, "pyramid"): ("pyramid5", ""),
}
"""(dimension, shape) -> kinds of order 1, 2, ..."""

SIDES = {1: ("left", "right"), 2: ("left", "right", "bottom", "top")}
SIDES[3] = ("left", "right", "front", "back", "bottom", "top")
"""Names of the sides at the smallest and largest x, y and z."""


Pairs: TypeAlias = Sequence[tuple[int, int]]


def frame(
    points: Sequence[Sequence[float]],
    members: Pairs | Mapping[str, Pairs] | None,
    cells: int,
    order: int,
) -> Mesh:
    """Straight members between points.  Raises MeshError."""
    corners = np.array(points, dtype=np.float64)
    if corners.ndim != 2 or corners.shape[1] not in (2, 3) or not np.isfinite(corners).all():
        raise MeshError("points: (x, y) or (x, y, z) of two points or more are needed")
    if members is None:
        members = [(i, i + 1) for i in range(len(corners) - 1)]
    groups = members if isinstance(members, Mapping) else {"": members}
    pairs = [(int(i), int(j)) for group in groups.values() for i, j in group]
    count = count_of(cells)
    if not count:
        raise MeshError(f"cells = {cells}: a whole number of at least 1 is needed")
    kind = _kind(1, order, "quad")
    rows, nodes, total = [], [corners], len(corners)
    along = _axis(1.0, count, order)[1:-1, None]
    numbers = _numbers(kind, [count], order)
    for i, j in pairs:
        if not (0 <= i < len(corners) and 0 <= j < len(corners)):
            raise MeshError(f"member ({i}, {j}): the points are numbered 0 to {len(corners) - 1}")
        if np.allclose(corners[i], corners[j], rtol=1e-12, atol=0.0):
            raise MeshError(f"member ({i}, {j}): its points are at one place")
        nodes.append(corners[i] + along * (corners[j] - corners[i]))
        member_nodes = np.concatenate([[i], np.arange(total, total + len(along)), [j]])
        rows.append(member_nodes[numbers])
        total += len(along)
    lonely = sorted(set(range(len(corners))) - {n for pair in pairs for n in pair})
    if lonely:
        raise MeshError(f"point {lonely[0]} has no member")
    starts = count * np.cumsum([0, *map(len, groups.values())])
    named = {
        name: {kind: np.arange(first, last)}
        for name, first, last in zip(groups, starts[:-1], starts[1:], strict=True)
        if name
    }
    return Mesh(np.concatenate(nodes), {kind: np.concatenate(rows)}, groups=named)


def grid(
    size: Sequence[float],
    cells: int | Sequence[int],
    order: int,
    shape: str,
    *,
    spread: bool = False,
) -> Mesh:
    """A line, rectangle or box from the origin; spread: this process's part.  Raises MeshError."""
    dimension = len(size)
    kind = _kind(dimension, order, shape)
    order = 2 if shape == "pyramid" else order  # its grid of nodes has the middles of boxes
    counts = [n for n in map(count_of, np.ravel(np.asarray(cells, dtype=object))) if n]
    if len(counts) != dimension or np.size(cells) != dimension:
        raise MeshError(f"cells = {cells}: {dimension} whole numbers of at least 1 are needed")
    if not all(np.isfinite(length) and length > 0 for length in size):
        raise MeshError(f"size = {tuple(size)}: lengths must be positive")
    rank, processes = (world().rank, world().size) if spread else (0, 1)
    spans = _span(counts, rank, processes)
    axes = [
        _axis(a, n, order)[order * first : order * last + 1]
        for a, n, (first, last) in zip(size, counts, spans, strict=True)
    ]
    points = np.stack([x.ravel(order="F") for x in np.meshgrid(*axes, indexing="ij")], axis=1)
    nodes = _numbers(kind, [last - first for first, last in spans], order)
    used, renumbered = np.unique(nodes, return_inverse=True)
    mesh = Mesh(points[used], {kind: renumbered.reshape(nodes.shape).astype(np.int64)})
    mesh = replace(mesh, sides=_sides(mesh, size))
    if processes == 1:
        return mesh
    index = np.unravel_index(used, [len(axis) for axis in axes], order="F")
    strides = np.cumprod([1, *(order * n + 1 for n in counts[:-1])])
    moved = [at + order * first for at, (first, _) in zip(index, spans, strict=True)]
    return join_partitions(mesh, np.stack(moved, axis=1) @ strides)


def _span(counts: Sequence[int], rank: int, processes: int) -> list[tuple[int, int]]:
    """First and last plane of the cells of a process along each axis.

    The box is cut into equal boxes with the least area between them.
    """
    fit = [
        cuts
        for cuts in product(range(1, processes + 1), repeat=len(counts))
        if prod(cuts) == processes and all(c <= n for c, n in zip(cuts, counts, strict=True))
    ]
    if not fit:
        raise MeshError(f"cells = {tuple(counts)}: too few to be cut for {processes} processes")
    cuts = min(fit, key=lambda cuts: sum((c - 1) / n for c, n in zip(cuts, counts, strict=True)))
    index = np.unravel_index(rank, cuts, order="F")
    return [
        (n * int(k) // c, n * (int(k) + 1) // c)
        for k, c, n in zip(index, cuts, counts, strict=True)
    ]


def _axis(length: float, cells: int, order: int) -> Array:
    """Nodes along one axis: those of Gauss and Lobatto in every cell."""
    if order < 3:
        return np.linspace(0.0, length, order * cells + 1)
    inside = 0.5 * (1.0 + lobatto(order)[:-1])
    steps = np.arange(cells)[:, None] + inside
    return np.append(steps.ravel() / cells, 1.0) * length


def _kind(dimension: int, order: int, shape: str) -> str:
    allowed = [name for d, name in KINDS if d == dimension]
    if (dimension, shape) not in KINDS:
        raise MeshError(f"shape = {shape!r}: allowed are {', '.join(allowed)}")
    kinds = KINDS[dimension, shape]
    kind = kinds[order - 1] if order in range(1, len(kinds) + 1) else ""
    if not kind:
        suffixes = {"serendipity": "2", "lagrange_wedge": "2", "pyramid": "1"}
        orders = suffixes.get(shape, "1 or 2" if len(kinds) == 2 else f"1 to {len(kinds)}")
        raise MeshError(f"order = {order}: {shape} cells have order {orders}")
    return kind


def _numbers(kind: str, counts: Sequence[int], order: int) -> Integers:
    """Node numbers (m, k) of the cells in the grid of all nodes, x running first."""
    strides = np.cumprod([1, *(order * n + 1 for n in counts[:-1])])
    steps = np.meshgrid(*(order * np.arange(n) for n in counts), indexing="ij")
    origins = sum(s.ravel(order="F") * stride for s, stride in zip(steps, strides, strict=True))
    if kind[:3] in ("tri", "tet"):
        parts = [_simplex(kind, corners) for corners in _simplices(len(counts))]
    elif kind.startswith("wedge"):
        parts = [_wedge(kind, corners) for corners in _simplices(2)]
    elif kind.startswith("pyramid"):
        parts = _pyramids()
    else:
        rank = np.argsort(np.argsort(CELLS[kind].line)) if order > 2 else np.empty(0)
        parts = [rank[CELLS[kind].lines] / order if order > 2 else 0.5 * (CELLS[kind].nodes + 1.0)]
    local = [np.rint(order * part).astype(np.int64) @ strides for part in parts]
    rows = np.asarray(origins)[:, None, None] + np.array(local)[None]
    return np.asarray(rows.reshape(-1, rows.shape[-1]))


def _simplices(dimension: int) -> list[Array]:
    """Corners of the simplices that share the main diagonal of the unit cube, positive all."""
    simplices = []
    for order in permutations(range(dimension)):
        corners = np.zeros((dimension + 1, dimension))
        for k, axis in enumerate(order):
            corners[k + 1] = corners[k]
            corners[k + 1, axis] = 1.0
        if np.linalg.det(corners[1:] - corners[0]) < 0.0:
            corners[[-1, -2]] = corners[[-2, -1]]
        simplices.append(corners)
    return simplices


def _wedge(kind: str, triangle: Array) -> Array:
    """Nodes of a prism over a triangle (3, 2) of the unit square."""
    nodes = CELLS[kind].nodes
    return np.column_stack([CELLS["tri3"].shape(nodes[:, :2]) @ triangle, 0.5 * (nodes[:, 2] + 1)])


def _pyramids() -> list[Array]:
    """Nodes of the six pyramids of the unit cube, from its faces to its middle."""
    corners = 0.5 * (CELLS["hex8"].nodes + 1.0)
    return [np.vstack([corners[list(side[::-1])], [[0.5] * 3]]) for side in CELLS["hex8"].sides]


def _simplex(kind: str, corners: Array) -> Array:
    flat = CELLS["tri3" if kind.startswith("tri") else "tet4"]
    return np.asarray(flat.shape(CELLS[kind].nodes) @ corners)


def _sides(mesh: Mesh, size: Sequence[float]) -> dict[str, dict[str, Integers]]:
    """Faces at the smallest and largest coordinate of each axis."""
    if mesh.dimension == 1:
        end_nodes = [np.flatnonzero(mesh.points[:, 0] == end) for end in (0.0, size[0])]
        return {n: {"point1": e[:, None]} for n, e in zip(SIDES[1], end_nodes, strict=True)}
    named = {}
    for k, name in enumerate(SIDES[mesh.dimension]):
        axis, bound = k // 2, (0.0, size[k // 2])[k % 2]
        on_bound = np.abs(mesh.points[:, axis] - bound) <= 1e-12 * size[axis]
        faces = {kind: f[on_bound[f].all(axis=1)] for kind, f in mesh.boundary.items()}
        named[name] = {kind: f for kind, f in faces.items() if len(f)}
    return named
