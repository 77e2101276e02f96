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

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.fem.assembly import Assembler, ElementBlock
from softehl.runtime.fem.loads import Amount, DeadLoad, NodalForce, Spring, Tie, amount
from softehl.runtime.fem.problem import Problem
from softehl.runtime.fem.unknowns import Elements, Numbering, Slot, slots
from softehl.runtime.kernels import Kernel
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.mesh import Mesh, MeshError, Predicate, meant
from softehl.runtime.result import Result
from softehl.runtime.solve.backends import choose
from softehl.runtime.solve.continuation import Continuation
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import NotConverged, Point
from softehl.runtime.solve.steps import StepRule

Where: TypeAlias = "str | Predicate | Integers | Sequence[float]"
"""A side or group by name, a predicate of places (n, dim), node numbers, or one place (a tuple)."""
Source: TypeAlias = "str | Path | Kernel | object"
"""A model file, a folder of generated C, the name of a shipped kernel, a kernel, a Definition."""
Number: TypeAlias = float | Callable[[float], float]
"""A parameter: a number, or a function of the load factor."""
Datum: TypeAlias = float | Array | Callable[[Array], Array]
"""Data of elements: one number, (n,) numbers, or a function of their centres (n, dim)."""

_SMALLEST = 1e-6  # of the whole load: where a path is given up


class StudyError(ValueError):
    """What was asked of a study cannot be; the message says what was given and what is allowed."""


@dataclass(frozen=True, eq=False)
class _Block:
    """Elements of one page: the kernel, their nodes (n, k), data, parameters."""

    name: str
    kernel: Kernel
    nodes: Integers
    slots: tuple[Slot, ...]
    shared: frozenset[str]
    data: Array | None
    parameters: Mapping[str, Number]
    kind: str


@dataclass(frozen=True, eq=False)
class _Condition:
    """Prescribed values of an unknown at nodes."""

    where: Where
    nodes: Integers
    name: str
    value: Amount

    @property
    def words(self) -> str:
        """What was asked for, for messages."""
        return f"fix({_shown(self.where)}, {self.name}=...)"


@dataclass(frozen=True, eq=False)
class _Force:
    """A load, a spring or a tie: elements of a kernel of ours on unknowns of one name."""

    label: str
    kernel: DeadLoad | NodalForce | Spring | Tie
    nodes: Integers
    name: str


@dataclass(frozen=True, eq=False)
class System:
    """A study as equations: numbering and assembler, which all load factors share."""

    mesh: Mesh
    numbering: Numbering
    assembler: Assembler
    blocks: Mapping[str, _Block]
    conditions: tuple[_Condition, ...]
    """Prescribed values, as they were written down."""
    implied: tuple[_Force, ...] = ()
    """Ties both sides of which are prescribed: checked, not solved."""

    def problem(self, t: float) -> Problem:
        """The equations at a load factor.  Raises StudyError where prescribed values differ."""
        fixed, values = self._prescribed(t)
        for tie in self.implied:
            self._require_tied(tie, t, dict(zip(fixed.tolist(), values.tolist(), strict=True)))
        parameters = {}
        for block in self.assembler.blocks:
            page = self.blocks.get(block.name)
            given = page.parameters if page else dict.fromkeys(block.kernel.parameters, t)
            numbers = [given[name] for name in block.kernel.parameters]
            parameters[block.name] = np.array([v(t) if callable(v) else v for v in numbers])
        layout = self.numbering.layout
        scales = dict.fromkeys(layout.names, 1.0)
        return Problem(self.assembler, layout, parameters, scales, fixed, values)

    def _require_tied(self, tie: _Force, t: float, values: Mapping[int, float]) -> None:
        """Raise StudyError where values that are prescribed on both sides break a tie."""
        assert isinstance(tie.kernel, Tie)
        offsets = amount(tie.kernel.offset, self.mesh.points[tie.nodes[:, 0]], t)
        numbers = self.numbering.nodal[tie.name][tie.nodes]
        for (a, b), offset, node in zip(numbers, offsets, tie.nodes[:, 0], strict=True):
            apart = values[int(a)] - values[int(b)] - float(offset)
            if abs(apart) > 1e-12 * max(abs(values[int(a)]), abs(values[int(b)])):
                raise StudyError(
                    f"{tie.label}: at node {node} {_place(self.mesh.points[node])} both sides are "
                    f"prescribed, and {apart:g} apart"
                )

    def _prescribed(self, t: float) -> tuple[Integers, Array]:
        """Unknowns and values, each once; one that is given two values is refused."""
        known: dict[int, tuple[float, _Condition]] = {}
        for condition in self.conditions:
            places = self.mesh.points[condition.nodes]
            numbers = self.numbering.nodal[condition.name][condition.nodes]
            for node, number, value in zip(
                condition.nodes.tolist(),
                numbers.tolist(),
                amount(condition.value, places, t).tolist(),
                strict=True,
            ):
                if number < 0:
                    continue
                before, by = known.setdefault(number, (value, condition))
                if before != value:
                    raise StudyError(
                        f"{condition.name} at node {node} {_place(self.mesh.points[node])} is "
                        f"prescribed twice: {before:g} by {by.words}, {value:g} by "
                        f"{condition.words}"
                    )
        found = np.array(sorted(known), dtype=np.int64)
        return found, np.array([known[n][0] for n in found.tolist()])


