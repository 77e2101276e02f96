"""From any mesh of a section to any other: through the cells inside, by place along the boundary.

Nothing is carried across a mouth: what a point gets comes from the cell that it lies in and from
its neighbours in the mesh, not from what happens to be near.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.sparse import csr_array

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.mesh.location import interpolated, located
from softehl.runtime.mesh.sections import SectionMesh

_LEFT = 0.2  # of the area at a corner of an element, in a state that is any good
_PATCH = 32  # nodes of a local spline, at most
_AT_ONCE = 64  # splines, whose matrices fit into a cache


def carry_nodes(old: SectionMesh, new: SectionMesh, values: Array) -> Array:
    """Nodal values (V', k) on the new mesh from those, (V, k), on the old; see `node_weights`."""
    return np.asarray(node_weights(old, new) @ values)


@lru_cache(maxsize=4)
def node_weights(old: SectionMesh, new: SectionMesh) -> csr_array[np.float64]:
    """Weights (V', V) of the values at old nodes in that at each new one.

    By a cubic spline through the nodes of the cell that holds a point and of two rings around it:
    exact at the old nodes and for quadratic fields. Where both have the same regions none sees what
    is in another one: slopes jump between materials.
    """
    if len(old.regions) < 2 or set(old.regions) != set(new.regions):
        near, weights = _splines(old, new.points)
    else:
        shape = (len(new.points), _PATCH)
        near, weights = np.zeros(shape, dtype=np.int64), np.zeros(shape)
        for name in old.regions:
            part, used = _region(old, name)
            nodes = np.unique(new.quads[new.regions[name]])
            there, weights[nodes] = _splines(part, new.points[nodes])
            near[nodes] = used[there]
    rows = np.arange(len(near) + 1) * _PATCH
    return csr_array((weights.ravel(), near.ravel(), rows), (len(near), len(old.points)))


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


def _splines(old: SectionMesh, at: Array) -> tuple[Integers, Array]:
    """Nodes (n, m) around points (n, 2), and the weights of each; see `node_weights`.

    Points of a cell have one spline; cells of about as many points are solved together.
    """
    cell, _ = located(old.points, old.quads, at)
    nodes, known = _patches(old)
    count = np.bincount(cell, minlength=len(old.quads))
    order = np.lexsort((cell, count[cell]))  # point by point, cell by cell
    first = np.flatnonzero(np.diff(cell[order], prepend=-1))
    cells = cell[order[first]]
    weights = np.empty((len(at), _PATCH))
    for some in np.array_split(np.arange(len(cells)), len(cells) // _AT_ONCE + 1):
        here, number = cells[some], np.arange(count[cells[some]].max(initial=0))
        there = number < count[here][:, None]
        points = order[np.where(there, first[some][:, None] + number, first[some][:, None])]
        found = _spline(old.points[nodes[here]], known[here], at[points])
        weights[points[there]] = found[there]
    return nodes[cell], weights


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


def _spline(points: Array, known: Flags, at: Array) -> Array:
    """Weights (n, j, m) of nodes points (n, m, 2) at points at (n, j, 2) of n cubic splines.

    Thin-plate's cubic sister |x|^3 with quadratic polynomials; every spline in its own units.
    """
    middle = points.mean(axis=1, keepdims=True)
    scale = np.ptp(points, axis=1, keepdims=True).max(axis=2, keepdims=True)
    x, y = (points - middle) / scale, (at - middle) / scale
    m, there = points.shape[1], known.astype(np.float64)[:, None]
    matrix = np.zeros((len(x), m + 6, m + 6))
    matrix[:, :m, :m] = _cubed(x, x) * there * there.transpose(0, 2, 1)
    matrix[:, np.arange(m), np.arange(m)] += 1.0 - there[:, 0]
    matrix[:, m:, :m] = _polynomials(x) * there
    matrix[:, :m, m:] = matrix[:, m:, :m].transpose(0, 2, 1)
    right = np.concatenate([_cubed(x, y) * there.transpose(0, 2, 1), _polynomials(y)], axis=1)
    return np.asarray(np.linalg.solve(matrix, right)[:, :m].transpose(0, 2, 1))


def _cubed(x: Array, y: Array) -> Array:
    """Cubes (n, i, j) of the distances from x (n, i, 2) to y (n, j, 2)."""
    away = np.square(x[:, :, None, 0] - y[:, None, :, 0])
    away += np.square(x[:, :, None, 1] - y[:, None, :, 1])
    away *= np.sqrt(away)
    return np.asarray(away)


def _polynomials(x: Array) -> Array:
    """(n, 6, j): the monomials of (n, j, 2) up to the second degree."""
    z, r = x[..., 0], x[..., 1]
    return np.stack([np.ones_like(z), z, r, z * z, z * r, r * r], axis=1)


@lru_cache(maxsize=4)
def _patches(mesh: SectionMesh) -> tuple[Integers, Flags]:
    """Nodes (Q, m) of and around each cell, two rings of them, nearest first, and which there are.

    Where there are fewer than m, the rest repeat the first.
    """
    count, cells = len(mesh.points), len(mesh.quads)
    ones = np.ones(mesh.quads.size)
    of = csr_array((ones, (np.repeat(np.arange(cells), 4), mesh.quads.ravel())), (cells, count))
    rings = csr_array(of @ (of.T @ of) @ (of.T @ of))
    sizes = np.diff(rings.indptr)
    there = np.arange(max(_PATCH, sizes.max())) < sizes[:, None]
    nodes = np.broadcast_to(mesh.quads[:, :1], there.shape).copy()
    nodes[there] = rings.indices
    middle = mesh.points[mesh.quads].mean(axis=1)
    z, r = (mesh.points[:, i][nodes] - middle[:, i : i + 1] for i in (0, 1))
    away = np.where(there, np.sqrt(z * z + r * r), np.inf)
    nearest = np.argsort(away, axis=1, kind="stable")[:, :_PATCH]
    return np.take_along_axis(nodes, nearest, 1), np.take_along_axis(there, nearest, 1)
