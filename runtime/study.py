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

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.fem.assembly import Assembler, ElementBlock
from softehl.runtime.fem.loads import Amount, DeadLoad, NodalForce, Spring, Tie
from softehl.runtime.fem.problem import Problem
from softehl.runtime.fem.unknowns import Elements, Numbering, Slot, slots
from softehl.runtime.follow import LoadPath, follow
from softehl.runtime.kernels import Kernel
from softehl.runtime.march import Clock, March, Method
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.mesh import Mesh, MeshError, Predicate
from softehl.runtime.names import meant
from softehl.runtime.result import Result
from softehl.runtime.solve.backends import choose
from softehl.runtime.solve.continuation import Continuation
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Branch, NotConverged, Point
from softehl.runtime.solve.steps import StepRule
from softehl.runtime.system import (
    AUTOMATIC,
    Block,
    Condition,
    Force,
    StudyError,
    System,
    Where,
    shown,
)

Source: TypeAlias = "str | Path | Kernel | object"
"""A model file, a folder of generated C, the name of a shipped kernel, a kernel, a Definition."""
Datum: TypeAlias = float | Array | Callable[[Array], Array]
"""Data of elements: one number, (n,) numbers, or a function of their centres (n, dim)."""

_SMALLEST = 1e-6  # of the whole load or time: where a path is given up


