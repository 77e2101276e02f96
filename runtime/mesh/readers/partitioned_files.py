"""Files of a mesh in parts: `part_1.msh`, ... of Gmsh, and `part_1.npz`, ... of our own.

Both have the numbers that nodes have in the whole mesh, by which parts are joined.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.io import read_arrays, write_arrays
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.face_matching import first_occurrences, match_faces
from softehl.runtime.mesh.mesh import Mesh, MeshError
from softehl.runtime.mesh.partitioning import join_partitions
from softehl.runtime.mesh.readers.meshio import content_of, highest, mesh_of
from softehl.runtime.mpi import world

_ONE = ".npz"


def read_parts(path: Path) -> Mesh:
    """See `Mesh.read`."""
    comm, files = world(), 0
    while _file(path, files).is_file():
        files += 1
    if files < comm.size:
        raise MeshError(
            f"{_file(path, files)}: there is no such file, and each of {comm.size} processes reads "
            'one at least; write(parts=...) or "gmsh -part_split" makes them'
        )
    first, last = files * comm.rank // comm.size, files * (comm.rank + 1) // comm.size
    mesh, numbers = _merged([_read(_file(path, k)) for k in range(first, last)])
    dimension = max(CELLS[kind].dimension for kind in mesh.cells)
    bent = mesh.dimension > dimension and np.ptp(mesh.points[:, dimension:], axis=0).any()
    if any(comm.allgather(bool(bent))):
        dimension = mesh.dimension
    flat = Mesh(
        np.ascontiguousarray(mesh.points[:, :dimension]), mesh.cells, mesh.groups, mesh.sides
    )
    return flat if comm.size == 1 else join_partitions(flat, numbers)


def _file(path: Path, number: int) -> Path:
    return path.with_name(f"{path.stem}_{number + 1}{path.suffix}")


Part = tuple[Mesh, Integers]
"""A part of a mesh, and the number of each of its nodes in the whole."""


def _read(path: Path) -> Part:
    if path.suffix == _ONE:
        return _from_arrays(path)
    content = content_of(path)
    if content.tags is None:
        raise MeshError(f"{path}: parts are read from files of Gmsh (.msh) and from .npz")
    mesh, used = mesh_of(content, content.points, highest(path, content.cells))
    return mesh, content.tags[used]


def _from_arrays(path: Path) -> Part:
    arrays = read_arrays(path)
    if arrays is None or not {"points", "numbers"} <= arrays.keys():
        raise MeshError(f"{path}: damaged, or not written by write(parts=...)")
    cells: dict[str, Integers] = {}
    named: dict[str, dict[str, dict[str, Integers]]] = {"group": {}, "side": {}}
    for key, values in arrays.items():
        what, _, suffix = key.partition(":")
        kind, _, name = suffix.partition(":")
        if what == "cells":
            cells[kind] = values.astype(np.int64)
        elif what in named:
            named[what].setdefault(name, {})[kind] = values.astype(np.int64)
    mesh = Mesh(arrays["points"], cells, named["group"], named["side"])
    return mesh, arrays["numbers"].astype(np.int64)


def _merged(parts: Sequence[Part]) -> Part:
    """Several parts as one, nodes in the order of their numbers."""
    every = np.concatenate([numbers for _, numbers in parts])
    numbers, first, inverse = np.unique(every, return_index=True, return_inverse=True)
    bounds = np.cumsum([len(n) for _, n in parts])[:-1]
    cells: dict[str, list[Integers]] = {}
    groups: dict[str, dict[str, list[Integers]]] = {}
    sides: dict[str, dict[str, list[Integers]]] = {}
    for (mesh, _), at in zip(parts, np.split(inverse.ravel(), bounds), strict=True):
        for name, group in mesh.groups.items():
            for kind, rows in group.items():
                offset = sum(map(len, cells.get(kind, ())))
                groups.setdefault(name, {}).setdefault(kind, []).append(offset + rows)
        for kind, nodes in mesh.cells.items():
            cells.setdefault(kind, []).append(at[nodes])
        for name, side in mesh.sides.items():
            for kind, faces in side.items():
                sides.setdefault(name, {}).setdefault(kind, []).append(at[faces])
    points = np.concatenate([mesh.points for mesh, _ in parts])[first]
    once = {n: {k: _once(np.concatenate(f)) for k, f in s.items()} for n, s in sides.items()}
    return Mesh(points, _long(cells), {n: _long(g) for n, g in groups.items()}, once), numbers


def _long(lists: Mapping[str, list[Integers]]) -> dict[str, Integers]:
    return {kind: np.concatenate(parts) for kind, parts in lists.items()}


def _once(faces: Integers) -> Integers:
    """Faces that stand in the files of two parts, once."""
    return faces[first_occurrences(faces)[0]]


def write_parts(mesh: Mesh, path: Path, count: int) -> None:
    """See `Mesh.write`."""
    cells = sum(map(len, mesh.cells.values()))
    if path.suffix != _ONE:
        raise MeshError(f"write({str(path)!r}, parts={count}): parts are written as .npz")
    if not (isinstance(count, int) and 1 <= count <= cells):
        raise MeshError(f"parts = {count}: a number from 1 to {cells}, of cells, is needed")
    mesh.require_whole("write(parts=...)")
    if mesh.numbers is not None:
        raise MeshError("write(parts=...): not for a mesh whose cells have nodes of their own")
    centres = [mesh.points[nodes].mean(axis=1) for nodes in mesh.cells.values()]
    part = np.empty(cells, dtype=np.int64)
    _cut(np.concatenate(centres), np.arange(cells), range(count), part)
    rows = np.split(part, np.cumsum([len(c) for c in centres])[:-1])
    parts = dict(zip(mesh.cells, rows, strict=True))
    left = {name: dict(mesh.faces(name)) for name in mesh.sides}
    for number in range(count):
        selection = _Chosen.of(
            mesh, {kind: np.flatnonzero(p == number) for kind, p in parts.items()}
        )
        write_arrays(_file(path, number), selection.arrays(mesh, left))
    lost = [name for name, side in left.items() if any(map(len, side.values()))]
    if lost:
        raise MeshError(f"write(parts=...): side {lost[0]!r} has faces of no cell")


def _cut(centres: Array, cell_numbers: Integers, parts: range, part: Integers) -> None:
    """Cut cells across their longest extent until there is one part each."""
    if len(parts) == 1:
        part[cell_numbers] = parts[0]
        return
    centres_here, half = centres[cell_numbers], len(parts) // 2
    order = cell_numbers[
        np.argsort(centres_here[:, np.ptp(centres_here, axis=0).argmax()], kind="stable")
    ]
    first = len(cell_numbers) * half // len(parts)
    _cut(centres, order[:first], parts[:half], part)
    _cut(centres, order[first:], parts[half:], part)


@dataclass(frozen=True, eq=False)
class _Chosen:
    """Cells of a part by kind, rising; used: their nodes; place: (points,) where these stand."""

    rows: Mapping[str, Integers]
    used: Integers
    position: Integers

    @classmethod
    def of(cls, mesh: Mesh, rows: Mapping[str, Integers]) -> _Chosen:
        used = np.unique(np.concatenate([mesh.cells[k][r].ravel() for k, r in rows.items()]))
        position = np.full(len(mesh.points), -1)
        position[used] = np.arange(len(used))
        return cls(rows, used, position)

    def arrays(self, mesh: Mesh, left: dict[str, dict[str, Integers]]) -> dict[str, Array]:
        """Arrays of the file; faces of sides are taken out of those that are `left`."""
        result: dict[str, Any] = {"points": mesh.points[self.used], "numbers": self.used}
        faces: dict[str, list[Integers]] = {}
        for kind, rows in self.rows.items():
            nodes = mesh.cells[kind][rows]
            result[f"cells:{kind}"] = self.position[nodes]
            for face, local in CELLS[kind].side_nodes:
                faces.setdefault(face.name, []).append(nodes[:, list(local)])
        for name, group in mesh.groups.items():
            for kind, members in group.items():
                at = np.flatnonzero(np.isin(self.rows[kind], members))
                result[f"group:{kind}:{name}"] = at
        for name, side in left.items():
            for kind, side_faces in side.items():
                if kind in faces:
                    cell_faces = np.concatenate(faces[kind])
                    belongs = match_faces(side_faces, cell_faces, CELLS[kind].corners) >= 0
                else:  # points or edges: in the first part that has them
                    belongs = np.asarray((self.position[side_faces] >= 0).all(axis=1))
                result[f"side:{kind}:{name}"] = self.position[side_faces[belongs]]
                side[kind] = side_faces[~belongs]
        return result
