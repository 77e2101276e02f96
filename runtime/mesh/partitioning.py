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
from softehl.runtime.mesh.face_matching import matched
from softehl.runtime.mpi import world

if TYPE_CHECKING:
    from softehl.runtime.mesh.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Piece:
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
        found: Flags = np.ones(len(self.numbers), dtype=bool)
        for process, nodes in self.shared.items():
            if process < world().rank:
                found[nodes] = False
        return found

    def told(self, values: Array | Flags | Integers) -> dict[int, Any]:
        """Of values (..., n) at nodes what the others have at shared ones: process -> (..., k)."""
        comm = world()
        sent = [values[..., self.shared[p]] if p in self.shared else None for p in range(comm.size)]
        return {p: found for p, found in enumerate(comm.alltoall(sent)) if found is not None}

    def added(self, values: Array) -> Array:
        """Sums (n,) of values at nodes over all processes, in the order of the processes."""
        rank, told, found = world().rank, self.told(values), np.zeros(len(values))
        for process in sorted([rank, *told]):
            if process == rank:
                found += values
            else:
                found[self.shared[process]] += told[process]
        return found

    def everywhere(self, nodes: Integers) -> Integers:
        """Nodes that this process or another one means, sorted."""
        meant: Flags = np.zeros(len(self.numbers), dtype=bool)
        meant[nodes] = True
        for process, there in self.told(meant).items():
            meant[self.shared[process][there]] = True
        return np.flatnonzero(meant)

    def anywhere(self, something: object) -> bool:
        """True if a process has something."""
        return bool(world().allreduce(int(bool(something))))


def joined(mesh: Mesh, numbers: Integers) -> Mesh:
    """The part `mesh` of this process as one of the whole, in which its nodes have `numbers`.

    All processes then know the same kinds of cells and the same names, of which they may have none.
    """
    mesh = _with_names_of_all(mesh)
    ends = np.concatenate([np.empty(0, np.int64), *(f.ravel() for f in mesh.boundary.values())])
    shared = _shared(numbers, np.unique(ends))
    cuts = {
        kind: faces[_common(faces, CELLS[kind].corners, numbers, shared)]
        for kind, faces in mesh.boundary.items()
    }
    sides = {
        name: {
            kind: faces[~_common(faces, CELLS[kind].corners, numbers, shared, before=True)]
            for kind, faces in side.items()
        }
        for name, side in mesh.sides.items()
    }
    return replace(mesh, sides=sides, piece=Piece(numbers, shared, cuts))


def _with_names_of_all(mesh: Mesh) -> Mesh:
    kinds: dict[str, dict[str, dict[str, None]]] = {"cells": {}, "groups": {}, "sides": {}}
    here = {
        "cells": {"": list(mesh.cells)},
        "groups": {name: list(group) for name, group in mesh.groups.items()},
        "sides": {name: list(side) for name, side in mesh.sides.items()},
    }
    for there in world().allgather(here):
        for what, names in there.items():
            for name, found in names.items():
                kinds[what].setdefault(name, {}).update(dict.fromkeys(found))
    none = np.empty(0, dtype=np.int64)
    empty = {kind: np.empty((0, len(cell.nodes)), dtype=np.int64) for kind, cell in CELLS.items()}
    return replace(
        mesh,
        cells={kind: mesh.cells.get(kind, empty[kind]) for kind in kinds["cells"][""]},
        groups={
            name: {kind: mesh.groups.get(name, {}).get(kind, none) for kind in found}
            for name, found in kinds["groups"].items()
        },
        sides={
            name: {kind: mesh.sides.get(name, {}).get(kind, empty[kind]) for kind in found}
            for name, found in kinds["sides"].items()
        },
    )


def _shared(numbers: Integers, ends: Integers) -> dict[int, Integers]:
    """Process -> nodes that it has too, of those at the ends of the part.

    A node is looked up by the process that its number falls to, which no process chooses.
    """
    comm, known = world(), numbers[ends]
    asked = comm.alltoall([known[known % comm.size == p] for p in range(comm.size)])
    every = np.concatenate(asked)
    process = np.repeat(np.arange(comm.size), [len(part) for part in asked])
    order = np.lexsort((process, every))
    every, process = every[order], process[order]
    pairs: list[list[Integers]] = [[np.empty((0, 2), np.int64)] for _ in range(comm.size)]
    for apart in range(1, comm.size):
        at = np.flatnonzero(every[apart:] == every[:-apart])
        for one, other in ((at, at + apart), (at + apart, at)):
            for p in range(comm.size):
                mine = process[one] == p
                row = np.stack([every[one][mine], process[other][mine]], axis=1)
                pairs[p].append(row)
    told = np.concatenate(comm.alltoall([np.concatenate(rows) for rows in pairs]))
    told = told[np.argsort(told[:, 0], kind="stable")]
    rank = np.argsort(known)
    place = ends[rank[np.searchsorted(known[rank], told[:, 0])]]
    return {int(p): place[told[:, 1] == p] for p in np.unique(told[:, 1])}


def _common(
    faces: Integers,
    corners: int,
    numbers: Integers,
    shared: Mapping[int, Integers],
    *,
    before: bool = False,
) -> Flags:
    """Which of the faces (m, k) another process has too; before: one of lower number."""
    comm = world()
    sent: list[Any] = [None] * comm.size
    own = numbers[faces[:, :corners]]
    for process, nodes in shared.items():
        here = np.zeros(len(numbers), dtype=bool)
        here[nodes] = True
        sent[process] = own[here[faces[:, :corners]].all(axis=1)]
    found: Flags = np.zeros(len(faces), dtype=bool)
    for process, theirs in enumerate(comm.alltoall(sent)):
        if theirs is not None and len(theirs) and (process < comm.rank or not before):
            found |= matched(own, theirs, corners) >= 0
    return found
