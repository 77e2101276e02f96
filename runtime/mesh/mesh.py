"""Meshes: points, cells by kind, named groups of cells, named sides.

    mesh = Mesh.rectangle(48, 44, cells=(16, 16))      # sides "left" "right" "bottom" "top"
    mesh = mesh.map(lambda x: x * [1, 1.5])            # moved nodes
    mesh = mesh.with_side("loaded", lambda x: x[:, 0] > 40)

Node orders are those of VTK and meshio, as in `runtime.mesh.cells`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from softehl.errors import SoftehlError
from softehl.runtime.arrays import Array, Flags, Integers, frozen
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.faces import as_known, matched, once
from softehl.runtime.mesh.piece import Piece
from softehl.runtime.names import few, listed, meant, misfit

if TYPE_CHECKING:
    from softehl.runtime.mesh.point_location import Located, PointLocator

Faces: TypeAlias = Mapping[str, Integers]
"""Kind of face -> node numbers (n, k), seen from outside counterclockwise."""
Shape = Literal["quad", "serendipity", "triangle", "hex", "tetrahedron", "wedge"]
Predicate = Callable[[Array], Flags]
"""Of places (n, dim): which of them are meant, (n,)."""


_NEAR = 1e-9  # of the size of a mesh: places closer than that are the same


class MeshError(SoftehlError, ValueError):
    """A mesh, or a name in it, cannot be used; the message says what is there."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Points and cells, with names.

    points: (n, dim) places of the nodes. cells: kind -> node numbers (m, k). groups: name -> kind
    -> numbers of cells of that kind. sides: name -> faces, in any order of their nodes; `faces`
    gives them from outside counterclockwise. numbers: (n,) nodes with the same number are at one
    place of which every cell has its own copy; None: there are no copies. piece: of a mesh that is
    in parts under mpirun, of which this is that of this process; None: it is the whole.
    All arrays are copied where others can write to them, and are read-only.
    """

    points: Array
    cells: Mapping[str, Integers]
    groups: Mapping[str, Mapping[str, Integers]] = field(default_factory=dict)
    sides: Mapping[str, Faces] = field(default_factory=dict)
    numbers: Integers | None = None
    piece: Piece | None = None

    def __post_init__(self) -> None:
        """Raises MeshError for an unknown kind of cell or a wrong number of nodes."""
        if not isinstance(self.cells, Mapping):
            raise MeshError('cells are given by their kinds, {"quad4": nodes}')
        self._own_arrays()
        if self.points.ndim != 2 or self.points.dtype.kind not in "fiu":
            given = f"{self.points.dtype} of shape {self.points.shape}"
            raise MeshError(f"points are {given}, must be real numbers of shape (n, dim)")
        if not np.isfinite(self.points).all():
            raise MeshError("points must be finite, one is not a number or infinite")
        faces = [faces for side in self.sides.values() for faces in side.items()]
        for name, nodes in (*self.cells.items(), *faces):
            if name not in CELLS:
                raise MeshError(f"no cells {name!r}{meant(name, CELLS)}")
            count = len(CELLS[name].nodes)
            if nodes.ndim != 2 or nodes.shape[1] != count:
                raise MeshError(f"{name} has nodes of shape {nodes.shape}, must be (m, {count})")
            if nodes.size and nodes.dtype.kind not in "iu":
                raise MeshError(f"{name} has nodes of {nodes.dtype}, must be integers")
            if nodes.size and not 0 <= nodes.min() <= nodes.max() < len(self.points):
                raise MeshError(
                    f"{name}: node numbers from {nodes.min()} to {nodes.max()}, must be from 0 to "
                    f"{len(self.points) - 1}"
                )
        numbers, shape = self.numbers, self.points.shape[:1]
        if numbers is not None and (numbers.dtype.kind not in "iu" or numbers.shape != shape):
            wrong = f"{numbers.dtype} of shape {numbers.shape}"
            raise MeshError(f"numbers of nodes are {wrong}, must be integers of shape {shape}")

    def _own_arrays(self) -> None:
        """Copies of all arrays that can be written to by others; read-only, as are the mappings."""
        groups = {name: _owned(group, f"group {name!r}: ") for name, group in self.groups.items()}
        sides = {name: _owned(side, f"side {name!r}: ") for name, side in self.sides.items()}
        own = {
            "points": _frozen("points", self.points),
            "cells": _owned(self.cells, ""),
            "groups": MappingProxyType(groups),
            "sides": MappingProxyType(sides),
        }
        if self.numbers is not None:
            own["numbers"] = _frozen("numbers of nodes", self.numbers)
        for name, value in own.items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        """Summary in one line."""
        kinds = listed(f"{len(nodes)} {kind}" for kind, nodes in self.cells.items())
        return (
            f"<Mesh: {len(self.points)} points in {self.dimension}-D, {kinds}; groups: "
            f"{few(self.groups)}; sides: {few(self.sides)}>"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """For `pickle`."""
        self.require_whole("pickle")
        groups, sides = ({n: dict(v) for n, v in m.items()} for m in (self.groups, self.sides))
        return Mesh, (self.points, dict(self.cells), groups, sides, self.numbers)

    def __copy__(self) -> Mesh:
        """Itself, as nothing of it changes."""
        return self

    def __deepcopy__(self, memo: object) -> Mesh:
        """Itself, as nothing of it changes."""
        return self

    # making one ---------------------------------------------------------------------------------

    @classmethod
    def line(cls, length: float, *, cells: int, order: int = 1, spread: bool = False) -> Mesh:
        """A line from 0 to `length`; sides "left" and "right". spread: see `box`."""
        from softehl.runtime.mesh.structured import grid

        return grid((length,), (cells,), order, "quad", spread=spread)

    @classmethod
    def rectangle(
        cls,
        width: float,
        height: float,
        *,
        cells: tuple[int, int],
        order: int = 1,
        shape: Shape = "quad",
        spread: bool = False,
    ) -> Mesh:
        """[0, width] x [0, height]; sides "left" "right" (x), "bottom" "top" (y).

        shape: "quad" (quad4, quad9, up to quad49 of order 6), "serendipity" (quad8) or
        "triangle" (tri3, tri6). spread: see `box`.
        """
        from softehl.runtime.mesh.structured import grid

        return grid((width, height), cells, order, shape, spread=spread)

    @classmethod
    def box(
        cls,
        size: Sequence[float],
        *,
        cells: tuple[int, int, int],
        order: int = 1,
        shape: Shape = "hex",
        spread: bool = False,
    ) -> Mesh:
        """[0, a] x [0, b] x [0, c]; "left" "right" (x), "front" "back" (y), "bottom" "top" (z).

        shape: "hex" (hex8, hex27, up to hex343 of order 6), "serendipity" (hex20), "tetrahedron"
        (tet4, tet10) or "wedge" (wedge6). spread: under mpirun every process makes its own part
        only (docs/cluster.md); of one process that is the whole.
        """
        from softehl.runtime.mesh.structured import grid

        return grid(tuple(size), cells, order, shape, spread=spread)

    @classmethod
    def union(cls, **parts: Mesh) -> Mesh:
        """Meshes as one that share no nodes: cells "disc", sides "disc:bottom", "disc:boundary".

        Groups of cells keep their names behind that of their mesh, too.
        """
        from softehl.runtime.mesh.union import union

        return union(parts)

    @classmethod
    def read(cls, path: str | Path, *, spread: bool = False) -> Mesh:
        """A mesh file of Gmsh, of Abaqus or CalculiX (.inp), or of a format that meshio reads.

        Its groups, sets and surfaces become names of cells and of sides; a set of nodes is a side
        of points. What cannot be a name or a cell is told in a warning.
        spread: of "part.msh" or "part.npz" each process reads its share of the files part_1.msh,
        part_2.msh, ..., as `gmsh -part_split` or `write(parts=...)` made them; there must be as
        many as processes, or more.
        Raises MeshError where the file cannot be read or holds other cells than ours.
        """
        from softehl.runtime.mesh.files import read
        from softehl.runtime.mesh.part_files import read_parts

        return read_parts(Path(path)) if spread else read(Path(path))

    def write(self, path: str | Path, *, parts: int | None = None) -> None:
        """Write the mesh in the format of the file name; .msh, .inp, .vtu and .vtk keep the names.

        parts: into so many files of NumPy, part_1.npz, ... for "part.npz", each of which holds
        cells that are close together, for `read(spread=True)`. Raises MeshError.
        """
        from softehl.runtime.mesh.files import write
        from softehl.runtime.mesh.part_files import write_parts

        if parts is None:
            write(self, Path(path))
        else:
            write_parts(self, Path(path), parts)

    # another one from it ------------------------------------------------------------------------

    def map(self, move: Callable[[Array], Array]) -> Mesh:
        """The mesh with nodes at `move(points)`, (n, dim) -> (n, dim)."""
        moved = _frozen("moved points", move(self.points))
        if moved.ndim != 2 or len(moved) != len(self.points):
            raise MeshError(f"map: shape {moved.shape} from {self.points.shape}")
        return replace(self, points=moved)

    def with_side(self, name: str, where: Predicate) -> Mesh:
        """The mesh with one more named side: faces of the boundary all of whose nodes are meant."""
        return replace(self, sides={**self.sides, name: self._meant_faces(where, name)})

    def with_group(self, name: str, where: Predicate) -> Mesh:
        """The mesh with one more named group: the cells whose centre is meant."""
        chosen = {}
        for kind, nodes in self.cells.items():
            inside = _told(where, self.points[nodes].mean(axis=1), name)
            chosen[kind] = np.flatnonzero(inside)
        if not self.anywhere(any(map(len, chosen.values()))):
            raise MeshError(f"group {name!r}: the predicate chooses no cell")
        return replace(self, groups={**self.groups, name: chosen})

    def split(self) -> Mesh:
        """The mesh with nodes of its own for every cell, so that fields may jump between them.

        on="interior" of `Study.add` finds the facets at which they meet.
        """
        from softehl.runtime.mesh.facets import split

        return split(self)

    # looking at it ------------------------------------------------------------------------------

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return int(self.points.shape[1])

    @property
    def origin(self) -> Integers:
        """(n,) the same number for all copies of a node; see `split`."""
        return np.arange(len(self.points)) if self.numbers is None else self.numbers

    def anywhere(self, something: object) -> bool:
        """True if there is something, of a mesh in parts on any process."""
        return bool(something) if self.piece is None else self.piece.anywhere(something)

    def own(self, nodes: Integers) -> Integers:
        """Nodes of these that are this process's own; all, where the mesh is whole."""
        return nodes if self.piece is None else nodes[self.piece.owned[nodes]]

    def require_whole(self, words: str) -> None:
        """Raise MeshError where the mesh is in parts."""
        if self.piece is not None:
            raise MeshError(f"{words}: not for a mesh in parts; leave out spread=True")

    @cached_property
    def boundary(self) -> Faces:
        """Every face that belongs to one cell only."""
        found: dict[str, list[Integers]] = {}
        for kind, nodes in self.cells.items():
            for face, local in CELLS[kind].side_nodes:
                found.setdefault(face.name, []).append(nodes[:, list(local)])
        faces = {
            k: once(np.concatenate(parts), CELLS[k].corners, self.numbers)
            for k, parts in found.items()
        }
        if self.piece is not None:
            cuts = self.piece.cuts
            faces = {k: f[matched(f, cuts[k], CELLS[k].corners) < 0] for k, f in faces.items()}
        return _owned(faces, "")

    def faces(self, where: str | Predicate) -> Faces:
        """Faces of a named side, or those of the boundary all of whose nodes are meant.

        Those of the boundary have their nodes as seen from outside, others as they were given.
        """
        if callable(where):
            return self._meant_faces(where, "the predicate")
        if where == "boundary" and where not in self.sides:
            return self.boundary
        if where not in self.sides:
            known = ", ".join([*self.sides, "boundary"])
            raise MeshError(f"no side {where!r}{meant(where, self.sides)}; there are {known}")
        return {
            kind: as_known(faces, self.boundary[kind], CELLS[kind].corners)
            if kind in self.boundary
            else faces
            for kind, faces in self.sides[where].items()
        }

    def outer_faces(self, where: str | Predicate) -> Faces:
        """Faces of one dimension less than the mesh.  Raises MeshError for a face that is not
        that of one cell alone, which has no outside; those of shells are as they were given.
        """
        found = self.faces(where)
        solid = any(CELLS[kind].dimension == self.dimension for kind in self.cells)
        for kind, faces in found.items():
            cell, known = CELLS[kind], self.boundary.get(kind, faces[:0])
            if cell.dimension != self.dimension - 1:
                name = "the predicate" if callable(where) else f"side {where!r}"
                what = {0: "nodes", 1: "lines", 2: "faces"}.get(cell.dimension, "cells")
                wanted = {1: "nodes", 2: "lines"}.get(self.dimension, "faces")
                raise MeshError(
                    f"{name} is of {what} ({kind}); in {self.dimension}-D a side of {wanted} of "
                    f"the boundary is needed, such as {few(self._outer_sides())}"
                )
            lost = faces[matched(faces, known, cell.corners) < 0] if solid else faces[:0]
            if len(lost):
                place = place_text(self.points[lost[0]].mean(axis=0))
                raise MeshError(
                    f"the face at {place} is of two cells or of none: it has no outside"
                )
        return found

    def _outer_sides(self) -> list[str]:
        """Names of sides of faces of one dimension less than the mesh."""
        names = [n for n, f in self.sides.items() if self._are_faces(f)]
        return [*names, "boundary"]

    def _are_faces(self, faces: Faces) -> bool:
        return all(CELLS[kind].dimension == self.dimension - 1 for kind in faces)

    def nodes(self, where: str | Predicate) -> Integers:
        """Numbers of the nodes of a side or group, or of those that are meant; sorted."""
        if callable(where):
            chosen = np.flatnonzero(_told(where, self.points, "the predicate"))
            if not self.anywhere(len(chosen)):
                raise MeshError("the predicate chooses no node")
            return chosen
        if where in self.groups and where not in self.sides:
            parts = [self.cells[kind][chosen] for kind, chosen in self.groups[where].items()]
        else:
            parts = list(self.faces(where).values())
        found = np.unique(np.concatenate([part.ravel() for part in parts]))
        return found if self.piece is None else self.piece.everywhere(found)

    def cells_of(self, group: str | None) -> Mapping[str, Integers]:
        """Kind -> node numbers (m, k) of the cells of a group, of all cells for None.

        A kind of which the group has no cells is left out.
        """
        if group is None:
            return self.cells
        if group not in self.groups:
            known = ", ".join(self.groups) or "none"
            raise MeshError(f"no group {group!r}{meant(group, self.groups)}; there are {known}")
        return {
            kind: self.cells[kind][chosen]
            for kind, chosen in self.groups[group].items()
            if self.anywhere(len(chosen))
        }

    def node_at(self, place: Array) -> int:
        """Number of the node at a place (dim,).  Raises MeshError that names the nearest one, or
        those that are all there.
        """
        place = self._placed(place)
        distance = np.linalg.norm(self.points - place, axis=1)
        nearest = int(distance.argmin())
        if distance[nearest] > _NEAR * self._size:
            raise MeshError(
                f"no node at {place_text(place)}; the nearest is number {nearest} at "
                f"{place_text(self.points[nearest])}"
            )
        self._require_one(np.flatnonzero(distance <= _NEAR * self._size), place)
        return nearest

    def nodes_at(self, place: Array) -> Integers:
        """The node at a place (dim,), with all copies that `split` made of it; of a mesh in parts
        none where it is on another process.  Raises MeshError.
        """
        place = self._placed(place)
        near = np.linalg.norm(self.points - place, axis=1) <= _NEAR * self._size
        found = np.flatnonzero(near)
        if self.piece is not None:
            found = self.piece.everywhere(found)
            if not self.anywhere(len(found)):
                raise MeshError(f"no node at {place_text(place)}, in any part of the mesh")
        elif self.numbers is None or not len(found):
            return np.array([self.node_at(place)])
        if len(np.unique(self.origin[found])) > 1:
            self._require_one(found, place)
        return found

    def _require_one(self, nodes: Integers, place: Array) -> None:
        if len(nodes) > 1:
            raise MeshError(
                f"{len(nodes)} nodes are at {place_text(place)}: name one by its number, "
                f"{listed(map(str, nodes))}, or a side of one body"
            )

    def locate(self, place: Array) -> tuple[Integers, Array]:
        """The nodes (k,) of the cell that holds a place (dim,), and their shape functions there.

        Raises MeshError if the place lies outside the mesh.
        """
        found = self.holding(self._placed(place)[None])
        if not len(found.point):
            raise MeshError(f"{place_text(np.asarray(place))} lies outside the mesh")
        cell = CELLS[found.kinds[found.kind[0]]]
        weights = cell.shape(found.parent[:1, : cell.dimension])[0]
        return self.cells[cell.name][found.row[0]], weights

    def holding(self, places: Array, group: str | None = None) -> Located:
        """The cells that hold places (n, dim); of a group, of a mesh in parts of this process.

        Raises MeshError.
        """
        places = np.asarray(places, dtype=np.float64)
        if places.ndim != 2 or places.shape[1] != self.dimension or not np.isfinite(places).all():
            places = np.stack([self._placed(place) for place in places])
        if group is None:
            return self._locator.holding(places)
        self.cells_of(group)
        chosen = {kind: np.zeros(len(nodes), np.bool_) for kind, nodes in self.cells.items()}
        for kind, rows in self.groups[group].items():
            chosen[kind][rows] = True
        return self._locator.holding(places, chosen)

    @cached_property
    def _locator(self) -> PointLocator:
        from softehl.runtime.mesh.point_location import PointLocator

        return PointLocator(self.points, self.cells, _NEAR * self._size)

    @cached_property
    def _size(self) -> float:
        return float(np.ptp(self.points, axis=0).max())

    def _placed(self, given: Array) -> Array:
        """A place as an array, which may be given as a tuple.  Raises MeshError."""
        if isinstance(given, np.ma.MaskedArray) or np.asarray(given).dtype == np.bool_:
            raise MeshError(f"a place has {self.dimension} numbers, given {given!r}")
        place = np.asarray(given, dtype=np.float64)
        if place.shape != (self.dimension,) or not np.isfinite(place).all():
            raise MeshError(f"a place has {self.dimension} coordinates, given {place.tolist()}")
        return place

    def check(self) -> None:
        """Raise MeshError for a cell that is turned inside out: its number and place.

        Also for a cell, or a face of a side, that stands twice: it would count twice.
        """
        from softehl.runtime.mesh.checks import check

        check(self)

    def _meant_faces(self, where: Predicate, name: str) -> Faces:
        inside = _told(where, self.points, name)
        found = {kind: faces[inside[faces].all(axis=1)] for kind, faces in self.boundary.items()}
        there = {kind: faces for kind, faces in found.items() if self.anywhere(len(faces))}
        if not there:
            raise MeshError(f"side {name!r}: no face of the boundary has all its nodes there")
        return there


