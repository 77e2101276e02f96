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
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from softehl.runtime.arrays import Array, Integers, frozen
from softehl.runtime.mesh import selection
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.checks import MeshError, check, place_text
from softehl.runtime.mesh.face_matching import match_faces, unrepeated_faces
from softehl.runtime.mesh.partitioning import MeshPartition
from softehl.runtime.mesh.selection import Faces, Predicate
from softehl.runtime.suggestions import did_you_mean, join_names, short_list

if TYPE_CHECKING:
    from softehl.runtime.mesh.point_location import Located, PointLocator

Shape = Literal[
    "quad",
    "serendipity",
    "triangle",
    "hex",
    "tetrahedron",
    "wedge",
    "lagrange_wedge",
    "pyramid",
]
__all__ = ["Faces", "Mesh", "MeshError", "Predicate", "Shape"]

_NEAR = 1e-9  # of the size of a mesh: places closer than that are the same


@dataclass(frozen=True, eq=False)
class Mesh:
    """Points and cells with named groups of cells and named sides; immutable.

    Parameters
    ----------
    points : array (n, dim)
        Coordinates of the nodes [mm].
    cells : mapping of str to array (m, k)
        Kind of cell -> node numbers, in the order of VTK.
    groups : mapping, optional
        Name -> kind -> numbers of the cells of that kind.
    sides : mapping, optional
        Name -> kind of face -> node numbers (m, k), in any orientation.
    numbers : array (n,), optional
        Nodes of the same number are copies of one node, at one place; see `split`.
    piece : optional
        Distribution of a mesh over the processes of mpirun; made by `spread=True`.

    Raises
    ------
    MeshError
        A kind of cell is unknown, or an array has a wrong shape or type.

    Notes
    -----
    Arrays are copied where others can write to them, and are read-only.
    """

    points: Array
    cells: Mapping[str, Integers]
    groups: Mapping[str, Mapping[str, Integers]] = field(default_factory=dict)
    sides: Mapping[str, Faces] = field(default_factory=dict)
    numbers: Integers | None = None
    piece: MeshPartition | None = None

    def __post_init__(self) -> None:
        """Raises MeshError for an unknown kind of cell or a wrong number of nodes."""
        if not isinstance(self.cells, Mapping):
            raise MeshError('cells are given by their kinds, {"quad4": nodes}')
        self._own_arrays()
        if self.points.ndim != 2 or self.points.dtype.kind not in "fiu":
            shape_text = f"{self.points.dtype} of shape {self.points.shape}"
            raise MeshError(f"points are {shape_text}, must be real numbers of shape (n, dim)")
        if not np.isfinite(self.points).all():
            raise MeshError("points must be finite, one is not a number or infinite")
        faces = [faces for side in self.sides.values() for faces in side.items()]
        for name, nodes in (*self.cells.items(), *faces):
            if name not in CELLS:
                raise MeshError(f"no cells {name!r}{did_you_mean(name, CELLS)}")
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
            numbers_text = f"{numbers.dtype} of shape {numbers.shape}"
            raise MeshError(
                f"numbers of nodes are {numbers_text}, must be integers of shape {shape}"
            )

    def _own_arrays(self) -> None:
        """Copies of all arrays that can be written to by others; read-only, as are the mappings."""
        groups = {name: _owned(group, f"group {name!r}: ") for name, group in self.groups.items()}
        sides = {name: _owned(side, f"side {name!r}: ") for name, side in self.sides.items()}
        arrays = {
            "points": _frozen("points", self.points),
            "cells": _owned(self.cells, ""),
            "groups": MappingProxyType(groups),
            "sides": MappingProxyType(sides),
        }
        if self.numbers is not None:
            arrays["numbers"] = _frozen("numbers of nodes", self.numbers)
        for name, value in arrays.items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        """Summary in one line."""
        kinds = join_names(f"{len(nodes)} {kind}" for kind, nodes in self.cells.items())
        return (
            f"<Mesh: {len(self.points)} points in {self.dimension}-D, {kinds}; groups: "
            f"{short_list(self.groups)}; sides: {short_list(self.sides)}>"
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
        """Return a line from 0 to `length`, with the sides "left" and "right".

        Parameters
        ----------
        length : float
            Length [mm].
        cells : int
            Number of cells.
        order : int
            Order of the cells, 1 to 6.
        spread : bool
            As in `box`.

        Returns
        -------
        Mesh
            Cells line2, line3, up to line7.

        Raises
        ------
        MeshError
            A number is not allowed.
        """
        from softehl.runtime.mesh.structured import grid

        return grid((length,), (cells,), order, "quad", spread=spread)

    @classmethod
    def rectangle(
        cls,
        *size: float | Sequence[float],
        cells: tuple[int, int],
        order: int = 1,
        shape: Shape = "quad",
        spread: bool = False,
    ) -> Mesh:
        """Return [0, a] x [0, b]; sides "left" and "right" (x), "bottom" and "top" (y).

        Parameters
        ----------
        *size : float
            Lengths a and b [mm], as two numbers or as one sequence.
        cells : tuple of int
            Number of cells along x and y.
        order : int
            Order of the cells, 1 to 6 of "quad", 1 and 2 of "triangle".
        shape : str
            "quad" (quad4, quad9, up to quad49), "serendipity" (quad8) or "triangle" (tri3, tri6).
        spread : bool
            As in `box`.

        Returns
        -------
        Mesh
            The mesh.

        Raises
        ------
        MeshError
            A number or shape is not allowed.
        """
        from softehl.runtime.mesh.structured import grid

        return grid(_lengths("rectangle", size, 2), cells, order, shape, spread=spread)

    @classmethod
    def box(
        cls,
        *size: float | Sequence[float],
        cells: tuple[int, int, int],
        order: int = 1,
        shape: Shape = "hex",
        spread: bool = False,
    ) -> Mesh:
        """Return [0, a] x [0, b] x [0, c] with six named sides.

        The sides are "left" and "right" (x), "front" and "back" (y), "bottom" and "top" (z).

        Parameters
        ----------
        *size : float
            Lengths a, b and c [mm], as three numbers or as one sequence.
        cells : tuple of int
            Number of cells along x, y and z.
        order : int
            Order of the cells, 1 to 6 of "hex", 1 and 2 of "tetrahedron" and "wedge", 2 of
            "serendipity" and "lagrange_wedge", 1 of "pyramid".
        shape : str
            "hex" (hex8, hex27, up to hex343), "serendipity" (hex20), "tetrahedron" (tet4, tet10),
            "wedge" (wedge6, wedge15), "lagrange_wedge" (wedge18) or "pyramid" (pyramid5).
        spread : bool
            Under mpirun every process makes its own part only (docs/cluster.md); one process makes
            the whole.

        Returns
        -------
        Mesh
            The mesh.

        Raises
        ------
        MeshError
            A number or shape is not allowed.
        """
        from softehl.runtime.mesh.structured import grid

        return grid(_lengths("box", size, 3), cells, order, shape, spread=spread)

    @classmethod
    def frame(
        cls,
        points: Sequence[Sequence[float]],
        members: Sequence[tuple[int, int]] | Mapping[str, Sequence[tuple[int, int]]] | None = None,
        *,
        cells: int = 1,
        order: int = 1,
    ) -> Mesh:
        """Return straight members between points in the plane or in space, for bars and beams.

        Parameters
        ----------
        points : sequence of points
            Ends of the members [mm]; a polyline if no members are given.
        members : sequence of pairs, or mapping of str to such, optional
            Numbers of the two points of every member, or group -> pairs.
        cells : int
            Number of cells of every member.
        order : int
            Order of the cells, 1 to 6.

        Returns
        -------
        Mesh
            Cells line2, line3, up to line7. The points are its first nodes.

        Raises
        ------
        MeshError
            A number or point is not allowed, a member has no length, or a point has no member.
        """
        from softehl.runtime.mesh.structured import frame

        return frame(points, members, cells, order)

    @classmethod
    def union(cls, **parts: Mesh) -> Mesh:
        """Return meshes as one mesh; they share no nodes.

        Parameters
        ----------
        **parts : Mesh
            Name -> mesh. The cells of `disc` are the group "disc", its sides "disc:bottom",
            "disc:boundary"; its groups are "disc:NAME".

        Returns
        -------
        Mesh
            All cells and nodes.

        Raises
        ------
        MeshError
            Dimensions differ, or a mesh is distributed over processes.
        """
        from softehl.runtime.mesh.union import union

        return union(parts)

    @classmethod
    def read(cls, path: str | Path, *, spread: bool = False) -> Mesh:
        """Read a file of Gmsh, of Abaqus or CalculiX (.inp), a universal file (.unv) or by meshio.

        Parameters
        ----------
        path : str or Path
            The file.
        spread : bool
            Each process reads its share of the files part_1.msh, part_2.msh, ... of "part.msh" (or
            .npz), as `gmsh -part_split` or `write(parts=...)` made them; there must be as many
            files as processes, or more.

        Returns
        -------
        Mesh
            Groups, sets and surfaces of the file are groups and sides; a set of nodes is a side of
            points. A warning names what has no such form.

        Raises
        ------
        MeshError
            The file cannot be read, or has unknown cells.
        """
        from softehl.runtime.mesh.readers.meshio import read
        from softehl.runtime.mesh.readers.partitioned_files import read_parts

        return read_parts(Path(path)) if spread else read(Path(path))

    def write(self, path: str | Path, *, parts: int | None = None) -> None:
        """Write the mesh in the format of the file name.

        Parameters
        ----------
        path : str or Path
            The file; .msh, .inp, .unv, .vtu, .vtk and .med keep the names of groups and sides,
            others warn.
        parts : int, optional
            Write so many files, part_1.npz, ... for "part.npz", each with cells that are close
            together, for `read(spread=True)`.

        Raises
        ------
        MeshError
            The file cannot be written.
        """
        from softehl.runtime.mesh.readers.meshio import write
        from softehl.runtime.mesh.readers.partitioned_files import write_parts

        if parts is None:
            write(self, Path(path))
        else:
            write_parts(self, Path(path), parts)

    def plot(
        self, *, groups: bool = False, edges: bool = True, file: str | Path | None = None
    ) -> None:
        """Show a picture of the mesh, or write it to a file.

        Parameters
        ----------
        groups : bool
            Colour the cells by their first group.
        edges : bool
            Draw the edges of the cells.
        file : str or Path, optional
            Picture to write, such as "mesh.png" or "mesh.svg"; left out, it is shown in a window,
            or in a notebook interactively.

        Raises
        ------
        PictureError
            The file has another ending, or there are no groups.
        MissingPyvista
            PyVista is not installed.
        """
        from softehl.runtime.mesh.plotting import plot_mesh

        plot_mesh(self, groups=groups, edges=edges, file=file)

    # another one from it ------------------------------------------------------------------------

    def map(self, move: Callable[[Array], Array]) -> Mesh:
        """Return the mesh with moved nodes.

        Parameters
        ----------
        move : callable
            Function of coordinates (n, dim) that gives the new ones (n, dim).

        Returns
        -------
        Mesh
            The same cells, groups and sides.

        Raises
        ------
        MeshError
            The coordinates have a wrong shape.
        """
        moved = _frozen("moved points", move(self.points))
        if moved.ndim != 2 or len(moved) != len(self.points):
            raise MeshError(f"map: shape {moved.shape} from {self.points.shape}")
        return replace(self, points=moved)

    def with_side(self, name: str, where: Predicate) -> Mesh:
        """Return the mesh with one more named side.

        Parameters
        ----------
        name : str
            Name of the side.
        where : callable
            Predicate of coordinates (n, dim) -> (n,): faces of the boundary all of whose nodes it
            selects.

        Returns
        -------
        Mesh
            The mesh with this side.

        Raises
        ------
        MeshError
            No face is selected.
        """
        return replace(self, sides={**self.sides, name: selection.faces_where(self, where, name)})

    def with_group(self, name: str, where: Predicate) -> Mesh:
        """Return the mesh with one more named group of cells.

        Parameters
        ----------
        name : str
            Name of the group.
        where : callable
            Predicate of coordinates (n, dim) -> (n,): cells whose centre it selects.

        Returns
        -------
        Mesh
            The mesh with this group.

        Raises
        ------
        MeshError
            No cell is selected.
        """
        group = selection.cells_where(self, where, name)
        return replace(self, groups={**self.groups, name: group})

    def split(self) -> Mesh:
        """Return the mesh with separate nodes for every cell, so that fields may jump.

        Returns
        -------
        Mesh
            The cells with copies of their nodes; `on="interior"` of `Study.add` selects the facets
            between them.
        """
        from softehl.runtime.mesh.interior_facets import split

        return split(self)

    # looking at it ------------------------------------------------------------------------------

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return int(self.points.shape[1])

    @property
    def origin(self) -> Integers:
        """Number of the original of each node, (n,), the same for all copies; see `split`."""
        return np.arange(len(self.points)) if self.numbers is None else self.numbers

    def anywhere(self, something: object) -> bool:
        """Return True if a value is true on any process that has a part of the mesh.

        Parameters
        ----------
        something : object
            Value of this process.

        Returns
        -------
        bool
            The same on all processes.
        """
        return bool(something) if self.piece is None else self.piece.anywhere(something)

    def own(self, nodes: Integers) -> Integers:
        """Return those nodes that this process owns; all of them, if the mesh is not distributed.

        Parameters
        ----------
        nodes : array of int
            Node numbers.

        Returns
        -------
        array of int
            The owned ones.
        """
        return nodes if self.piece is None else nodes[self.piece.owned[nodes]]

    def require_whole(self, context: str) -> None:
        """Require a mesh that is not distributed over processes.

        Parameters
        ----------
        context : str
            The call, for the message.

        Raises
        ------
        MeshError
            The mesh is distributed.
        """
        if self.piece is not None:
            raise MeshError(f"{context}: not for a mesh in parts; leave out spread=True")

    @cached_property
    def boundary(self) -> Faces:
        """Faces that belong to one cell only, kind -> node numbers (m, k), seen from outside."""
        by_kind: dict[str, list[Integers]] = {}
        for kind, nodes in self.cells.items():
            for face, local in CELLS[kind].side_nodes:
                by_kind.setdefault(face.name, []).append(nodes[:, list(local)])
        faces = {
            k: unrepeated_faces(np.concatenate(parts), CELLS[k].corners, self.numbers)
            for k, parts in by_kind.items()
        }
        if self.piece is not None:
            cuts = self.piece.cuts
            faces = {k: f[match_faces(f, cuts[k], CELLS[k].corners) < 0] for k, f in faces.items()}
        return _owned(faces, "")

    def faces(self, where: str | Predicate) -> Faces:
        """Return the faces of a side.

        Parameters
        ----------
        where : str or callable
            Name of a side, "boundary", or a predicate of coordinates for faces of the boundary all
            of whose nodes it selects.

        Returns
        -------
        mapping of str to array (m, k)
            Kind of face -> node numbers. Faces of the boundary are oriented as seen from outside,
            others as they were given.

        Raises
        ------
        MeshError
            There is no such side.
        """
        return selection.faces(self, where)

    def outer_faces(self, where: str | Predicate) -> Faces:
        """Return the faces of a side of the boundary, which have an outside.

        Parameters
        ----------
        where : str or callable
            As in `faces`.

        Returns
        -------
        mapping of str to array (m, k)
            As of `faces`; of shells as they were given.

        Raises
        ------
        MeshError
            A face has another dimension than the boundary, or belongs to two cells or none.
        """
        return selection.outer_faces(self, where)

    def nodes(self, where: str | Predicate) -> Integers:
        """Return the nodes of a side or group, sorted.

        Parameters
        ----------
        where : str or callable
            Name of a side or group, or a predicate of coordinates (n, dim) -> (n,).

        Returns
        -------
        array of int
            Node numbers.

        Raises
        ------
        MeshError
            There is no such side or group, or no node is selected.
        """
        return selection.nodes(self, where)

    def cells_of(self, group: str | None) -> Mapping[str, Integers]:
        """Return the cells of a group.

        Parameters
        ----------
        group : str or None
            Name of the group; None for all cells.

        Returns
        -------
        mapping of str to array (m, k)
            Kind -> node numbers; kinds without cells are left out.

        Raises
        ------
        MeshError
            There is no such group.
        """
        return selection.cells_of(self, group)

    def node_at(self, place: Array) -> int:
        """Return the number of the node at a place.

        Parameters
        ----------
        place : tuple of float or array (dim,)
            Its coordinates.

        Returns
        -------
        int
            Node number.

        Raises
        ------
        MeshError
            There is no node, with the nearest one in the message; or there are several.
        """
        return selection.node_at(self, place)

    def nodes_at(self, place: Array) -> Integers:
        """Return the node at a place with all copies that `split` made of it.

        Parameters
        ----------
        place : tuple of float or array (dim,)
            Its coordinates.

        Returns
        -------
        array of int
            Node numbers; of a distributed mesh those on this process.

        Raises
        ------
        MeshError
            There is no node on any process, or there are nodes of several bodies.
        """
        return selection.nodes_at(self, place)

    def locate(self, place: Array) -> tuple[Integers, Array]:
        """Return the nodes of the cell that contains a place, and their shape functions there.

        Parameters
        ----------
        place : tuple of float or array (dim,)
            Coordinates.

        Returns
        -------
        nodes : array of int (k,)
            Nodes of the cell.
        weights : array (k,)
            Values of their shape functions.

        Raises
        ------
        MeshError
            The place lies outside the mesh.
        """
        located = self.holding(selection.checked_place(self, place)[None])
        if not len(located.point):
            raise MeshError(f"{place_text(np.asarray(place))} lies outside the mesh")
        cell = CELLS[located.kinds[located.kind[0]]]
        weights = cell.shape(located.parent[:1, : cell.dimension])[0]
        return self.cells[cell.name][located.row[0]], weights

    def holding(self, places: Array, group: str | None = None) -> Located:
        """Return the cells that contain places.

        Parameters
        ----------
        places : array (n, dim)
            Coordinates.
        group : str, optional
            Group of cells in which to look.

        Returns
        -------
        Located
            Pairs of place and cell, with coordinates in the reference cell.

        Raises
        ------
        MeshError
            There is no such group, or places have a wrong shape.
        """
        points = np.asarray(places, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != self.dimension or not np.isfinite(points).all():
            points = np.stack([selection.checked_place(self, point) for point in points])
        if group is None:
            return self._locator.holding(points)
        self.cells_of(group)
        masks = {kind: np.zeros(len(nodes), np.bool_) for kind, nodes in self.cells.items()}
        for kind, rows in self.groups[group].items():
            masks[kind][rows] = True
        return self._locator.holding(points, masks)

    @cached_property
    def tolerance(self) -> float:
        """Distance up to which places are the same [mm]."""
        return _NEAR * float(np.ptp(self.points, axis=0).max())

    @cached_property
    def _locator(self) -> PointLocator:
        from softehl.runtime.mesh.point_location import PointLocator

        return PointLocator(self.points, self.cells, self.tolerance)

    def check(self) -> None:
        """Check that no cell is inverted, and that no cell or face of a side occurs twice.

        Raises
        ------
        MeshError
            With number and place of the cell.
        """
        check(self)


def _lengths(name: str, size: Sequence[Any], dimension: int) -> tuple[float, ...]:
    """Lengths of a rectangle or box that are given as numbers or as one sequence."""
    lengths = size[0] if len(size) == 1 else size
    try:
        sizes = tuple(map(float, lengths))
    except (TypeError, ValueError):
        sizes = ()
    if len(sizes) != dimension:
        text = ", ".join(map(repr, size))
        example = ", ".join(("10", "1", "1")[:dimension])
        raise MeshError(f"{name}({text}): {dimension} lengths are needed, as in {name}({example})")
    return sizes


def _frozen(name: str, array: Any) -> NDArray[Any]:
    """An array of numbers that nobody can write to.  Raises MeshError."""
    if isinstance(array, np.ma.MaskedArray):
        raise MeshError(f"{name} are a masked array, whose mask says nothing here: fill it first")
    return frozen(np.asarray(array))


def _owned(arrays: Mapping[str, Any], context: str) -> Mapping[str, Any]:
    """Arrays by kind, none of which anybody can write to.  Raises MeshError."""
    return MappingProxyType({k: _frozen(f"{context}{k}", n) for k, n in arrays.items()})
