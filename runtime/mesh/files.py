"""Mesh files: groups of cells become named cells and sides, and back; Gmsh's, others by meshio."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.io import write_text
from softehl.runtime.mesh import gmsh
from softehl.runtime.mesh.cells import BY_FILE, CELLS, for_vtk, from_vtk
from softehl.runtime.mesh.mesh import Mesh, MeshError

_DEFECTS = (OSError, ValueError, KeyError, IndexError, TypeError, AssertionError, SystemExit)
_VTK = (".vtu", ".vtk")

Names = Mapping[str, Mapping[str, Integers]]
"""Name -> kind of cell -> numbers of cells of that kind."""


def read(path: Path) -> Mesh:
    """See `Mesh.read`."""
    content = content_of(path)
    points = content.points
    top = highest(path, content.cells)
    if points.shape[1] > top and not np.ptp(points[:, top:], axis=0).any():
        points = points[:, :top]
    return mesh_of(content, np.ascontiguousarray(points), top)[0]


def content_of(path: Path) -> gmsh.Content:
    """Content of a mesh file.  Raises MeshError."""
    if not path.is_file():
        split = path.with_name(f"{path.stem}_1{path.suffix}").is_file()
        hint = f"; parts of it are there: Mesh.read({path.name!r}, spread=True)" if split else ""
        raise MeshError(f"no mesh file {str(path)!r}{hint}")
    if path.suffix == ".npz":
        raise MeshError(f"{path}: one part of a mesh; all of them: Mesh.read(..., spread=True)")
    try:
        data = path.read_bytes() if path.suffix == ".msh" else b""
        return gmsh.parse(data) if b"$MeshFormat" in data else _by_meshio(path)
    except _DEFECTS as error:
        words = " ".join(str(error).split()) or "not a mesh file that meshio knows"
        raise MeshError(f"{path}: {words}") from None


def _by_meshio(path: Path) -> gmsh.Content:
    """Raises MeshError for cells that are not known, or what is wrong with the file."""
    import meshio  # late: it is slow to import

    try:
        found = meshio.read(path)
    except meshio.ReadError as error:
        raise ValueError(str(error)) from None
    cells: dict[str, list[Integers]] = {}
    names: dict[str, dict[str, list[Integers]]] = {name: {} for name in found.cell_sets}
    for number, block in enumerate(found.cells):
        if block.type not in BY_FILE or not BY_FILE[block.type].exponents:
            known = ", ".join(BY_FILE)
            raise ValueError(f"cells of kind {block.type!r} are not known; known: {known}")
        kind = BY_FILE[block.type].name
        before = cells.setdefault(kind, [])
        first = sum(map(len, before))
        for name, members in found.cell_sets.items():
            chosen = np.asarray(members[number], dtype=np.int64)
            names[name].setdefault(kind, []).append(first + chosen)
        nodes = np.asarray(block.data, dtype=np.int64)
        before.append(from_vtk(kind, nodes, found.points) if path.suffix in _VTK else nodes)
    return gmsh.Content(
        np.asarray(found.points, dtype=np.float64),
        {kind: np.concatenate(parts) for kind, parts in cells.items()},
        {n: {k: np.unique(np.concatenate(v)) for k, v in m.items()} for n, m in names.items()},
    )


def highest(path: Path, cells: Mapping[str, Integers]) -> int:
    """Dimension of the cells that are the mesh.  Raises MeshError where there are none."""
    top = max((CELLS[kind].dimension for kind, nodes in cells.items() if len(nodes)), default=0)
    if not top:
        raise MeshError(f"{path}: there are no cells")
    return top


def mesh_of(content: gmsh.Content, points: Array, top: int) -> tuple[Mesh, Integers]:
    """The mesh, whose cells have the highest dimension, and which points of the file it has: those
    of cells (mesh generators leave the centres of arcs). Named cells of one dimension less are
    sides.
    """
    cells, names = content.cells, content.names
    groups: dict[str, dict[str, Integers]] = {}
    sides: dict[str, dict[str, Integers]] = {}
    for name, members in names.items():
        for kind, chosen in members.items():
            if not len(chosen):
                continue
            if CELLS[kind].dimension == top:
                groups.setdefault(name, {})[kind] = chosen
            elif CELLS[kind].dimension == top - 1:
                sides.setdefault(name, {})[kind] = cells[kind][chosen]
    main = {kind: nodes for kind, nodes in cells.items() if CELLS[kind].dimension == top}
    used = np.unique(np.concatenate([nodes.ravel() for nodes in main.values()]))
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    sides = {n: {k: number[f] for k, f in side.items()} for n, side in sides.items()}
    main = {kind: number[nodes] for kind, nodes in main.items()}
    return Mesh(points[used], main, groups, sides), used


def write(mesh: Mesh, path: Path) -> None:
    """See `Mesh.write`: to Gmsh sides are cells of one dimension less, with names."""
    high = [kind for kind in mesh.cells if not CELLS[kind].exponents]
    if high:
        raise MeshError(
            f"{high[0]}: cells of order 3 and more cannot be written as a mesh, formats know no "
            "nodes of Gauss and Lobatto; write a result for pictures"
        )
    if path.suffix == ".npz":
        raise MeshError(f"write({path.name!r}): say how many files, as in parts=2; or write a .vtu")
    points = np.pad(mesh.points, ((0, 0), (0, 3 - mesh.dimension)))
    if path.suffix == ".msh":
        try:
            write_text(path, gmsh.text(points, *_named(mesh)))
        except OSError as error:
            raise MeshError(f"cannot write {str(path)!r}: {error}") from None
        return
    import meshio

    vtk = path.suffix in _VTK
    cells = [(CELLS[k].meshio, for_vtk(k, n) if vtk else n) for k, n in mesh.cells.items()]
    try:
        meshio.write(path, meshio.Mesh(points, cells))
    except (*_DEFECTS, meshio.WriteError) as error:
        raise MeshError(f"cannot write {str(path)!r}: {' '.join(str(error).split())}") from None


def _named(mesh: Mesh) -> tuple[dict[str, Integers], dict[str, dict[str, Integers]]]:
    """The cells and the faces of sides, and the names of both."""
    cells = dict(mesh.cells)
    names = {name: dict(group) for name, group in mesh.groups.items()}
    for name in mesh.sides:
        for kind, faces in mesh.faces(name).items():
            before = cells.get(kind, faces[:0])
            names.setdefault(name, {})[kind] = len(before) + np.arange(len(faces))
            cells[kind] = np.concatenate([before, faces])
    return cells, names
