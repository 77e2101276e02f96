"""Facets with the cells beside them: between two cells, and on sides.

Cells stand with their nodes turned so that the facet is their first face, and so that corner k of
the facet in one cell is corner 1 - k (counted in a circle) in the other: what pages on facets
(`codegen.language.boundary_model`) expect.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from softehl.runtime.arrays import Integers
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.face_matching import match_faces
from softehl.runtime.mesh.mesh import Mesh, MeshError, Predicate

SHAPES = ("tri", "quad", "tet", "hex")
"""Cells that have facets of one kind."""


@cache
def turns(kind: str) -> Integers:
    """Nodes of a cell turned, (faces, corners of a face, nodes): face f is the first, its corner
    r the first corner.
    """
    cell = CELLS[kind]
    if not kind.startswith(SHAPES):
        raise MeshError(f"facets of {kind}: cells must be of {', '.join(SHAPES)}")
    corners, middle = cell.nodes[: cell.corners], cell.nodes[: cell.corners].mean(axis=0)
    first = np.vstack([corners[list(cell.sides[0])], middle])
    from_first = np.linalg.pinv(np.column_stack([first, np.ones(len(first))]))
    turned = []
    for face in cell.sides:
        for r in range(len(face)):
            to = np.vstack([corners[list(np.roll(face, -r))], middle])
            moved = np.column_stack([cell.nodes, np.ones(len(cell.nodes))]) @ from_first @ to
            distance = np.linalg.norm(cell.nodes[None] - moved[:, None], axis=2)
            assert distance.min(axis=1).max() < 1e-9
            turned.append(distance.argmin(axis=1))
    return np.array(turned).reshape(len(cell.sides), len(cell.sides[0]), len(cell.nodes))


def interior(mesh: Mesh, kind: str) -> Integers:
    """Facets between two cells of a kind: nodes (n, 2 k) of both.  Raises MeshError."""
    mesh.require_whole('on="interior"')
    if len(mesh.cells) > 1:
        raise MeshError(f'on="interior": the mesh has {", ".join(mesh.cells)}; one kind is needed')
    turned, cells = turns(kind), mesh.cells[kind]
    faces = len(turned)
    every = cells[:, turned[:, 0]].reshape(-1, cells.shape[1])  # (cells * faces, k)
    at = list(CELLS[kind].sides[0])
    corners = mesh.origin[every[:, at]]
    _, inverse = np.unique(np.sort(corners, axis=1), axis=0, return_inverse=True)
    order = np.argsort(inverse.ravel(), kind="stable")
    same = np.flatnonzero(np.diff(inverse.ravel()[order]) == 0)
    one, other = order[same], order[same + 1]
    if not len(one):
        raise MeshError('on="interior": the mesh has no facet between two cells')
    # corner 1 of the first cell is corner 0 of the second
    turn = (corners[other] == corners[one][:, 1:2]).argmax(axis=1)
    second = np.take_along_axis(cells[other // faces], turned[other % faces, turn], axis=1)
    return np.ascontiguousarray(np.hstack([every[one], second]))


def cells_at_side(mesh: Mesh, where: str | Predicate, kind: str) -> Integers:
    """Nodes (n, k) of the cells of a kind at the faces of a side, turned."""
    turned, cells = turns(kind), mesh.cells[kind]
    every = cells[:, turned[:, 0]].reshape(-1, cells.shape[1])
    face, at = CELLS[kind].side_nodes[0]
    faces = mesh.outer_faces(where).get(face.name, np.empty((0, len(at)), dtype=np.int64))
    rows = match_faces(faces, every[:, list(at)], face.corners)
    return np.ascontiguousarray(every[rows[rows >= 0]])


def split(mesh: Mesh) -> Mesh:
    """The mesh with nodes of its own for every cell: fields on it are discontinuous.

    Sides and groups stay; `origin` tells which nodes were one.
    """
    mesh.require_whole("split")
    first, cells, copied = 0, {}, []
    for kind, nodes in mesh.cells.items():
        cells[kind] = first + np.arange(nodes.size).reshape(nodes.shape)
        copied.append(nodes.ravel())
        first += nodes.size
    old = np.concatenate(copied)
    sides: dict[str, dict[str, Integers]] = {}
    for name in mesh.sides:
        sides[name] = {}
        for face, side_faces in mesh.faces(name).items():
            new_faces, cell_faces = [], []
            for kind, nodes in mesh.cells.items():
                for of, local in CELLS[kind].side_nodes:
                    if of.name == face:
                        cell_faces.append(nodes[:, list(local)])
                        new_faces.append(cells[kind][:, list(local)])
            if not cell_faces:
                sides[name][face] = _copies(mesh, cells, side_faces)
                continue
            rows = match_faces(side_faces, np.concatenate(cell_faces), CELLS[face].corners)
            sides[name][face] = np.concatenate(new_faces)[rows]
    return Mesh(mesh.points[old], cells, mesh.groups, sides, mesh.origin[old])


def _copies(mesh: Mesh, cells: dict[str, Integers], rows: Integers) -> Integers:
    """Points, edges or cells (m, k), which are no faces of cells, in each of the cells (new nodes
    by kind) that have them.
    """
    copies = [np.empty((0, rows.shape[1]), dtype=np.int64)]
    for kind, nodes in mesh.cells.items():
        if rows.shape[1] == 1:
            copies.append(cells[kind][np.isin(nodes, rows)][:, None])
            continue
        for row in rows:
            cells_of_row = np.flatnonzero(np.isin(nodes, row).sum(axis=1) == len(row))
            local = (nodes[cells_of_row][:, None] == row[:, None]).argmax(axis=2)
            copies.append(np.take_along_axis(cells[kind][cells_of_row], local, axis=1))
    return np.concatenate(copies)