@dataclass(eq=False)
class Study:
    """A boundary-value problem that is being written down; `solve` solves what is there.

    mesh: on which it lives; a cell that is turned inside out is a MeshError.
    """

    mesh: Mesh
    _blocks: dict[str, Block] = field(default_factory=dict, repr=False)
    _conditions: list[Condition] = field(default_factory=list, repr=False)
    _forces: list[Force] = field(default_factory=list, repr=False)
    _start: dict[str, tuple[Where, Datum]] = field(default_factory=dict, repr=False)

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
        found = slots(kernel)
        self._known("unknown", shared, [s.name for s in found if s.node is None], kernel.name)
        previous, rates = _automatic(kernel, found)
        arguments = [*kernel.parameters, *kernel.data, *kernel.point_data]
        self._known("argument", given, arguments, kernel.name)
        needed = [p for p in kernel.parameters if p not in AUTOMATIC]
        needed += [d for d in kernel.data if d not in previous and d not in rates]
        missing = [a for a in needed if a not in given]
        if missing:
            raise StudyError(f"{name!r}: {kernel.name} needs {', '.join(missing)}")
        for parameter in kernel.parameters:
            _number(name, parameter, given.get(parameter, 0.0))
        centres = self.mesh.points[nodes].mean(axis=1)
        data = {d: _datum(name, d, given[d], centres) for d in kernel.data if d in given}
        self._blocks[name] = Block(
            name=name,
            kernel=kernel,
            nodes=nodes,
            kind=kind,
            slots=found,
            shared=frozenset(shared),
            data=data,
            previous={d: s for d, s in previous.items() if d not in data},
            rates={d: s for d, s in rates.items() if d not in data},
            initial=_initial(name, kernel, given, centres),
            parameters={p: given[p] for p in kernel.parameters if p in given},
        )

    def load(self, where: Where, **components: Amount) -> None:
        """Dead loads per reference length or area of a side, or forces at a place or nodes.

        A number grows with the load factor (in `march` it is constant); a function
        f(x (n, dim), t) gives the load itself.
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
        """Prescribe unknowns: a number grows with the load factor (in `march` it is constant).

        A function f(x (n, dim), t) gives the value itself.

        where: a side, a group, a predicate of places, node numbers, or one place.
        """
        if not values:
            raise StudyError(f"fix({shown(where)}): name what is prescribed, as in u_x=0")
        for name, value in values.items():
            if not callable(value):
                _finite(name, value)
            self._conditions.append(Condition(where, self._nodes(where), name, value))

    def tie(
        self, where: Where, to: Where, *names: str, offset: Amount = 0.0, tolerance: float = 1e-6
    ) -> None:
        """Tie unknowns of one side to those of another, u(where) = u(to) + offset: periodicity.

        The sides must have the same nodes but for a shift; `tolerance` is relative to their size.
        """
        ours, theirs = self._nodes(where), self._nodes(to)
        if len(ours) != len(theirs):
            raise StudyError(
                f"tie({shown(where)}, {shown(to)}): {len(ours)} and {len(theirs)} nodes"
            )
        partners = theirs[_partners(self.mesh.points[ours], self.mesh.points[theirs], tolerance)]
        for name in names:
            pairs = np.stack([ours, partners], axis=1)
            self._add_force("tie", where, Tie(offset), pairs, name)

    def start(self, where: Where | None = None, **values: Datum) -> None:
        """Values of unknowns at the start, numbers or functions of places; zero if left out."""
        for name, value in values.items():
            self._start[name] = ("" if where is None else where, value)

    # solving it ---------------------------------------------------------------------------------

    def solve(
        self,
        *,
        steps: int = 1,
        until: float = 1.0,
        start: Result | None = None,
        newton: Newton | None = None,
        on_step: Callable[[Result], object] | None = None,
    ) -> Result:
        """The solution at load factor `until`, from 0 (or from `start`) in `steps` steps.

        Steps are cut where Newton's method fails and grow again; history is committed after each.
        on_step is given the result of every converged step. Raises StudyError; NotConverged if
        the end is not reached: its `reached` is the last Result, or None.
        """
        if not (isinstance(steps, int) and steps > 0):
            raise StudyError(f"steps = {steps}: a number of at least 1 is needed")
        system = self.system() if start is None else start.system
        x0 = system.at_rest() if start is None else start.x
        begin = 0.0 if start is None else start.t
        histories = system.histories() if start is None else start.histories
        state = [(x0, histories)]  # after the last converged step
        reached: list[Result] = []

        def problem_at(t: float) -> Problem:
            return system.problem(system.still(t, *state[0]))

        def keep(point: Point) -> None:
            problem, x = problem_at(point.parameter), point.solution.x
            state[0] = x, system.committed(problem, x, state[0][1])
            reached[:] = [Result(system, problem, point, state[0][1])]
            if on_step is not None:
                on_step(reached[0])

        first = abs(until - begin) / steps
        rule = StepRule(first, min(_SMALLEST, first), first)
        path = Continuation(newton or _newton(), rule, name="load factor")
        branch = path.follow(problem_at, begin, until, x0, on_point=keep)
        if not branch.converged:
            raise _stopped(branch, reached)
        return reached[0]

    def march(
        self,
        *,
        dt: float,
        until: float,
        method: Method = "euler",
        tolerance: float | None = None,
        start: Result | None = None,
        checkpoint: str | Path | None = None,
        restart: str | Path | None = None,
        newton: Newton | None = None,
    ) -> Iterator[Result]:
        """Results of the steps in time up to `until`, from 0 or where `start` or `restart` stands.

        dt: length of the (first) step. method: "euler" (backward) or "bdf2". tolerance: largest
        local error of a step, relative to the largest value of each unknown (of those with a rate,
        where there are any); steps then adapt, else
        they are dt, but for those that Newton's method needs shorter. History is committed and
        values of steps before (data u_old, `Model.rates`) are renewed after every converged step.
        checkpoint: file that is rewritten after each step; restart: such a file, from which the
        march goes on bitwise as if it had not stopped. Raises StudyError, NotConverged.
        """
        if method not in ("euler", "bdf2"):
            raise StudyError(f'method = {method!r}: allowed are "euler" and "bdf2"')
        for name, value in (("dt", dt), ("until", until), ("tolerance", tolerance)):
            if value is not None and not (np.isfinite(value) and value > 0.0):
                raise StudyError(f"{name} = {value}: must be positive")
        system = self.system() if start is None else start.system
        if restart is not None:
            clock = Clock.load(Path(restart), system)
        elif start is not None:
            clock = Clock((start.t,), start.x[None], start.histories, dt)
        else:
            clock = Clock((0.0,), system.at_rest()[None], system.histories(), dt)
        settings = March(method, tolerance, _SMALLEST * dt, newton or _newton())
        return settings.run(system, clock, until, None if checkpoint is None else Path(checkpoint))

    def follow(
        self,
        *,
        step: float,
        until: Callable[[Result], bool],
        newton: Newton | None = None,
        most: int = 1000,
    ) -> LoadPath:
        """The path from load factor 0 on, by arc length: it passes limit points of the load.

        step: length of the first and longest step. A length counts the load factor, and the
        unknowns in units of what they change by per load factor in the beginning. until: is given
        each result; the path ends where it says True. most: points at most. History is committed
        after each point. Raises StudyError; NotConverged if the end is not reached: its `reached`
        is the last Result, or None.
        """
        if not (np.isfinite(step) and step > 0.0):
            raise StudyError(f"step = {step}: must be positive")
        return follow(self.system(), step, until, newton or _newton(), most)

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
        start = {name: self._at_start(name, numbering) for name in self._start}
        pages, conditions = dict(self._blocks), (*self._conditions,)
        return System(self.mesh, numbering, assembler, pages, conditions, (*implied,), start)

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

    def _at_start(self, name: str, numbering: Numbering) -> Array:
        """Values of an unknown at every node, (points,)."""
        where, value = self._start[name]
        nodes = np.arange(len(self.mesh.points)) if where == "" else self._nodes(where)
        self._require(name, nodes, numbering, f"start({name}=...)", every=False)
        found = np.zeros(len(self.mesh.points))
        found[nodes] = _datum("start", name, value, self.mesh.points[nodes])
        return found

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
            raise StudyError(f"{shown(where)}: node numbers are a list of integers")
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
        label = f"{what} {len(self._forces) + 1}: {what}({shown(where)}, {name})"
        self._forces.append(Force(label, kernel, nodes, name))

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

    def _page_block(self, block: Block, numbering: Numbering) -> ElementBlock:
        n = len(block.nodes)
        width = len(block.kernel.coordinates)
        places = self.mesh.points[block.nodes].reshape(n, -1) if width else np.empty((n, 0))
        dofs = numbering.dofs[block.name]
        given = [block.data[d] for d in block.kernel.data if d in block.data]
        data = np.stack(given, axis=1) if given else None  # what else there is comes with steps
        return ElementBlock(block.name, block.kernel, places, dofs, data=data)

    def _force_block(self, force: Force, numbering: Numbering) -> ElementBlock:
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


def _newton() -> Newton:
    return Newton(linear=choose("auto"))


def _stopped(branch: Branch, reached: list[Result]) -> NotConverged:
    error = NotConverged(branch)
    error.reached = reached[0] if reached else None
    return error


def _automatic(kernel: Kernel, found: Sequence[Slot]) -> tuple[dict[str, Slot], dict[str, Slot]]:
    """Data u_old1, ... and u_rate1, ... of nodal unknowns u: what a study fills itself."""
    nodal = {f"{s.name}{{}}{s.node + 1}": s for s in found if s.node is not None}
    previous = {label.format("_old"): slot for label, slot in nodal.items()}
    rates = {label.format("_rate"): slot for label, slot in nodal.items()}
    return tuple(  # type: ignore[return-value]
        {d: table[d] for d in kernel.data if d in table} for table in (previous, rates)
    )


def _initial(block: str, kernel: Kernel, given: Mapping[str, Any], centres: Array) -> Array | None:
    """Point data at the start, (n, points, k): numbers or functions of the centres, else zero."""
    if not kernel.point_data:
        return None
    columns = [_datum(block, name, given.get(name, 0.0), centres) for name in kernel.point_data]
    points = len(kernel.default_rule.weights)
    return np.repeat(np.stack(columns, axis=1)[:, None, :], points, axis=1)


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


__all__ = ["MeshError", "Study", "StudyError"]