@dataclass(eq=False)
class Study:
    """A boundary-value problem that is being written down; `solve` solves what is there.

    mesh: on which it lives; a cell that is turned inside out is a MeshError.
    """

    mesh: Mesh
    _blocks: dict[str, _Block] = field(default_factory=dict, repr=False)
    _conditions: list[_Condition] = field(default_factory=list, repr=False)
    _forces: list[_Force] = field(default_factory=list, repr=False)

    def __post_init__(self) -> None:
        """Raises MeshError for a cell that is turned inside out."""
        self.mesh.check()

    # the problem --------------------------------------------------------------------------------

    def add(
        self,
        name: str,
        source: Source,
        *,
        on: str | Predicate | None = None,
        cells: str | None = None,
        model: str | None = None,
        shared: Sequence[str] = (),
        **given: Any,
    ) -> None:
        """Elements of a page on all cells, on a group of cells, or `on` a side.

        source: a page (file), a folder that `softehl generate` wrote, a Definition, a kernel, or
        the name of one that ships. model: which, where the page has several. shared: unknowns
        without a node that are one for all elements, not one for each. given: parameters of the
        page (numbers, or functions of the load factor) and its data (a number, (n,) numbers or a
        function of the elements' centres (n, dim)). On a side, a page of one node has an element
        at each node. Raises StudyError, MeshError, or what is wrong with the page.
        """
        if name in self._blocks:
            raise StudyError(
                f"block {name!r} is there already; blocks: {self._names(self._blocks)}"
            )
        kernel = source if isinstance(source, Kernel) else _load(source, model)
        kind, nodes = self._elements(name, kernel, on, cells)
        if kernel.interpolated is not None:
            raise StudyError(
                f"{kernel.name} interpolates {kernel.interpolated}: a study has unknowns at nodes "
                "and cells only; assemble it by softehl.ElementBlock"
            )
        if kernel.coordinates and len(kernel.coordinates) != self.mesh.dimension:
            raise StudyError(
                f"{kernel.name} has {len(kernel.coordinates)} coordinates a node "
                f"({', '.join(kernel.coordinates)}), the mesh has {self.mesh.dimension}"
            )
        found = slots(kernel.unknowns, kernel.nodes)
        self._known("unknown", shared, [s.name for s in found if s.node is None], kernel.name)
        self._known("argument", given, [*kernel.parameters, *kernel.data], kernel.name)
        missing = [p for p in (*kernel.parameters, *kernel.data) if p not in given]
        if missing:
            raise StudyError(f"{name!r}: {kernel.name} needs {', '.join(missing)}")
        for parameter in kernel.parameters:
            _number(name, parameter, given[parameter])
        centres = self.mesh.points[nodes].mean(axis=1)
        columns = [_datum(name, d, given[d], centres) for d in kernel.data]
        self._blocks[name] = _Block(
            name=name,
            kernel=kernel,
            nodes=nodes,
            slots=found,
            shared=frozenset(shared),
            data=np.stack(columns, axis=1) if columns else None,
            parameters={p: given[p] for p in kernel.parameters},
            kind=kind,
        )

    def load(self, where: Where, **components: Amount) -> None:
        """Dead loads per reference length or area of a side, or forces at a place or nodes.

        A number grows with the load factor; a function f(x (n, dim), t) gives the load itself.
        where: a side or a predicate of faces; a tuple of coordinates or node numbers for forces.
        """
        for name, value in components.items():
            if isinstance(where, str) or callable(where):
                for kind, faces in self.mesh.faces(where).items():
                    self._add_force("load", where, DeadLoad(CELLS[kind], value), faces, name)
            else:
                nodes = self._nodes(where)
                self._add_force("load", where, NodalForce(value), nodes[:, None], name)

    def spring(self, where: Where, **stiffness: float) -> None:
        """Springs to the ground at the nodes of a side, each of this stiffness."""
        for name, value in stiffness.items():
            nodes = self._nodes(where)
            self._add_force("spring", where, Spring(_finite(name, value)), nodes[:, None], name)

    def fix(self, where: Where, **values: Amount) -> None:
        """Prescribe unknowns: a number grows with the load factor, f(x (n, dim), t) is the value.

        where: a side, a group, a predicate of places, node numbers, or one place.
        """
        if not values:
            raise StudyError(f"fix({_shown(where)}): name what is prescribed, as in u_x=0")
        for name, value in values.items():
            if not callable(value):
                _finite(name, value)
            self._conditions.append(_Condition(where, self._nodes(where), name, value))

    def tie(
        self, where: Where, to: Where, *names: str, offset: Amount = 0.0, tolerance: float = 1e-6
    ) -> None:
        """Tie unknowns of one side to those of another, u(where) = u(to) + offset: periodicity.

        The sides must have the same nodes but for a shift; `tolerance` is relative to their size.
        """
        ours, theirs = self._nodes(where), self._nodes(to)
        if len(ours) != len(theirs):
            raise StudyError(
                f"tie({_shown(where)}, {_shown(to)}): {len(ours)} and {len(theirs)} nodes"
            )
        partners = theirs[_partners(self.mesh.points[ours], self.mesh.points[theirs], tolerance)]
        for name in names:
            pairs = np.stack([ours, partners], axis=1)
            self._add_force("tie", where, Tie(offset), pairs, name)

    # solving it ---------------------------------------------------------------------------------

    def solve(
        self,
        *,
        steps: int = 1,
        until: float = 1.0,
        start: Result | None = None,
        newton: Newton | None = None,
        smallest: float = _SMALLEST,
        on_step: Callable[[Result], object] | None = None,
    ) -> Result:
        """The solution at load factor `until`, from 0 (or from `start`) in `steps` steps.

        Steps are cut where Newton's method fails and grow again. on_step is given the result of
        every converged step. Raises StudyError; NotConverged if the end is not reached, whose
        `result` has the path so far, and whose `reached` is the last Result.
        """
        if not (isinstance(steps, int) and steps > 0):
            raise StudyError(f"steps = {steps}: a number of at least 1 is needed")
        system = self.system()
        x0 = np.zeros(system.numbering.layout.total) if start is None else start.x
        if len(x0) != system.numbering.layout.total:
            raise StudyError("start: the result of another study, with other unknowns")
        begin = 0.0 if start is None else start.t
        first = abs(until - begin) / steps
        rule = StepRule(first, min(smallest, first), first)
        reached: list[Result] = []

        def keep(point: Point) -> None:
            reached[:] = [Result(system, system.problem(point.parameter), point)]
            if on_step is not None:
                on_step(reached[0])

        corrector = newton or Newton(linear=choose("auto"))
        path = Continuation(corrector, rule, name="load factor")
        branch = path.follow(system.problem, begin, until, x0, on_point=keep)
        if not branch.converged:
            error = NotConverged(branch)
            error.reached = reached[0] if reached else None  # type: ignore[attr-defined]
            raise error
        return reached[0]

    def system(self) -> System:
        """What is written down, as equations.  Raises StudyError for what does not fit together."""
        if not self._blocks:
            raise StudyError("there are no elements: add a page, study.add('body', 'solid.py')")
        elements = [Elements(b.name, b.nodes, b.slots, b.shared) for b in self._blocks.values()]
        numbering = Numbering.of(len(self.mesh.points), elements)
        for condition in self._conditions:
            self._require(condition.name, condition.nodes, numbering, condition.words, every=False)
        ties, forces, implied = {}, [], []
        for force in self._forces:
            self._require(force.name, force.nodes, numbering, force.label, every=True)
            if isinstance(force.kernel, Tie):
                # where both sides are prescribed nothing is left for a multiplier to do
                both = np.isin(force.nodes, self._prescribed(force.name)).all(axis=1)
                implied.append(replace(force, nodes=force.nodes[both]))
                force = replace(force, nodes=force.nodes[~both])
                ties[force.label] = len(force.nodes)
            forces.append(force)
        layout = replace(
            numbering.layout,
            names=(*numbering.layout.names, *ties),
            counts=(*numbering.layout.counts, *ties.values()),
        )
        numbering = replace(numbering, layout=layout)
        blocks = [self._page_block(b, numbering) for b in self._blocks.values()]
        blocks += [self._force_block(f, numbering) for f in forces if len(f.nodes)]
        assembler = Assembler.build(layout.total, blocks)
        pages, conditions = dict(self._blocks), (*self._conditions,)
        return System(self.mesh, numbering, assembler, pages, conditions, (*implied,))

    # inside -------------------------------------------------------------------------------------

    def _elements(
        self, name: str, kernel: Kernel, on: str | Predicate | None, cells: str | None
    ) -> tuple[str, Integers]:
        """Kind and nodes (n, k) of the elements of a kernel."""
        if on is not None and cells is not None:
            raise StudyError(f"{name!r}: give cells=... or on=..., not both")
        if on is not None and kernel.nodes == 1:
            return "point1", self.mesh.nodes(on)[:, None]
        there = self.mesh.faces(on) if on is not None else self.mesh.cells_of(cells)
        fit = {kind: nodes for kind, nodes in there.items() if nodes.shape[1] == kernel.nodes}
        if len(fit) != 1 or (cells is None and len(there) > 1):
            kinds = ", ".join(f"{len(nodes)} {kind}" for kind, nodes in there.items())
            place = "the mesh" if on is None and cells is None else repr(cells or on)
            raise StudyError(
                f"{name!r}: {kernel.name} has {kernel.nodes} nodes, {place} has {kinds}"
                + ("; name groups of cells of one kind" if len(there) > 1 else "")
            )
        return next(iter(fit.items()))

    def _prescribed(self, name: str) -> Integers:
        """Nodes at which an unknown is prescribed."""
        parts = [c.nodes for c in self._conditions if c.name == name]
        return np.concatenate([np.empty(0, dtype=np.int64), *parts])

    def _nodes(self, where: Where) -> Integers:
        """Node numbers that are meant."""
        if isinstance(where, str) or callable(where):
            return self.mesh.nodes(where)
        given = np.asarray(where)
        if isinstance(where, tuple) or given.dtype.kind == "f":
            return np.array([self.mesh.node_at(given)])
        if given.dtype.kind not in "iu" or given.ndim != 1 or not given.size:
            raise StudyError(f"{_shown(where)}: node numbers are a list of integers")
        if given.min() < 0 or given.max() >= len(self.mesh.points):
            raise StudyError(f"node numbers go from 0 to {len(self.mesh.points) - 1}")
        return given.astype(np.int64)

    def _add_force(
        self,
        what: str,
        where: Where,
        kernel: DeadLoad | NodalForce | Spring | Tie,
        nodes: Integers,
        name: str,
    ) -> None:
        label = f"{what} {len(self._forces) + 1}: {what}({_shown(where)}, {name})"
        self._forces.append(_Force(label, kernel, nodes, name))

    def _require(
        self, name: str, nodes: Integers, numbering: Numbering, words: str, *, every: bool
    ) -> None:
        """Raise StudyError unless the nodes have an unknown of this name."""
        if name not in numbering.nodal:
            known = self._names(numbering.nodal)
            raise StudyError(
                f"{words}: no unknown {name!r}{meant(name, numbering.nodal)}; at nodes: {known}"
            )
        there = numbering.nodal[name][nodes] >= 0
        if not (there.all() if every else there.any()):
            raise StudyError(f"{words}: no page has the unknown {name!r} there")

    def _page_block(self, block: _Block, numbering: Numbering) -> ElementBlock:
        n = len(block.nodes)
        width = len(block.kernel.coordinates)
        places = self.mesh.points[block.nodes].reshape(n, -1) if width else np.empty((n, 0))
        dofs = numbering.dofs[block.name]
        return ElementBlock(block.name, block.kernel, places, dofs, data=block.data)

    def _force_block(self, force: _Force, numbering: Numbering) -> ElementBlock:
        dofs = numbering.nodal[force.name][force.nodes]
        places = self.mesh.points[force.nodes].reshape(len(dofs), -1)
        if isinstance(force.kernel, Tie):
            places = self.mesh.points[force.nodes[:, 0]]
            dofs = np.column_stack([dofs, numbering.layout.dofs(force.label)])
        constant = isinstance(force.kernel, Spring | Tie)
        return ElementBlock(
            force.label, force.kernel, places, np.ascontiguousarray(dofs), constant=constant
        )

    def _known(self, what: str, given: Iterable[str], known: Iterable[str], of: str) -> None:
        allowed = list(known)
        for name in given:
            if name not in allowed:
                raise StudyError(
                    f"{of} has no {what} {name!r}{meant(name, allowed)}; it has "
                    f"{self._names(allowed)}"
                )

    @staticmethod
    def _names(names: Iterable[str]) -> str:
        return ", ".join(names) or "none"


