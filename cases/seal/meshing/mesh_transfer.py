"""From any mesh of a section to any other: through the cells inside, by place along the boundary.

Nothing gets across a mouth: what a point gets comes from the cell that it lies in, not from what
happens to be near. What is transferred is where an iteration starts: with cubic splines through the
nodes around each cell, films of an O-ring, an X-ring and a U-cup took as many iterations.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

from softehl.cases.seal.meshing.section_mesh import SectionMesh
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.point_location import Located, PointLocator

_WITHIN = 1e-12  # of the size of the mesh: a point so near to a cell is in it


def transfer_nodes(old: SectionMesh, new: SectionMesh, values: Array) -> Array:
    """Nodal values (V', k) on the new mesh from those, (V, k), on the old: bilinear."""
    located = _nearest(old, new.points)
    weights = CELLS["quad4"].shape(located.parent[:, :2])
    return np.asarray(np.einsum("na,nak->nk", weights, values[old.quads[located.row]]))


def transfer_elements(old: SectionMesh, new: SectionMesh, values: Array) -> Array:
    """Element values (Q',) on the new mesh from those, (Q,), on the old, by their middles."""
    return np.asarray(values[_nearest(old, new.points[new.quads].mean(axis=1)).row])


def _nearest(mesh: SectionMesh, points: Array) -> Located:
    """The cell that holds each place (n, 2), or is nearest to it."""
    tolerance = _WITHIN * float(np.ptp(mesh.points, axis=0).max())
    return PointLocator(mesh.points, {"quad4": mesh.quads}, tolerance).nearest(points)


def transfer_boundary(old: SectionMesh, new: SectionMesh, values: Array) -> Array:
    """Values (B',) at the whole boundary of the new mesh from those, (B,), of the old, by place.

    Shape preserving: no value beyond its neighbours.
    """
    period = old.length
    at = np.concatenate([old.positions - period, old.positions, old.positions + period])
    positions = old.positions[0] + np.mod(
        new.positions * (period / new.length) - old.positions[0], period
    )
    return np.asarray(PchipInterpolator(at, np.tile(values, 3))(positions))


def transfer_chain(
    old: SectionMesh, new: SectionMesh, nodes: Integers, new_nodes: Integers, values: Array
) -> Array:
    """Values (n',) at new_nodes of the boundary from those, (n,), at nodes, by place.

    Both run counterclockwise without gaps. Shape preserving; beyond the old nodes as at their ends.
    """
    at = places_of(old, nodes)
    positions = places_of(new, new_nodes) * (old.length / new.length)
    turns = np.round((0.5 * (at[0] + at[-1]) - 0.5 * (positions[0] + positions[-1])) / old.length)
    positions = np.clip(positions + turns * old.length, at[0], at[-1])
    return np.asarray(PchipInterpolator(at, values)(positions))


def places_of(mesh: SectionMesh, nodes: Integers) -> Array:
    """Places (n,) of boundary nodes that run counterclockwise, mm, rising."""
    index = np.full(len(mesh.points), -1, dtype=np.int64)
    index[mesh.boundary] = np.arange(len(mesh.boundary))
    at = mesh.positions[index[nodes]]
    back = np.concatenate([[0], np.cumsum(np.diff(at) < 0.0)])
    return np.asarray(at + back * mesh.length)
