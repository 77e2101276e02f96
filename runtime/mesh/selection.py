"""Selection of nodes, faces and cells of a mesh: by names, predicates of coordinates and places."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.checks import MeshError, place_text
from softehl.runtime.mesh.face_matching import match_faces, orient_as
from softehl.runtime.suggestions import did_you_mean, join_names, misfit, short_list

if TYPE_CHECKING:
    from softehl.runtime.mesh.mesh import Mesh

Faces: TypeAlias = Mapping[str, Integers]
"""Kind of face -> node numbers (n, k), seen from outside counterclockwise."""
Predicate = Callable[[Array], Flags]
"""Of places (n, dim): which of them are meant, (n,)."""


def faces(mesh: Mesh, where: str | Predicate) -> Faces:
    """See `Mesh.faces`."""
    if callable(where):
        return faces_where(mesh, where, "the predicate")
    if where == "boundary" and where not in mesh.sides:
        return mesh.boundary
    if where not in mesh.sides:
        allowed = ", ".join([*mesh.sides, "boundary"])
        raise MeshError(f"no side {where!r}{did_you_mean(where, mesh.sides)}; there are {allowed}")
    return {
        kind: orient_as(side, mesh.boundary[kind], CELLS[kind].corners)
        if kind in mesh.boundary
        else side
        for kind, side in mesh.sides[where].items()
    }


def faces_where(mesh: Mesh, where: Predicate, name: str) -> Faces:
    """Faces of the boundary all of whose nodes a predicate selects; name: of the side.

    Raises MeshError where there are none.
    """
    inside = _evaluate(where, mesh.points, name)
    candidates = {kind: f[inside[f].all(axis=1)] for kind, f in mesh.boundary.items()}
    present = {kind: f for kind, f in candidates.items() if mesh.anywhere(len(f))}
    if not present:
        raise MeshError(f"side {name!r}: no face of the boundary has all its nodes there")
    return present


def outer_faces(mesh: Mesh, where: str | Predicate) -> Faces:
    """See `Mesh.outer_faces`."""
    selected = faces(mesh, where)
    solid = any(CELLS[kind].dimension == mesh.dimension for kind in mesh.cells)
    for kind, side in selected.items():
        cell, outer = CELLS[kind], mesh.boundary.get(kind, side[:0])
        if cell.dimension != mesh.dimension - 1:
            name = "the predicate" if callable(where) else f"side {where!r}"
            what = {0: "nodes", 1: "lines", 2: "faces"}.get(cell.dimension, "cells")
            face_word = {1: "nodes", 2: "lines"}.get(mesh.dimension, "faces")
            raise MeshError(
                f"{name} is of {what} ({kind}); in {mesh.dimension}-D a side of {face_word} of "
                f"the boundary is needed, such as {short_list(_outer_sides(mesh))}"
            )
        lost = side[match_faces(side, outer, cell.corners) < 0] if solid else side[:0]
        if len(lost):
            point_text = place_text(mesh.points[lost[0]].mean(axis=0))
            raise MeshError(
                f"the face at {point_text} is of two cells or of none: it has no outside"
            )
    return selected


def _outer_sides(mesh: Mesh) -> list[str]:
    """Names of sides of faces of one dimension less than the mesh."""
    dimension = mesh.dimension - 1
    names = [n for n, f in mesh.sides.items() if all(CELLS[k].dimension == dimension for k in f)]
    return [*names, "boundary"]


def nodes(mesh: Mesh, where: str | Predicate) -> Integers:
    """See `Mesh.nodes`."""
    if callable(where):
        selected = np.flatnonzero(_evaluate(where, mesh.points, "the predicate"))
        if not mesh.anywhere(len(selected)):
            raise MeshError("the predicate chooses no node")
        return selected
    if where in mesh.groups and where not in mesh.sides:
        parts = [mesh.cells[kind][rows] for kind, rows in mesh.groups[where].items()]
    else:
        parts = list(faces(mesh, where).values())
    unique = np.unique(np.concatenate([part.ravel() for part in parts]))
    return unique if mesh.piece is None else mesh.piece.everywhere(unique)


def cells_of(mesh: Mesh, group: str | None) -> Mapping[str, Integers]:
    """See `Mesh.cells_of`."""
    if group is None:
        return mesh.cells
    if group not in mesh.groups:
        allowed = ", ".join(mesh.groups) or "none"
        raise MeshError(
            f"no group {group!r}{did_you_mean(group, mesh.groups)}; there are {allowed}"
        )
    return {
        kind: mesh.cells[kind][rows]
        for kind, rows in mesh.groups[group].items()
        if mesh.anywhere(len(rows))
    }


def cells_where(mesh: Mesh, where: Predicate, name: str) -> dict[str, Integers]:
    """Numbers of the cells whose centre a predicate selects, by kind; name: of the group.

    Raises MeshError where there are none.
    """
    group = {}
    for kind, cells in mesh.cells.items():
        inside = _evaluate(where, mesh.points[cells].mean(axis=1), name)
        group[kind] = np.flatnonzero(inside)
    if not mesh.anywhere(any(map(len, group.values()))):
        raise MeshError(f"group {name!r}: the predicate chooses no cell")
    return group


def _evaluate(where: Predicate, points: Array, name: str) -> Flags:
    signature_error = misfit(where, "x")
    if signature_error:
        raise MeshError(f"{name}: {signature_error}, x of shape (n, dim)")
    selected = np.asarray(where(points))
    if selected.shape != (len(points),) or selected.dtype != np.bool_:
        raise MeshError(
            f"{name}: a predicate takes places of shape {points.shape} and gives booleans of shape "
            f"({len(points)},); this one gave {selected.dtype} of shape {selected.shape}"
        )
    return selected


def node_at(mesh: Mesh, place: Array) -> int:
    """See `Mesh.node_at`."""
    point = checked_place(mesh, place)
    distance = np.linalg.norm(mesh.points - point, axis=1)
    nearest = int(distance.argmin())
    if distance[nearest] > mesh.tolerance:
        raise MeshError(
            f"no node at {place_text(point)}; the nearest is number {nearest} at "
            f"{place_text(mesh.points[nearest])}"
        )
    _require_one(np.flatnonzero(distance <= mesh.tolerance), point)
    return nearest


def nodes_at(mesh: Mesh, place: Array) -> Integers:
    """See `Mesh.nodes_at`."""
    point = checked_place(mesh, place)
    selected = np.flatnonzero(np.linalg.norm(mesh.points - point, axis=1) <= mesh.tolerance)
    if mesh.piece is not None:
        selected = mesh.piece.everywhere(selected)
        if not mesh.anywhere(len(selected)):
            raise MeshError(f"no node at {place_text(point)}, in any part of the mesh")
    elif mesh.numbers is None or not len(selected):
        return np.array([node_at(mesh, place)])
    if len(np.unique(mesh.origin[selected])) > 1:
        _require_one(selected, point)
    return selected


def _require_one(selected: Integers, point: Array) -> None:
    if len(selected) > 1:
        raise MeshError(
            f"{len(selected)} nodes are at {place_text(point)}: name one by its number, "
            f"{join_names(map(str, selected))}, or a side of one body"
        )


def checked_place(mesh: Mesh, coordinates: Array) -> Array:
    """A place as an array, which may be given as a tuple.  Raises MeshError."""
    if isinstance(coordinates, np.ma.MaskedArray) or np.asarray(coordinates).dtype == np.bool_:
        raise MeshError(f"a place has {mesh.dimension} numbers, given {coordinates!r}")
    point = np.asarray(coordinates, dtype=np.float64)
    if point.shape != (mesh.dimension,) or not np.isfinite(point).all():
        raise MeshError(f"a place has {mesh.dimension} coordinates, given {point.tolist()}")
    return point