def _frozen(name: str, given: Any) -> NDArray[Any]:
    """An array of numbers that nobody can write to.  Raises MeshError."""
    if isinstance(given, np.ma.MaskedArray):
        raise MeshError(f"{name} are a masked array, whose mask says nothing here: fill it first")
    return frozen(np.asarray(given))


def _owned(arrays: Mapping[str, Any], words: str) -> Mapping[str, Any]:
    """Arrays by kind, none of which anybody can write to.  Raises MeshError."""
    return MappingProxyType({k: _frozen(f"{words}{k}", n) for k, n in arrays.items()})


def _told(where: Predicate, places: Array, name: str) -> Flags:
    wrong = misfit(where, "x")
    if wrong:
        raise MeshError(f"{name}: {wrong}, x of shape (n, dim)")
    chosen = np.asarray(where(places))
    if chosen.shape != (len(places),) or chosen.dtype != np.bool_:
        raise MeshError(
            f"{name}: a predicate takes places of shape {places.shape} and gives booleans of shape "
            f"({len(places)},); this one gave {chosen.dtype} of shape {chosen.shape}"
        )
    return chosen


def place_text(x: Array) -> str:
    """Coordinates, for messages."""
    return "(" + ", ".join(f"{value:.4g}" for value in x) + ")"
