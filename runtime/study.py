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
from softehl.runtime.fem.loads import Amount, DeadLoad, NodalForce, Pressure, Spring, Tie
from softehl.runtime.fit.fitted import Fitted
from softehl.runtime.kernels import Kernel
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.mesh import Mesh, MeshError, Predicate
from softehl.runtime.names import few, listed
from softehl.runtime.paths import Paths
from softehl.runtime.statement import given as read
from softehl.runtime.statement.along import require_apart
from softehl.runtime.statement.contacts import touch
from softehl.runtime.statement.forms import elements_on, form_of
from softehl.runtime.statement.pages import (
    On,
    beside_of,
    elements_of,
    geometry_of,
    kinds_of,
    page_on,
    wants_traces,
)
from softehl.runtime.statement.records import (
    Condition,
    Datum,
    Force,
    Start,
    Statement,
    StudyError,
    Where,
    shown,
)
from softehl.runtime.statement.sources import Origin, Source


@dataclass(eq=False)
class Study(Paths, Fitted):
    """A boundary-value problem that is being written down; `solve` solves what is there.

    mesh: on which it lives; a cell that is turned inside out is a MeshError. geometry: what a page
    of fields knows of dimensions that the mesh does not have: in 2-D "plane strain" (the default)
    or "axisymmetric", around the x axis: then loads and pressures of sides act on whole rings.
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
        """Elements of a page on all cells, on a group of cells, or `on` a side.

        source: a page (file or function), a folder that `softehl generate` wrote, a Definition, a
        kernel, or the name of one that ships; a page of fields stands on any kind of cell.
        material: instead, a stress law for a body of it: a file, a function, or the name of one
        that ships ("neo_hooke"). model: which, where there are several. on: a side, on which a page
        of one node has an element at each node; or the elements themselves, an array (n, k) of node
        numbers. shared: unknowns without a node that are one for all elements, not one for each.
        called: name of an unknown on the page -> its name in the study. along: fields that the page
        interpolates along its lines -> order of their polynomials, which have nodal unknowns at
        both ends of a line; or places (n, m) of their unknowns, counted from 0, which blocks share.
        rule: of quadrature, instead of the page's own, as in `softehl.quadrature.gauss(4, 1)`.
        constant: the tangent does not depend on unknowns; it is evaluated once.
        given: parameters of the page (numbers, or functions of the load factor) and its data (a
        number, (n,) numbers or a function of the elements' centres (n, dim); `Model.nodal_data` by
        their name, one for each node of the mesh or a function of places). A page of fields on
        several kinds of cells makes a block of each, "body:quad4", "body:tri3". Two are not given:
        `dt` is the length of a step of `march`, `rate` comes from `Model.rates`.
        Raises StudyError, MeshError, or what is wrong with the page.
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
        """Dead loads per reference length or area of a side, or forces at a place or nodes.

        A number grows with the load factor (in `march` it is constant); a function
        f(x (n, dim), t) gives the load itself; of cells of order p polynomials of degree p + 2 are
        integrated exactly on straight sides.
        where: a side, or a predicate of places, for the faces of the boundary all of whose nodes it
        chooses; a tuple of coordinates or node numbers for forces. A body force is a page.
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
        """A pressure on a side, which follows the body: it acts on the deformed side, inwards.

        value: force per deformed length or area; a number grows with the load factor (in `march`
        it is constant), a function f(x (n, dim), t) gives the pressure at undeformed places.
        of: unknowns that are the displacements along x, y, z; left out, u_x, u_y, u_z. A face
        of two cells or of none has no outside and is refused.
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
        """Springs to the ground at the nodes of a side, each of this stiffness."""
        read.named(f"spring({shown(where)})", stiffness, "u_x=2")
        for name, value in stiffness.items():
            kernel = Spring(read.finite(name, value))
            nodes = self.mesh.own(read.nodes_of(self.mesh, where))
            self._add_force("spring", where, kernel, nodes[:, None], (name,))

    def fix(self, where: Where, **values: Amount) -> None:
        """Prescribe unknowns: a number grows with the load factor (in `march` it is constant).

        A function f(x (n, dim), t) gives the value itself.

        where: a side, a group, a predicate of places, node numbers, or one place.
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

        The sides must have the same nodes but for a shift; `tolerance` is relative to their size.
        Nodes at one place, of bodies that are not connected, are tied body by body.
        Or `to` is one place, at which all nodes of the side are tied: they move as one.
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
        """Contact of two sides of deformable bodies, which may slide far; of one side with itself
        where there is no other.

        side: which has the pressure as an unknown, the finer or the softer one; `fields(name)` has
        its pressure and shear stress. friction: Coulomb's coefficient. of: displacements, u_x and
        u_y if left out. stiffness: of the augmented Lagrangian [MPa/mm], which changes iterations,
        not results; left out, that of the bodies. depth: penetration beyond which sides do not
        notice each other; left out, half of the thickness of the body.
        Raises StudyError, MeshError.
        """
        if name in self._statement.blocks:
            known = listed(self._statement.blocks)
            raise StudyError(f"contact(name={name!r}): the name is taken; blocks: {known}")
        given = {"friction": friction, "stiffness": stiffness, "depth": depth}
        found, blocks = touch(self.mesh, name, (side, other), of, self._ring, given)
        self._statement.blocks.update(blocks)
        self._statement.contacts.append(found)

    def start(self, where: Where | None = None, **values: Datum) -> None:
        """Values of unknowns at the start, numbers or functions of places; zero if left out.

        Of two values for one node the later one counts.
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
