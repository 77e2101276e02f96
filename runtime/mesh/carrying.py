"""From any mesh of a section to any other: through the cells inside, by place along the boundary.

Nothing is carried across a mouth: what a point gets comes from the cell that it lies in and from
its neighbours in the mesh, not from what happens to be near.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.sparse import csr_array

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.mesh.location import interpolated, located
from softehl.runtime.mesh.sections import SectionMesh

_LEFT = 0.2  # of the area at a corner of an element, in a state that is any good
_PATCH = 32  # nodes of a local spline, at most
_AT_ONCE = 2000  # points, to bound the memory


def carry_nodes(old: SectionMesh, new: SectionMesh, values: Array) -> Array:
    """Nodal values (V', k) on the new mesh from those, (V, k), on the old.

    By a cubic spline through the nodes of the cell that holds a point and of two rings around it:
    exact at the old nodes and for quadratic fields. Where both have the same regions none sees what
    is in another one: slopes jump between materials.
    """
    if len(old.regions) < 2 or set(old.regions) != set(new.regions):
        return _carried(old, new.points, values)
    result = np.empty((len(new.points), values.shape[1]))
    for name in old.regions:
        part, used = _region(old, name)
        nodes = np.unique(new.quads[new.regions[name]])
        result[nodes] = _carried(part, new.points[nodes], values[used])
    return result


def carry_displacements(old: SectionMesh, new: SectionMesh, values: Array) -> Array:
    """Displacements (V', 2) on the new mesh from those, (V, 2), on the old.

    As `carry_nodes` has them, unless that folds elements: a spline through the nodes of thin layers
    may lead anywhere a little outside of them, where the new boundary lies between old nodes. Then
    bilinear in the old cells.
    """
    moved = carry_nodes(old, new, values)
    if not _folded(new, moved):
        return moved
    plain = interpolated(old.points, old.quads, values, new.points)
    return moved if _folded(new, plain) else plain


def _folded(mesh: SectionMesh, moved: Array) -> bool:
    """Whether displacements (V, 2) leave less than `_LEFT` of the area at any corner of a cell."""
    before, after = (_corners(points[mesh.quads]) for points in (mesh.points, mesh.points + moved))
    return bool((after < _LEFT * before).any())


def _corners(x: Array) -> Array:
    """Areas (Q, 4) that the sides at each corner of cells (Q, 4, 2) span."""
    a, b = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _region(mesh: SectionMesh, name: str) -> tuple[SectionMesh, Integers]:
    """The cells of a region alone, and which nodes are theirs; its boundary is of no use."""
    cells = mesh.quads[mesh.regions[name]]
    used = np.unique(cells)
    part = replace(mesh, points=mesh.points[used], quads=np.searchsorted(used, cells), regions={})
    return part, used


def _carried(old: SectionMesh, at: Array, values: Array) -> Array:
    """Values (n, k) at points (n, 2); see `carry_nodes`."""
    cell, _ = located(old.points, old.quads, at)
    near, known = _patches(old)
    result = np.empty((len(at), values.shape[1]))
    for some in np.array_split(np.arange(len(cell)), len(cell) // _AT_ONCE + 1):
        nodes = near[cell[some]]
        result[some] = _spline(old.points[nodes], values[nodes], known[cell[some]], at[some])
    return result


def carry_elements(old: SectionMesh, new: SectionMesh, values: Array) -> Array:
    """Element values (Q',) on the new mesh from those, (Q,), on the old, through means at nodes.

    Region by region where both have the same.
    """
    at = new.points[new.quads].mean(axis=1)
    if len(old.regions) < 2 or set(old.regions) != set(new.regions):
        return _averaged(old, at, values)
    result = np.empty(len(at))
    for name, cells in old.regions.items():
        there = new.regions[name]
        result[there] = _averaged(_region(old, name)[0], at[there], values[cells])
    return result


def _averaged(old: SectionMesh, middles: Array, values: Array) -> Array:
    """Values (n,) at points (n, 2); see `carry_elements`."""
    x = old.points[old.quads]
    a, b = x[:, 2] - x[:, 0], x[:, 3] - x[:, 1]
    area = np.repeat(0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), 4)
    at, count = old.quads.ravel(), len(old.points)
    total = np.bincount(at, area * np.repeat(values, 4), count)
    nodal = total / np.maximum(np.bincount(at, area, count), 1e-300)
    return interpolated(old.points, old.quads, nodal[:, None], middles)[:, 0]


def carry_boundary(old: SectionMesh, new: SectionMesh, values: Array) -> Array:
    """Values (B',) at the whole boundary of the new mesh from those, (B,), of the old, by place.

    Shape preserving: no value beyond its neighbours.
    """
    period = old.length
    at = np.concatenate([old.places - period, old.places, old.places + period])
    places = old.places[0] + np.mod(new.places * (period / new.length) - old.places[0], period)
    return np.asarray(PchipInterpolator(at, np.tile(values, 3))(places))


def carry_chain(
    old: SectionMesh, new: SectionMesh, nodes: Integers, new_nodes: Integers, values: Array
) -> Array:
    """Values (n',) at new_nodes of the boundary from those, (n,), at nodes, by place.

    Both run counterclockwise without gaps. Shape preserving; beyond the old nodes as at their ends.
    """
    at = places_of(old, nodes)
    places = places_of(new, new_nodes) * (old.length / new.length)
    turns = np.round((0.5 * (at[0] + at[-1]) - 0.5 * (places[0] + places[-1])) / old.length)
    places = np.clip(places + turns * old.length, at[0], at[-1])
    return np.asarray(PchipInterpolator(at, values)(places))


def places_of(mesh: SectionMesh, nodes: Integers) -> Array:
    """Places (n,) of boundary nodes that run counterclockwise, mm, rising."""
    index = np.full(len(mesh.points), -1, dtype=np.int64)
    index[mesh.boundary] = np.arange(len(mesh.boundary))
    at = mesh.places[index[nodes]]
    back = np.concatenate([[0], np.cumsum(np.diff(at) < 0.0)])
    return np.asarray(at + back * mesh.length)


def _spline(points: Array, values: Array, known: Flags, at: Array) -> Array:
    """Values (n, k) at points at (n, 2) of one cubic spline each, through those (n, m, k) known.

    points: (n, m, 2). Thin-plate's cubic sister |x|^3 with quadratic polynomials; every patch in
    its own units.
    """
    middle = points.mean(axis=1, keepdims=True)
    scale = np.ptp(points, axis=1, keepdims=True).max(axis=2, keepdims=True)
    x, y = (points - middle) / scale, (at[:, None] - middle) / scale
    n, m = known.shape
    both = known[:, :, None] & known[:, None]
    matrix = np.zeros((n, m + 6, m + 6))
    matrix[:, :m, :m] = np.where(both, _cubed(x[:, :, None] - x[:, None]), np.eye(m))
    matrix[:, :m, m:] = _polynomials(x) * known[..., None]
    matrix[:, m:, :m] = matrix[:, :m, m:].transpose(0, 2, 1)
    given = np.zeros((n, m + 6, values.shape[2]))
    given[:, :m] = values * known[..., None]
    weights = np.linalg.solve(matrix, given)
    row = np.concatenate([_cubed(y - x) * known, _polynomials(y)[:, 0]], axis=1)
    return np.asarray(np.einsum("nm,nmk->nk", row, weights))


def _cubed(away: Array) -> Array:
    return np.asarray(np.linalg.norm(away, axis=-1) ** 3)


def _polynomials(x: Array) -> Array:
    """(..., 6): the monomials of (..., 2) up to the second degree."""
    z, r = x[..., 0], x[..., 1]
    return np.stack([np.ones_like(z), z, r, z * z, z * r, r * r], axis=-1)


def _patches(mesh: SectionMesh) -> tuple[Integers, Flags]:
    """Nodes (Q, m) of and around each cell, two rings of them, nearest first, and which there are.

    Where there are fewer than m, the rest repeat the first.
    """
    count, cells = len(mesh.points), len(mesh.quads)
    ones = np.ones(mesh.quads.size)
    of = csr_array((ones, (np.repeat(np.arange(cells), 4), mesh.quads.ravel())), (cells, count))
    rings = csr_array(of @ (of.T @ of) @ (of.T @ of))
    sizes, nodes = np.diff(rings.indptr), rings.indices
    cell = np.repeat(np.arange(cells), sizes)
    away = np.linalg.norm(mesh.points[nodes] - mesh.points[mesh.quads].mean(axis=1)[cell], axis=1)
    order = np.lexsort((away, cell))
    slot = np.arange(len(nodes)) - np.repeat(rings.indptr[:-1], sizes)
    kept = slot < _PATCH
    near = np.repeat(mesh.quads[:, :1], _PATCH, axis=1)
    known = np.zeros(near.shape, dtype=np.bool_)
    near[cell[kept], slot[kept]] = nodes[order][kept]
    known[cell[kept], slot[kept]] = True
    return near, known
