"""A mesh of which each process has a part: whose nodes are whose, and where the parts meet.

Every process calls the functions of this file, and the methods of a mesh in parts, alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.face_matching import match_faces
from softehl.runtime.mpi import world

if TYPE_CHECKING:
    from softehl.runtime.mesh.mesh import Mesh


@dataclass(frozen=True, eq=False)
class MeshPartition:
    """Connection of the part of a mesh that this process has with those of the others.

    numbers: (n,) number of each node in the whole mesh. shared: process -> nodes that it has too,
    in the order of the whole. cuts: kind -> faces (m, k) that a cell of another process has too.
    """

    numbers: Integers
    shared: Mapping[int, Integers]
    cuts: Mapping[str, Integers]

    @property
    def owned(self) -> Flags:
        """(n,): whether a node is this process's own: no process before it has the node."""
        is_owned: Flags = np.ones(len(self.numbers), dtype=bool)
        for process, nodes in self.shared.items():
            if process < world().rank:
                is_owned[nodes] = False
        return is_owned

    def exchange(self, values: Array | Flags | Integers) -> dict[int, Any]:
        """Of values (..., n) at nodes what the others have at shared ones: process -> (..., k)."""
        comm = world()
        sent = [values[..., self.shared[p]] if p in self.shared else None for p in range(comm.size)]
        return {
            p: received for p, received in enumerate(comm.alltoall(sent)) if received is not None
        }

    def added(self, values: Array) -> Array:
        """Sums (n,) of values at nodes over all processes, in the order of the processes."""
        rank, received, sums = world().rank, self.exchange(values), np.zeros(len(values))
        for process in sorted([rank, *received]):
            if process == rank:
                sums += values
            else:
                sums[self.shared[process]] += received[process]
        return sums

    def everywhere(self, nodes: Integers) -> Integers:
        """Nodes that this process or another one means, sorted."""
        mask: Flags = np.zeros(len(self.numbers), dtype=bool)
        mask[nodes] = True
        for process, flags in self.exchange(mask).items():
            mask[self.shared[process][flags]] = True
        return np.flatnonzero(mask)

    def anywhere(self, something: object) -> bool:
        """True if a process has something."""
        return bool(world().allreduce(int(bool(something))))


def join_partitions(mesh: Mesh, numbers: Integers) -> Mesh:
    """The part `mesh` of this process as one of the whole, in which its nodes have `numbers`.

    All processes then know the same kinds of cells and the same names, of which they may have none.
    """
    mesh = _with_names_of_all(mesh)
    boundary_nodes = np.concatenate(
        [np.empty(0, np.int64), *(f.ravel() for f in mesh.boundary.values())]
    )
    shared = _shared(numbers, np.unique(boundary_nodes))
    cuts = {
        kind: faces[_common(faces, CELLS[kind].corners, numbers, shared)]
        for kind, faces in mesh.boundary.items()
    }
    sides = {
        name: {
            kind: faces[
                ~_common(faces, CELLS[kind].corners, numbers, shared, lower_ranks_only=True)
            ]
            for kind, faces in side.items()
        }
        for name, side in mesh.sides.items()
    }
    return replace(mesh, sides=sides, piece=MeshPartition(numbers, shared, cuts))


def _with_names_of_all(mesh: Mesh) -> Mesh:
    kinds: dict[str, dict[str, dict[str, None]]] = {"cells": {}, "groups": {}, "sides": {}}
    local_names = {
        "cells": {"": list(mesh.cells)},
        "groups": {name: list(group) for name, group in mesh.groups.items()},
        "sides": {name: list(side) for name, side in mesh.sides.items()},
    }
    for other_names in world().allgather(local_names):
        for what, names in other_names.items():
            for name, members in names.items():
                kinds[what].setdefault(name, {}).update(dict.fromkeys(members))
    none = np.empty(0, dtype=np.int64)
    empty = {kind: np.empty((0, len(cell.nodes)), dtype=np.int64) for kind, cell in CELLS.items()}
    return replace(
        mesh,
        cells={kind: mesh.cells.get(kind, empty[kind]) for kind in kinds["cells"][""]},
        groups={
            name: {kind: mesh.groups.get(name, {}).get(kind, none) for kind in members}
            for name, members in kinds["groups"].items()
        },
        sides={
            name: {kind: mesh.sides.get(name, {}).get(kind, empty[kind]) for kind in members}
            for name, members in kinds["sides"].items()
        },
    )


def _shared(numbers: Integers, end_nodes: Integers) -> dict[int, Integers]:
    """Process -> nodes that it has too, of those at the ends of the part.

    A node is looked up by the process that its number falls to, which no process chooses.
    """
    comm, end_numbers = world(), numbers[end_nodes]
    received = comm.alltoall([end_numbers[end_numbers % comm.size == p] for p in range(comm.size)])
    every = np.concatenate(received)
    process = np.repeat(np.arange(comm.size), [len(part) for part in received])
    order = np.lexsort((process, every))
    every, process = every[order], process[order]
    pairs: list[list[Integers]] = [[np.empty((0, 2), np.int64)] for _ in range(comm.size)]
    for offset in range(1, comm.size):
        at = np.flatnonzero(every[offset:] == every[:-offset])
        for one, other in ((at, at + offset), (at + offset, at)):
            for p in range(comm.size):
                mask = process[one] == p
                row = np.stack([every[one][mask], process[other][mask]], axis=1)
                pairs[p].append(row)
    pairs_here = np.concatenate(comm.alltoall([np.concatenate(rows) for rows in pairs]))
    pairs_here = pairs_here[np.argsort(pairs_here[:, 0], kind="stable")]
    rank = np.argsort(end_numbers)
    nodes = end_nodes[rank[np.searchsorted(end_numbers[rank], pairs_here[:, 0])]]
    return {int(p): nodes[pairs_here[:, 1] == p] for p in np.unique(pairs_here[:, 1])}


def _common(
    faces: Integers,
    corners: int,
    numbers: Integers,
    shared: Mapping[int, Integers],
    *,
    lower_ranks_only: bool = False,
) -> Flags:
    """Which of the faces (m, k) another process has too; before: one of lower number."""
    comm = world()
    sent: list[Any] = [None] * comm.size
    corners_here = numbers[faces[:, :corners]]
    for process, nodes in shared.items():
        node_mask = np.zeros(len(numbers), dtype=bool)
        node_mask[nodes] = True
        sent[process] = corners_here[node_mask[faces[:, :corners]].all(axis=1)]
    is_common: Flags = np.zeros(len(faces), dtype=bool)
    for process, other_faces in enumerate(comm.alltoall(sent)):
        if (
            other_faces is not None
            and len(other_faces)
            and (process < comm.rank or not lower_ranks_only)
        ):
            is_common |= match_faces(corners_here, other_faces, corners) >= 0
    return is_common