def _load(source: Source, model: str | None) -> Kernel:
    """By the front door, which knows when the generator is needed: this room does not."""
    import softehl

    return softehl.load_kernel(source, model)  # type: ignore[arg-type]


def _number(block: str, name: str, value: object) -> None:
    if callable(value):
        return
    if not isinstance(value, int | float | np.number) or not np.isfinite(value):
        raise StudyError(f"{block!r}: {name} = {value!r}, must be a number or a function of t")


def _finite(name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        raise StudyError(f"{name} = {value!r}: a number is needed, or a function")
    if not np.isfinite(value):
        raise StudyError(f"{name} = {value!r}: the number must be finite")
    return float(value)


def _datum(block: str, name: str, value: Datum, centres: Array) -> Array:
    found = np.asarray(value(centres) if callable(value) else value, dtype=np.float64)
    if found.shape not in ((), (len(centres),)) or not np.isfinite(found).all():
        raise StudyError(
            f"{block!r}: {name} has shape {found.shape}, must be one finite number or "
            f"({len(centres)},) of them"
        )
    return np.broadcast_to(found, (len(centres),)).copy()


def _partners(ours: Array, theirs: Array, tolerance: float) -> Integers:
    """For each of our places the number of the one of theirs that has the same place but for the
    shift between both centres.  Raises StudyError where there is none.
    """
    a, b = ours - ours.mean(axis=0), theirs - theirs.mean(axis=0)
    distance = np.linalg.norm(a[:, None] - b[None], axis=2)
    chosen = distance.argmin(axis=1)
    size = max(float(np.ptp(ours, axis=0).max()), float(np.abs(ours - theirs).max()))
    worst = float(distance.min(axis=1).max())
    if worst > tolerance * size or len(set(chosen.tolist())) < len(chosen):
        raise StudyError(f"tie: the nodes of both sides do not fit, they are {worst:.3g} apart")
    return np.asarray(chosen, dtype=np.int64)


def _shown(where: object) -> str:
    if callable(where):
        return getattr(where, "__name__", "predicate")
    return repr(where) if isinstance(where, str | tuple) else "nodes"


def _place(x: Array) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in x) + ")"


__all__ = ["MeshError", "Study", "StudyError", "System"]
