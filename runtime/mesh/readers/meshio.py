"""Mesh files: groups of cells become named cells and sides, and back; others than Gmsh's (.msh),
those of Abaqus and CalculiX (.inp) and universal files (.unv) by meshio.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import numpy as np

from softehl.log import warn
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.io import write_text
from softehl.runtime.mesh.cells import BY_FILE, CELLS, for_vtk, jacobians
from softehl.runtime.mesh.mesh import Mesh, MeshError
from softehl.runtime.mesh.readers import abaqus, gmsh, unv
from softehl.runtime.mesh.readers.file_content import Content
from softehl.runtime.suggestions import join_names

_DEFECTS = (
    *(OSError, ValueError, KeyError, IndexError, TypeError, AssertionError, SystemExit),
    *(RuntimeError, AttributeError),
)
_VTK = (".vtu", ".vtk")
_NAMED = (".msh", ".inp", ".unv", ".vtu", ".vtk", ".med")
"""Formats whose files keep names."""
_GROUP, _SIDE = "group:", "side:"
"""Beginnings of the names of cell data (of nodes: data of points) that are 1 in what has a name."""
_PLAIN = "".join(chr(k) for k in range(32, 127) if chr(k) != "%")
_DATA = {"nastran:ref": "property"}
"""What the numbers of cells are called in names, where it is not their name in meshio."""

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


def content_of(path: Path) -> Content:
    """Content of a mesh file.  Raises MeshError."""
    if not path.is_file():
        split = path.with_name(f"{path.stem}_1{path.suffix}").is_file()
        hint = f"; parts of it are there: Mesh.read({path.name!r}, spread=True)" if split else ""
        raise MeshError(f"no mesh file {str(path)!r}{hint}")
    if path.suffix == ".npz":
        raise MeshError(f"{path}: one part of a mesh; all of them: Mesh.read(..., spread=True)")
    try:
        data = path.read_bytes() if path.suffix == ".msh" else b""
        if path.suffix.lower() == ".inp" or data.lstrip().startswith(b"*"):  # or of CalculiX's cgx
            return abaqus.read(path)
        if path.suffix.lower() == ".unv":
            return unv.read(path)
        return gmsh.parse(data) if b"$MeshFormat" in data else _by_meshio(path)
    except ModuleNotFoundError as error:
        raise MeshError(
            f"{path}: meshio reads {path.suffix} with the package {error.name}: pip install "
            f"{error.name}"
        ) from None
    except _DEFECTS as error:
        reason = " ".join(str(error).split()) or "not a mesh file that meshio knows"
        raise MeshError(f"{path}: {reason}") from None


def import_meshio() -> Any:
    """The package, which is slow to import; version 5.3.5 lacks the dimension of a cell."""
    import meshio

    meshio._mesh.topological_dimension.setdefault("wedge15", 3)
    return meshio


def _by_meshio(path: Path) -> Content:
    """Raises MeshError for cells that are not known, or what is wrong with the file."""
    meshio = import_meshio()
    try:
        file_mesh = meshio.read(path)
    except meshio.ReadError as error:
        raise ValueError(str(error)) from None
    cells: dict[str, list[Integers]] = {}
    names: dict[str, dict[str, list[Integers]]] = {}
    points = np.asarray(file_mesh.points, dtype=np.float64)
    named = _named_by_meshio(file_mesh)
    for number, block in enumerate(file_mesh.cells):
        if block.type not in BY_FILE or not BY_FILE[block.type].exponents:
            allowed = ", ".join(BY_FILE)
            raise ValueError(f"cells of kind {block.type!r} are not known; known: {allowed}")
        kind = BY_FILE[block.type].name
        previous = cells.setdefault(kind, [])
        first = sum(map(len, previous))
        for name, members in named.items():
            names.setdefault(name, {}).setdefault(kind, []).append(first + members[number])
        nodes = np.asarray(block.data, dtype=np.int64)
        previous.append(_upright(kind, points, nodes) if _may_be_turned(path, kind) else nodes)
    return Content(
        points,
        {kind: np.concatenate(parts) for kind, parts in cells.items()},
        {n: {k: np.unique(np.concatenate(v)) for k, v in m.items()} for n, m in names.items()},
        sides={
            name: {"point1": nodes[:, None]} for name, nodes in _named_points(file_mesh).items()
        },
    )


def _named_by_meshio(file_mesh: Any) -> dict[str, list[Integers]]:
    """Name -> for each block of cells the numbers of those that have it: sets, families of MED,
    flags of our own, and each value of other whole numbers of cells.
    """
    named = {n: [np.asarray(m, np.int64) for m in sets] for n, sets in file_mesh.cell_sets.items()}
    families = getattr(file_mesh, "cell_tags", None)
    for data, blocks in file_mesh.cell_data.items():
        parts = [np.asarray(values) for values in blocks]
        if any(part.ndim != 1 or part.dtype.kind not in "iu" for part in parts):
            continue
        values = np.unique(np.concatenate(parts)).tolist()
        if data.startswith((_GROUP, _SIDE)):
            pairs = [(1, unquote(data.partition(":")[2]))]
        elif data == "cell_tags" and families is not None:
            pairs = [(number, name) for number, some in families.items() for name in some]
        elif len(values) == sum(map(len, parts)):  # numbers of the cells themselves
            continue
        else:
            label = _DATA.get(data, data.rpartition(":")[2])
            pairs = [(value, f"{label} {value}") for value in values]
        for value, name in pairs:
            inside = [np.flatnonzero(part == value) for part in parts]
            previous = named.get(name, [part[:0] for part in inside])
            named[name] = [np.concatenate(both) for both in zip(previous, inside, strict=True)]
    return named


def _named_points(file_mesh: Any) -> dict[str, Integers]:
    """Name -> numbers of points: sets, families of MED, and flags of our own."""
    named = {name: np.asarray(nodes, np.int64) for name, nodes in file_mesh.point_sets.items()}
    for data, values in file_mesh.point_data.items():
        if data.startswith(_SIDE):
            named[unquote(data.removeprefix(_SIDE))] = np.flatnonzero(values)
    families = np.asarray(file_mesh.point_data.get("point_tags", ()))
    for number, some in getattr(file_mesh, "point_tags", {}).items():
        for name in some:
            previous = named.get(name, np.empty(0, np.int64))
            named[name] = np.union1d(previous, np.flatnonzero(families == number))
    return named


def _may_be_turned(path: Path, kind: str) -> bool:
    """True for cells that a format has the other way round than meshio hands them on: all solids
    of MED; wedges of VTK, which some programs write so and others not.
    """
    solid = CELLS[kind].dimension == 3
    return solid and (path.suffix == ".med" or (CELLS[kind].vtk_mirrored and path.suffix in _VTK))


def _upright(kind: str, points: Array, nodes: Integers) -> Integers:
    """Cells (m, k) of 3-D, those with a negative volume turned over."""
    cell = CELLS[kind]
    centre = cell.nodes[: cell.corners].mean(axis=0)[None]
    turned = jacobians(cell, points[nodes], centre)[:, 0] < 0.0
    return np.where(turned[:, None], nodes[:, list(cell.mirrored)], nodes)


def highest(path: Path, cells: Mapping[str, Integers]) -> int:
    """Dimension of the cells that are the mesh.  Raises MeshError where there are none."""
    top = max((CELLS[kind].dimension for kind, nodes in cells.items() if len(nodes)), default=0)
    if not top:
        raise MeshError(f"{path}: there are no cells")
    return top


def mesh_of(content: Content, points: Array, top: int) -> tuple[Mesh, Integers]:
    """The mesh, whose cells have the highest dimension, and which points of the file it has: those
    of cells (mesh generators leave the centres of arcs). Named cells of a lower dimension are
    sides, those of the highest of these dimensions where one name has several.
    """
    cells, names = content.cells, content.names
    groups: dict[str, dict[str, Integers]] = {}
    sides: dict[str, dict[str, Integers]] = {n: dict(side) for n, side in content.sides.items()}
    for name, members in names.items():
        dimensions = [CELLS[kind].dimension for kind, numbers in members.items() if len(numbers)]
        side = max((d for d in dimensions if d < top), default=-1)
        for kind, numbers in members.items():
            if not len(numbers):
                continue
            if CELLS[kind].dimension == top:
                groups.setdefault(name, {})[kind] = numbers
            elif CELLS[kind].dimension == side:
                sides.setdefault(name, {})[kind] = cells[kind][numbers]
    main = {kind: nodes for kind, nodes in cells.items() if CELLS[kind].dimension == top}
    used = np.unique(np.concatenate([nodes.ravel() for nodes in main.values()]))
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    lost = []
    for name, faces in list(sides.items()):
        renumbered = {kind: number[nodes] for kind, nodes in faces.items()}
        complete = {kind: nodes[(nodes >= 0).all(axis=1)] for kind, nodes in renumbered.items()}
        sides[name] = {kind: nodes for kind, nodes in complete.items() if len(nodes)}
        if any(len(complete[kind]) < len(nodes) for kind, nodes in renumbered.items()):
            lost.append(name)
        if not sides[name]:
            del sides[name]
    if lost:
        warn(
            f"{join_names(map(repr, lost))}: nodes of none of the cells of the mesh are left out",
            stacklevel=4,
        )
    main = {kind: number[nodes] for kind, nodes in main.items()}
    return Mesh(points[used], main, groups, sides), used


def write(mesh: Mesh, path: Path) -> None:
    """See `Mesh.write`: in .msh and for VTK sides are cells of one dimension less, with names."""
    high = [kind for kind in mesh.cells if not CELLS[kind].exponents]
    if high:
        raise MeshError(
            f"{high[0]}: cells of order 3 and more cannot be written as a mesh, formats know no "
            "nodes of Gauss and Lobatto; write a result for pictures"
        )
    if path.suffix == ".npz":
        raise MeshError(f"write({path.name!r}): say how many files, as in parts=2; or write a .vtu")
    points = np.pad(mesh.points, ((0, 0), (0, 3 - mesh.dimension)))
    try:
        if path.suffix == ".msh":
            write_text(path, gmsh.text(points, *_named(mesh)))
        elif path.suffix.lower() == ".inp":
            sides = {name: mesh.faces(name) for name in mesh.sides}
            text = abaqus.text(points, mesh.cells, mesh.groups, sides, mesh.dimension)
            write_text(path, text)
        elif path.suffix.lower() == ".unv":
            write_text(path, unv.text(points, *_named(mesh), mesh.dimension))
        else:
            _write_by_meshio(mesh, points, path)
    except ModuleNotFoundError as error:
        raise MeshError(
            f"cannot write {str(path)!r}: meshio needs the package {error.name}: pip install "
            f"{error.name}"
        ) from None
    except _DEFECTS as error:
        reason = " ".join(str(error).split())
        if isinstance(error, KeyError):  # meshio's tables of cells
            reason = f"{path.suffix} has no cells {reason}"
        raise MeshError(f"cannot write {str(path)!r}: {reason}") from None


def _write_by_meshio(mesh: Mesh, points: Array, path: Path) -> None:
    """Names as data of cells and points of VTK, as families of MED; a warning where a format has
    none.
    """
    meshio = import_meshio()

    cells = dict(mesh.cells)
    flags: dict[str, Any] = {}
    data: dict[str, Any] = {}
    tags: dict[str, dict[int, list[str]]] = {}
    if path.suffix in _VTK:
        cells, flags, data = _flagged(mesh, "" if path.suffix == ".vtk" else _PLAIN)
    elif path.suffix == ".med":
        cells, flags, data, tags = _families(mesh)
    elif mesh.groups or mesh.sides:
        warn(
            f"{path.name}: names are not written ({join_names([*mesh.groups, *mesh.sides])}); "
            f"{join_names(_NAMED)} keep them",
            stacklevel=4,
        )
    blocks = [(CELLS[kind].meshio, nodes) for kind, nodes in cells.items()]
    file_mesh = meshio.Mesh(points, blocks, data, flags)
    for attribute, families in tags.items():
        setattr(file_mesh, attribute, families)
    try:
        meshio.write(path, file_mesh)
    except meshio.WriteError as error:
        raise ValueError(str(error)) from None


def _flagged(mesh: Mesh, safe: str) -> tuple[dict[str, Integers], dict[str, Any], dict[str, Any]]:
    """For VTK, the cells with the faces of sides, and data of cells and of points that are 1 in
    what has a name, else 0. safe: letters that names may have besides letters of ASCII and digits.
    """
    cells, names = _named(mesh)
    points = cells.pop("point1", np.empty((0, 1), np.int64)).ravel()
    flags: dict[str, Any] = {}
    data: dict[str, Any] = {}
    for name, members in names.items():
        title = quote(name, safe=safe)
        cell_flags = {kind: np.zeros(len(nodes), np.int8) for kind, nodes in cells.items()}
        for kind, numbers in members.items():
            if kind == "point1":
                data[_SIDE + title] = np.zeros(len(mesh.points), np.int8)
                data[_SIDE + title][points[numbers]] = 1
            else:
                cell_flags[kind][numbers] = 1
        if set(members) - {"point1"}:
            flags[(_GROUP if name in mesh.groups else _SIDE) + title] = list(cell_flags.values())
    return {kind: for_vtk(kind, nodes) for kind, nodes in cells.items()}, flags, data


def _families(
    mesh: Mesh,
) -> tuple[dict[str, Integers], dict[str, Any], dict[str, Any], dict[str, dict[int, list[str]]]]:
    """For MED, the cells with the faces of sides, solids the other way round; the family of every
    cell and point, and the names of every family: negative numbers for cells, positive for points.
    """
    cells, names = _named(mesh)
    points = cells.pop("point1", np.empty((0, 1), np.int64)).ravel()
    at_points: list[list[str]] = [[] for _ in mesh.points]
    of_cells: dict[str, list[list[str]]] = {k: [[] for _ in v] for k, v in cells.items()}
    for name, members in names.items():
        for kind, numbers in members.items():
            lists = at_points if kind == "point1" else of_cells[kind]
            for k in points[numbers] if kind == "point1" else numbers:
                lists[k].append(name)
    families: dict[tuple[str, ...], int] = {(): 0}
    of_kinds = {
        kind: np.array([families.setdefault(tuple(n), -len(families)) for n in lists], np.int64)
        for kind, lists in of_cells.items()
    }
    point_families: dict[tuple[str, ...], int] = {(): 0}
    at = [point_families.setdefault(tuple(n), len(point_families)) for n in at_points]
    tags = {
        attribute: {number: list(some) for some, number in names_by_number.items() if some}
        for attribute, names_by_number in (("cell_tags", families), ("point_tags", point_families))
    }
    turned = {
        kind: nodes[:, list(CELLS[kind].mirrored)] if CELLS[kind].dimension == 3 else nodes
        for kind, nodes in cells.items()
    }
    return turned, {"cell_tags": list(of_kinds.values())}, {"point_tags": np.array(at)}, tags


def _named(mesh: Mesh) -> tuple[dict[str, Integers], dict[str, dict[str, Integers]]]:
    """The cells and the faces of sides, and the names of both."""
    cells = dict(mesh.cells)
    names = {name: dict(group) for name, group in mesh.groups.items()}
    for name in mesh.sides:
        for kind, faces in mesh.faces(name).items():
            previous = cells.get(kind, faces[:0])
            names.setdefault(name, {})[kind] = len(previous) + np.arange(len(faces))
            cells[kind] = np.concatenate([previous, faces])
    return cells, names
