"""Mesh files by meshio: physical groups and cell sets become named cells and sides, and back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from softehl.runtime.arrays import Integers
from softehl.runtime.mesh.cells import BY_FILE, CELLS
from softehl.runtime.mesh.mesh import Mesh, MeshError

_DEFECTS = (OSError, ValueError, KeyError, IndexError, TypeError, AssertionError, SystemExit)


def read(path: Path) -> Mesh:
    """See `Mesh.read`."""
    import meshio  # late: it is slow to import

    if not path.is_file():
        raise MeshError(f"no mesh file {str(path)!r}")
    try:
        found = meshio.read(path)
    except (*_DEFECTS, meshio.ReadError) as error:
        words = " ".join(str(error).split()) or "not a mesh file that meshio knows"
        raise MeshError(f"{path}: {words}") from None
    blocks = [(BY_FILE.get(block.type), np.asarray(block.data)) for block in found.cells]
    for cell, block in zip((c for c, _ in blocks), found.cells, strict=True):
        if cell is None:
            known = ", ".join(BY_FILE)
            raise MeshError(f"{path}: cells of kind {block.type!r} are not known; known: {known}")
    return _mesh(path, np.asarray(found.points, dtype=np.float64), blocks, _names(found))


def _names(found: Any) -> dict[str, list[Integers]]:
    """Name -> for each block of the file the numbers of its cells that have the name."""
    named = {n: [np.asarray(i, dtype=np.int64) for i in s] for n, s in found.cell_sets.items()}
    tags = found.cell_data.get("gmsh:physical")
    for name, (tag, _) in getattr(found, "field_data", {}).items():
        if tags is not None:
            named[name] = [np.flatnonzero(np.asarray(block) == tag) for block in tags]
    return {name: parts for name, parts in named.items() if not name.startswith("gmsh:")}


def _mesh(path: Path, points: Any, blocks: list[Any], names: dict[str, list[Integers]]) -> Mesh:
    """Cells of the highest dimension are the mesh; of one less they are sides."""
    top = max((cell.dimension for cell, data in blocks if len(data)), default=0)
    if not top:
        raise MeshError(f"{path}: there are no cells")
    if points.shape[1] > top and not np.ptp(points[:, top:], axis=0).any():
        points = points[:, :top]
    cells: dict[str, list[Integers]] = {}
    first: list[int] = []
    for cell, data in blocks:
        before = cells.setdefault(cell.name, []) if cell.dimension == top else []
        first.append(sum(map(len, before)))
        before.append(data.astype(np.int64))
    kinds = {name: np.concatenate(parts) for name, parts in cells.items()}
    mesh = Mesh(np.ascontiguousarray(points), kinds)
    groups: dict[str, dict[str, Integers]] = {}
    sides: dict[str, dict[str, Integers]] = {}
    for name, parts in names.items():
        for (cell, data), start, chosen in zip(blocks, first, parts, strict=True):
            if not len(chosen):
                continue
            if cell.dimension == top:
                known = groups.setdefault(name, {})
                known[cell.name] = _joined(known.get(cell.name), start + chosen)
            elif cell.dimension == top - 1:
                known = sides.setdefault(name, {})
                faces = _outward(mesh, cell.name, data[chosen].astype(np.int64))
                known[cell.name] = _joined(known.get(cell.name), faces)
    return _used(Mesh(mesh.points, mesh.cells, groups, sides))


def _joined(before: Integers | None, more: Integers) -> Integers:
    return more if before is None else np.concatenate([before, more])


def _outward(mesh: Mesh, kind: str, faces: Integers) -> Integers:
    """Faces as the cells of the mesh have them, from outside; those inside stay as they are."""
    known = mesh.boundary.get(kind)
    if known is None:
        return faces
    corners = CELLS[kind].corners
    place = {tuple(sorted(row[:corners])): k for k, row in enumerate(known.tolist())}
    rows = [place.get(tuple(sorted(row[:corners]))) for row in faces.tolist()]
    return np.array([f if k is None else known[k] for f, k in zip(faces, rows, strict=True)])


def _used(mesh: Mesh) -> Mesh:
    """Without the points that no cell has (centres of arcs that mesh generators leave)."""
    used = np.unique(np.concatenate([nodes.ravel() for nodes in mesh.cells.values()]))
    if len(used) == len(mesh.points):
        return mesh
    number = np.full(len(mesh.points), -1)
    number[used] = np.arange(len(used))
    sides = {n: {k: number[f] for k, f in side.items()} for n, side in mesh.sides.items()}
    cells = {kind: number[nodes] for kind, nodes in mesh.cells.items()}
    return Mesh(mesh.points[used], cells, mesh.groups, sides)


def write(mesh: Mesh, path: Path) -> None:
    """See `Mesh.write`: to Gmsh sides are cells of one dimension less, with names."""
    import meshio

    points = np.pad(mesh.points, ((0, 0), (0, 3 - mesh.dimension)))
    if path.suffix == ".msh":
        found, options = _named(mesh, points), {"file_format": "gmsh22", "binary": False}
    else:
        cells = [(CELLS[kind].meshio, nodes) for kind, nodes in mesh.cells.items()]
        found, options = meshio.Mesh(points, cells), {}
    try:
        meshio.write(path, found, **options)
    except (*_DEFECTS, meshio.WriteError) as error:
        raise MeshError(f"cannot write {str(path)!r}: {' '.join(str(error).split())}") from None


def _named(mesh: Mesh, points: Any) -> Any:
    """The mesh with its groups and sides, as meshio has it."""
    import meshio

    blocks = list(mesh.cells.items())
    sets: dict[str, list[Integers]] = {}
    for name, group in mesh.groups.items():
        sets[name] = [group.get(kind, np.empty(0, dtype=np.int64)) for kind in mesh.cells]
    for name, side in mesh.sides.items():
        for kind, faces in side.items():
            parts = sets.setdefault(name, [])
            parts += [np.empty(0, dtype=np.int64)] * (len(blocks) - len(parts))
            parts.append(np.arange(len(faces)))
            blocks.append((kind, faces))
    for parts in sets.values():
        parts += [np.empty(0, dtype=np.int64)] * (len(blocks) - len(parts))
    tags, field_data = _tags(blocks, sets)
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    cells = [(CELLS[kind].meshio, nodes) for kind, nodes in blocks]
    return meshio.Mesh(points, cells, cell_data=data, field_data=field_data)


def _tags(
    blocks: list[tuple[str, Integers]], sets: dict[str, list[Integers]]
) -> tuple[list[Integers], dict[str, Any]]:
    """Gmsh's form of names: one number for each cell, a name for each number."""
    tags = [np.zeros(len(nodes), dtype=np.int64) for _, nodes in blocks]
    field_data = {}
    for number, (name, parts) in enumerate(sets.items(), start=1):
        dimension = 0
        for (kind, _), tag, chosen in zip(blocks, tags, parts, strict=True):
            if not len(chosen):
                continue
            if tag[chosen].any():
                raise MeshError(f"a cell of {name!r} has another name too: Gmsh files hold one")
            tag[chosen], dimension = number, CELLS[kind].dimension
        field_data[name] = np.array([number, dimension])
    return tags, field_data
