"""A boundary-value problem on a mesh: pages on cells and sides, loads, supports, a path, results.

    study = Study(Mesh.rectangle(48, 44, cells=(16, 16)))
    study.add("body", "solid.py", mu=0.4, kappa=0.9)
    study.load("right", u_y=0.0625)
    study.fix("left", u_x=0, u_y=0)
    result = study.solve(steps=10)
    result.at((48, 60))["u_y"]

Unknowns have the names that the pages give them; equal names on equal nodes are one unknown.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from softehl.runtime.arrays import Integers
from softehl.runtime.definition import argument_checks as read
from softehl.runtime.definition.block_options import elements_on, form_of
from softehl.runtime.definition.contact_sides import touch
from softehl.runtime.definition.element_blocks import (
    On,
    beside_of,
    elements_of,
    geometry_of,
    kinds_of,
    page_on,
    wants_traces,
)
from softehl.runtime.definition.kernel_loading import Origin, Source
from softehl.runtime.definition.line_fields import require_apart
from softehl.runtime.definition.problem_definition import (
    Condition,
    Datum,
    Force,
    Start,
    Statement,
    StudyError,
    Where,
    shown,
)
from softehl.runtime.discretisation.loads import Amount, DeadLoad, NodalForce, Pressure, Spring, Tie
from softehl.runtime.fit.fitted import Fitted
from softehl.runtime.kernels.kernel import Kernel
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.mesh import Mesh, MeshError, Predicate
from softehl.runtime.paths import Paths
from softehl.runtime.suggestions import few, listed


@dataclass(eq=False)
class Study(Paths, Fitted):
    """Boundary-value problem on a mesh: pages, loads, supports; `solve` and others solve it.

    Parameters
    ----------
    mesh : Mesh
        Mesh of the problem, without inverted cells.
    geometry : str, optional
        Geometry of a mesh in 2-D for pages of fields: "plane strain" (the default) or
        "axisymmetric", around the x axis. In the latter, loads and pressures act on whole rings.

    Raises
    ------
    MeshError
        A cell is inverted.
    StudyError
        The mesh does not allow the geometry.
    """

    mesh: Mesh
    geometry: str | None = None
    _statement: Statement = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Raises MeshError for a cell that is turned inside out, StudyError for a geometry."""
        self.mesh.check()
        geometry_of(self.mesh, self.geometry)
        self._statement = Statement(self.mesh, self._ring)

    def __setattr__(self, name: str, value: object) -> None:
        """Raises AttributeError for what a study is of."""
        if name in ("mesh", "geometry") and name in vars(self):
            raise AttributeError(
                f"{name} of a study cannot be changed: make another one, Study(mesh, geometry)"
            )
        super().__setattr__(name, value)

    def __repr__(self) -> str:
        """Summary in one line."""
        written = self._statement
        blocks = few(f"{b.name} ({b.kernel.name})" for b in written.blocks.values())
        calls = Counter(["fix"] * len(written.conditions) + [f.what for f in written.forces])
        calls.update(start=len(written.start), contact=len(written.contacts))
        told = ", ".join(f"{count} {name}" for name, count in calls.items() if count) or "no loads"
        kinds = ", ".join(f"{len(nodes)} {kind}" for kind, nodes in self.mesh.cells.items())
        return f"<Study: {kinds}; blocks: {blocks}; {told}>"

    def __copy__(self) -> Study:
        """A study with the same statements so far, on the same mesh."""
        other = object.__new__(type(self))
        vars(other).update({**vars(self), "_statement": self._statement.copied()})
        return other

    def __deepcopy__(self, memo: object) -> Study:
        """As a copy: what was written down does not change."""
        return self.__copy__()

    # the problem --------------------------------------------------------------------------------

    def add(
        self,
        name: str,
        source: Source = None,
        *,
        material: Source = None,
        on: On | Sequence[Sequence[int]] = None,
        cells: str | None = None,
        model: str | None = None,
        shared: Sequence[str] = (),
        called: Mapping[str, str] | None = None,
        along: Mapping[str, int | Integers] | None = None,
        rule: object = None,
        constant: bool = False,
        **given: Any,
    ) -> None:
        """Add elements of a page to all cells, to a group of cells, or to a side.

        Parameters
        ----------
        name : str
            Name of the block of elements. A page of fields on several kinds of cells makes a block
            for each, "body:quad4", "body:tri3".
        source : str, Path, Definition, Page or Kernel, optional
            The page: a file or function, a folder that `softehl generate` wrote, a Definition, a
            kernel, or the name of a kernel that ships. A page of fields takes any kind of cell.
        material : str, Path or Law, optional
            Instead of `source`: a stress law, for a body of it. A file, a function, or the name of
            a law that ships, such as "neo_hooke".
        on : str, callable or array (n, k), optional
            A side; a page of one node has an element at each of its nodes. "interior" are the
            facets between cells. An array gives the elements themselves by their node numbers.
        cells : str, optional
            Group of cells. All cells if left out.
        model : str, optional
            Name of the model, if the source has several.
        shared : sequence of str
            Unknowns without a node that all elements share; else each element has its own.
        called : mapping of str to str, optional
            Name of an unknown on the page -> its name in the study.
        along : mapping of str to int or array (n, m), optional
            Fields that the page interpolates along its lines -> order of their polynomials, with
            nodal unknowns at both ends of a line; or numbers of their unknowns, from 0, which
            blocks share.
        rule : QuadratureRule, optional
            Quadrature in place of the page's own, as in `softehl.quadrature.gauss(4, 1)`.
        constant : bool
            True if the tangent does not depend on unknowns: it is evaluated once.
        **given : float, array or callable
            Parameters of the page: numbers, or functions f(t) of the load factor. Data of the page:
            a number, numbers (n,) of the elements, or a function of the elements' centres (n, dim).
            `Model.nodal_data` by their declared name: one number for each node of the mesh, or a
            function of the nodes' coordinates. Two are set by `march` and not given: `dt`, the
            length of a step, and the parameters of `Model.rates`.

        Raises
        ------
        StudyError
            An argument does not fit the page or the study.
        MeshError
            The mesh has no such side or group.
        ModelError
            The page is wrong.
        """
        blocks = self._statement.blocks
        if name in blocks:
            raise StudyError(f"block {name!r} is there already; blocks: {listed(blocks)}")
        if (source is None) == (material is None):
            raise StudyError(f"{name!r}: give a page or material=..., one of them")
        law = material is not None
        origin = Origin(
            material if law else source, model, geometry_of(self.mesh, self.geometry), law
        )
        form = form_of(name, shared, called, along, rule, constant)
        on = elements_on(name, on)
        kernels = self._kernels(origin, on, cells)
        for kernel in kernels:
            label = name if len(kernels) == 1 else f"{name}:{kernel.cell}"
            elements = elements_of(self.mesh, label, kernel, on, cells)
            block = page_on(self.mesh, label, kernel, elements, form, given)
            require_apart(block, blocks.values())
            blocks[label] = replace(block, differentiated=origin.differentiated(kernel))

    def load(self, where: Where, **components: Amount) -> None:
        """Add a dead load on a side, per reference length or area, or forces at nodes.

        Parameters
        ----------
        where : str, callable, tuple of float or array of int
            A side, or a predicate of coordinates (n, dim) for the faces of the boundary all of
            whose nodes it selects. Coordinates of one node, or node numbers, for forces.
        **components : float or callable
            Unknown -> load in its direction [MPa on a side, N at a node]. A number is multiplied by
            the load factor (in `march` it is constant); a function f(x, t) of coordinates (n, dim)
            gives the load (n,) itself.

        Raises
        ------
        StudyError
            A value is not a finite number or function.
        MeshError
            The mesh has no such side or node.

        Notes
        -----
        On straight sides of cells of order p, polynomials of degree p + 2 are integrated exactly. A
        body force is a page.
        """
        words = f"load({shown(where)})"
        read.named(words, components, "u_x=1")
        for name, given in components.items():
            value = read.amount(words, name, given)
            if isinstance(where, str) or callable(where):
                for kind, faces in self.mesh.faces(where).items():
                    kernel = DeadLoad(CELLS[kind], value, self._ring)
                    self._add_force("load", where, kernel, faces, (name,))
            else:
                nodes = self.mesh.own(read.nodes_of(self.mesh, where))
                self._add_force("load", where, NodalForce(value), nodes[:, None], (name,))

    def pressure(
        self, where: str | Predicate, value: Amount, *, of: Sequence[str] | None = None
    ) -> None:
        """Add a follower pressure: it acts on the deformed side, inwards.

        Parameters
        ----------
        where : str or callable
            A side, or a predicate of coordinates for faces of the boundary.
        value : float or callable
            Force per deformed length or area [MPa]. A number is multiplied by the load factor (in
            `march` it is constant); a function f(x, t) gives the pressure (n,) at reference
            coordinates (n, dim).
        of : sequence of str, optional
            Unknowns that are the displacements along x, y, z; u_x, u_y, u_z if left out.

        Raises
        ------
        StudyError
            The displacements do not match the dimension of the mesh.
        MeshError
            A face belongs to two cells or to none: it has no outside.
        """
        value = read.amount(f"pressure({shown(where)})", "pressure", value)
        axes = "xyz"[: self.mesh.dimension]
        names = tuple(f"u_{axis}" for axis in axes) if of is None else tuple(of)
        if len(names) != self.mesh.dimension or len(names) == 1:
            raise StudyError(
                f"pressure({shown(where)}, of={list(names)}): a displacement for each of "
                f"{self.mesh.dimension} coordinates is needed, in 2-D or 3-D"
            )
        for kind, faces in self.mesh.outer_faces(where).items():
            kernel = Pressure(CELLS[kind], value, self._ring)
            self._add_force("pressure", where, kernel, faces, names)

    def spring(self, where: Where, **stiffness: float) -> None:
        """Add a spring to the ground at each node of a side.

        Parameters
        ----------
        where : str, callable, tuple of float or array of int
            A side, a group, a predicate of coordinates, node numbers, or coordinates of one node.
        **stiffness : float
            Unknown -> stiffness of the spring of each node [N/mm].

        Raises
        ------
        StudyError
            A stiffness is not finite.
        MeshError
            The mesh has no such side or node.
        """
        read.named(f"spring({shown(where)})", stiffness, "u_x=2")
        for name, value in stiffness.items():
            kernel = Spring(read.finite(name, value))
            nodes = self.mesh.own(read.nodes_of(self.mesh, where))
            self._add_force("spring", where, kernel, nodes[:, None], (name,))

    def fix(self, where: Where, **values: Amount) -> None:
        """Prescribe unknowns at nodes.

        Parameters
        ----------
        where : str, callable, tuple of float or array of int
            A side, a group, a predicate of coordinates, node numbers, or coordinates of one node.
        **values : float or callable
            Unknown -> its value. A number is multiplied by the load factor (in `march` it is
            constant); a function f(x, t) of coordinates (n, dim) gives the value (n,) itself.

        Raises
        ------
        StudyError
            A value is not a finite number or function.
        MeshError
            The mesh has no such side or node.
        """
        words = f"fix({shown(where)})"
        read.named(words, values, "u_x=0")
        for name, given in values.items():
            value = read.amount(words, name, given)
            condition = Condition(where, read.nodes_of(self.mesh, where), name, value)
            self._statement.conditions.append(condition)

    def tie(
        self, where: Where, to: Where, *names: str, offset: Amount = 0.0, tolerance: float = 1e-6
    ) -> None:
        """Tie unknowns of one side to those of another, u(where) = u(to) + offset: periodicity.

        Parameters
        ----------
        where : str, callable, tuple of float or array of int
            The side that is tied.
        to : str, callable, tuple of float or array of int
            The side with the same nodes but for a shift; or one place, to which all nodes of
            `where` are tied, so that they move as one.
        *names : str
            The unknowns.
        offset : float or callable
            Difference of the values; as a value of `fix`.
        tolerance : float
            Largest distance of partner nodes after the shift, relative to the size of the sides.

        Raises
        ------
        StudyError
            The sides have different nodes.
        MeshError
            The mesh has no such side, or is distributed over processes.

        Notes
        -----
        Nodes at one place that belong to bodies without a connection are tied body by body.
        """
        words = f"tie({shown(where)}, {shown(to)})"
        self.mesh.require_whole(words)
        read.named(words, names, f'tie({shown(where)}, {shown(to)}, "u_x", "u_y")')
        offset = read.amount(words, "offset", offset)
        ours, theirs = read.nodes_of(self.mesh, where), read.nodes_of(self.mesh, to)
        if len(theirs) == 1 < len(ours):
            if offset == 0.0:
                ours = ours[ours != theirs[0]]  # a node of the side itself
            if theirs[0] in ours:
                raise StudyError(f"{words}: the place is a node of the side: offset must be 0")
            partners = np.repeat(theirs, len(ours))
        elif len(ours) != len(theirs):
            raise StudyError(
                f"{words}: {len(ours)} and {len(theirs)} nodes; sides of equal nodes but for a "
                "shift are tied, or a side to one place"
            )
        else:
            partners = read.node_partners(self.mesh, ours, theirs, tolerance)
        for name in names:
            pairs = np.stack([ours, partners], axis=1)
            self._add_force("tie", where, Tie(offset), pairs, (name,))

    def contact(
        self,
        side: str | Predicate,
        other: str | Predicate | None = None,
        *,
        friction: float = 0.0,
        name: str = "contact",
        of: Sequence[str] | None = None,
        stiffness: float | None = None,
        depth: float | None = None,
    ) -> None:
        """Add contact with finite sliding between two sides, or of one side with itself.

        Parameters
        ----------
        side : str or callable
            Side with the contact pressure as an unknown: the finer or the softer one.
            `Result.fields(name)` has its pressure and shear stress.
        other : str or callable, optional
            The other side; left out, `side` is in contact with itself.
        friction : float
            Coulomb's coefficient of friction.
        name : str
            Name of the block.
        of : sequence of str, optional
            Displacements along x, y, z; u_x, u_y, u_z if left out.
        stiffness : float, optional
            Of the augmented Lagrangian [MPa/mm]. It changes the iterations, not the result; derived
            from the bodies if left out.
        depth : float, optional
            Penetration above which sides are not in contact [mm]; half of the body's thickness if
            left out.

        Raises
        ------
        StudyError
            The name exists, or an argument is not allowed.
        MeshError
            The mesh has no such side.
        """
        if name in self._statement.blocks:
            known = listed(self._statement.blocks)
            raise StudyError(f"contact(name={name!r}): the name is taken; blocks: {known}")
        given = {"friction": friction, "stiffness": stiffness, "depth": depth}
        found, blocks = touch(self.mesh, name, (side, other), of, self._ring, given)
        self._statement.blocks.update(blocks)
        self._statement.contacts.append(found)

    def start(self, where: Where | None = None, **values: Datum) -> None:
        """Set initial values of unknowns; they are zero if left out.

        Parameters
        ----------
        where : str, callable, tuple of float or array of int, optional
            Nodes, as in `fix`; all nodes if left out.
        **values : float or callable
            Unknown -> number, or function of coordinates (n, dim) that gives (n,). Of two values
            for one node the later one counts.

        Raises
        ------
        StudyError
            A value is not finite, or has a wrong shape.
        MeshError
            The mesh has no such side or node.
        """
        read.named("start()", values, "T=20")
        everywhere = np.arange(len(self.mesh.points))
        nodes = everywhere if where is None else read.nodes_of(self.mesh, where)
        for name, value in values.items():
            found = read.datum("start", name, value, self.mesh.points[nodes])
            self._statement.start.append(Start(name, nodes, found))

    @property
    def _ring(self) -> bool:
        """True if sides are those of rings."""
        return self.geometry == "axisymmetric"

    def _kernels(self, origin: Origin, on: On, cells: str | None) -> list[Kernel]:
        """Kernels of a page on the kinds of cells or faces that are meant."""
        kinds = kinds_of(self.mesh, on, cells)
        try:
            kernels = [origin.loaded(kinds[0] if kinds else None)]
        except ValueError as error:
            if on is None or isinstance(on, np.ndarray) or not wants_traces(error):
                raise
            kinds = beside_of(self.mesh, on)
            kernels = [origin.loaded(kinds[0])]
        if kernels[0].cell and not isinstance(origin.source, Kernel):
            kernels += [origin.loaded(kind) for kind in kinds[1:]]
        return kernels

    def _add_force(
        self,
        what: str,
        where: Where,
        kernel: DeadLoad | NodalForce | Pressure | Spring | Tie,
        nodes: Integers,
        names: tuple[str, ...],
    ) -> None:
        forces = self._statement.forces
        label = f"{what} {len(forces) + 1}: {what}({shown(where)}, {', '.join(names)})"
        place = where if isinstance(where, str) else shown(where)
        forces.append(Force(label, kernel, nodes, names, what, place))


__all__ = ["MeshError", "Source", "Study", "StudyError"]
