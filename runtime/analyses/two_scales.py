"""Two scales (FE2): a periodic unit cell at every integration point of a body.

The cells have the mean deformation gradient of their point, the body has their mean stress and its
condensed tangent. The state of a cell before a step is a row of the point data of its block: mean
gradient, fluctuations, history. Cells are solved in this process and in others beside it.
"""

from __future__ import annotations

import pickle
import signal
import subprocess
import sys
import weakref
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from hashlib import sha256
from os import environ, pathsep
from typing import IO, Any, Protocol

import numpy as np

from softehl.errors import SoftehlError
from softehl.runtime.analyses.homogenisation import Cell, Homogenised, PeriodicProblem
from softehl.runtime.arrays import Array, count_of
from softehl.runtime.definition import page_loader
from softehl.runtime.definition.element_blocks import On, add_block
from softehl.runtime.definition.kernel_loading import KernelOrigin
from softehl.runtime.definition.problem_definition import (
    PageOptions,
    ProblemDefinition,
    StudyError,
)
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.equations.system import Step
from softehl.runtime.kernels.constitutive_model import ModelKernel
from softehl.runtime.results.checkpoint import digests_of
from softehl.runtime.results.result import Result
from softehl.runtime.solve.linear.direct import direct_solver
from softehl.runtime.solve.linear.factorisation_cache import FactorisationCache
from softehl.runtime.solve.linear.linear_solver import SingularMatrix
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Point, Solution
from softehl.runtime.suggestions import join_names

_TOLERANCE = 1e-11
"""Of the equations of a cell: Newton's method of the body must not see what is left of them."""

_SMALLEST = 1.0 / 16.0
"""Of the change of F in a step of the body: a cell that needs shorter substeps has failed."""


@dataclass(frozen=True, eq=False)
class StateLayout:
    """Row of numbers of the state of a cell: F, free unknowns, histories of its blocks.

    shapes: block -> shape of its point data.
    """

    dim: int
    free: int
    shapes: Mapping[str, tuple[int, ...]]

    @classmethod
    def of(cls, cell: Cell) -> StateLayout:
        """Return the layout of a cell."""
        shapes = {name: values.shape for name, values in cell.system.histories().items()}
        return cls(cell.system.mesh.dimension, cell.basis.size, shapes)

    @property
    def width(self) -> int:
        """Length of a row."""
        sizes = [int(np.prod(shape)) for shape in self.shapes.values()]
        return self.dim**2 + self.free + sum(sizes)

    def row(self, F: Array, z: Array, histories: Mapping[str, Array]) -> Array:
        """Return the row of a state."""
        return np.concatenate([F.ravel(), z, *(histories[name].ravel() for name in self.shapes)])

    def state(self, row: Array) -> tuple[Array, Array, dict[str, Array]]:
        """Return F, free unknowns and histories of a row."""
        first = self.dim**2
        F, z = row[:first].reshape(self.dim, self.dim), row[first : first + self.free]
        histories, first = {}, first + self.free
        for name, shape in self.shapes.items():
            size = int(np.prod(shape))
            histories[name] = row[first : first + size].reshape(shape)
            first += size
        return F, z, histories


@dataclass(eq=False)
class CellState:
    """A cell in equilibrium at F, or the fault that prevents it.

    z: (m,) free unknowns. P: (dim, dim), None where it is not known yet. A, slope: see
    `Cell.condensed`, None likewise.
    """

    F: Array
    z: Array
    P: Array | None = None
    A: Array | None = None
    slope: Array | None = None
    fault: str = ""
    solution: Solution | None = None


class CellShare(Protocol):
    """Some of the cells of a body, in a process. A call is begun, and its result is received."""

    def begin(self, task: str, *arguments: Any) -> None:
        """Begin a method of `CellGroup`."""
        ...

    def receive(self) -> Any:
        """Return its result."""
        ...


@dataclass(eq=False)
class CellGroup:
    """Cells of this process: their states before the step, and at its end as far as it is known.

    time: t and dt of the step.
    """

    cell: Cell
    rows: Sequence[Array] = ()
    time: tuple[float, float] = (0.0, 0.0)
    trials: list[CellState | None] = field(default_factory=list)
    problems: dict[int, Problem] = field(default_factory=dict)
    newton: Newton = field(
        default_factory=lambda: Newton(
            tolerance=_TOLERANCE, linear=FactorisationCache(direct_solver("auto"))
        )
    )
    _pending: Any = None

    def begin(self, task: str, *arguments: Any) -> None:
        """See `CellShare`."""
        self._pending = task, arguments

    def receive(self) -> Any:
        """See `CellShare`."""
        task, arguments = self._pending
        return getattr(self, task)(*arguments)

    @cached_property
    def layout(self) -> StateLayout:
        """Layout of the states."""
        return StateLayout.of(self.cell)

    def start(self, rows: Sequence[Array] | None, time: tuple[float, float]) -> None:
        """Begin a step; rows: states of the cells before it, None for those of the last call."""
        if rows is not None:
            self.rows, self.trials = rows, [None] * len(rows)
        self.time = time
        self.problems.clear()

    def solve(self, F: Array, moduli: bool) -> tuple[Array, Array | None]:
        """Return mean stresses (n, dim, dim) and, if requested, their moduli at F (n, dim, dim).

        A cell that is not in equilibrium has nan, and those after it zero: the body has no
        residual, whatever they are.
        """
        P, size = np.zeros(F.shape), F.shape[1] ** 2
        A = np.zeros((len(F), size, size)) if moduli else None
        with np.errstate(all="ignore"):
            for k, gradient in enumerate(F):
                state = self._state(k, gradient)
                if state.P is None:
                    P[k] = np.nan
                    break
                P[k] = state.P
                if A is not None:
                    try:
                        A[k] = self._linearised(k, state).A
                    except SingularMatrix:
                        A[k] = np.nan
        return P, A

    def renewed(self, F: Array) -> list[Array]:
        """Return the states at the end of the step, rows as in `start`."""
        with np.errstate(all="ignore"):
            return [self._renewed(k, gradient) for k, gradient in enumerate(F)]

    def fault(self, k: int, F: Array) -> str:
        """Return the reason why a cell is not in equilibrium; empty if it is."""
        with np.errstate(all="ignore"):
            return self._state(k, F).fault

    def homogenised(self, k: int, F: Array) -> Homogenised:
        """Return a cell at the end of the step."""
        with np.errstate(all="ignore"):
            state = self._state(k, F)
            problem, x = self._problem(k), self._unknowns(state)
            histories = self.cell.system.committed(problem, x, self.layout.state(self.rows[k])[2])
        assert state.solution is not None
        point = Point(self.time[0], replace(state.solution, x=x))
        return Homogenised(self.cell, F, Result(self.cell.system, problem.at(x), point, histories))

    def _renewed(self, k: int, F: Array) -> Array:
        state, histories = self._state(k, F), self.layout.state(self.rows[k])[2]
        if histories:
            x = self._unknowns(state)
            histories = self.cell.system.committed(self._problem(k), x, histories)
        return self.layout.row(F, state.z, histories)

    def _state(self, k: int, F: Array) -> CellState:
        """The cell at F: from its last state, or from that before the step where it is nearer."""
        last = self.trials[k]
        if last is not None and np.array_equal(last.F, F):
            return last
        at_start = CellState(*self.layout.state(self.rows[k])[:2])
        starts = [at_start]
        if last is not None and not last.fault and _distance(last, F) < _distance(at_start, F):
            starts = [last, at_start]
        for start in starts:
            state = self._reached(k, start, F)
            if not state.fault:
                break
        self.trials[k] = state
        return state

    def _reached(self, k: int, start: CellState, F: Array) -> CellState:
        """The cell at F from a state, in substeps where Newton's method fails; history is held."""
        if not np.isfinite(F).all():
            return CellState(F, start.z, fault="F is not finite")
        state, reached, step = start, 0.0, 1.0
        while reached < 1.0:
            share = min(reached + step, 1.0)
            target = F if share == 1.0 else start.F + share * (F - start.F)
            attempt = self._attempt(k, state, target)
            if not attempt.fault:
                state, reached, step = attempt, share, 2.0 * step
                continue
            step *= 0.5
            if step < _SMALLEST:
                return replace(attempt, F=F, P=None)
        return state

    def _attempt(self, k: int, state: CellState, F: Array) -> CellState:
        """The cell at F by one solution from the linear prediction of a state."""
        cell, problem = self.cell, self._problem(k)
        try:
            slope = self._linearised(k, state).slope
        except SingularMatrix as error:
            return CellState(F, state.z, fault=str(error))
        assert slope is not None
        predicted = state.z + slope @ (F - state.F).ravel()
        equations = PeriodicProblem(problem, cell.basis, cell.displacement(F), F)
        solution = self.newton.solve(equations, predicted)
        if not solution.converged:
            return CellState(F, state.z, fault=f"{solution.status.value}: {solution.message}")
        r = problem.assembler.residual(equations.full(solution.x), problem.parameters)
        return CellState(F, solution.x, cell.stress(r), solution=solution.forget())

    def _linearised(self, k: int, state: CellState) -> CellState:
        """The state with its moduli."""
        if state.A is None:
            x, problem = self._unknowns(state), self._problem(k)
            K = problem.assembler.linearise(x, problem.parameters)[1]
            state.A, state.slope = self.cell.condensed(K, self.newton.linear)
        return state

    @cached_property
    def _various(self) -> bool:
        """True if the equations depend on the state before the step."""
        filled = any(block.filled for block in self.cell.system.blocks.values())
        return filled or bool(self.layout.shapes)

    def _unknowns(self, state: CellState) -> Array:
        """All unknowns (n,) of a state."""
        return np.asarray(self.cell.basis.B @ state.z + self.cell.displacement(state.F))

    def _problem(self, k: int) -> Problem:
        """The equations of a cell in this step; one for all where they do not depend on it."""
        k = k if self._various else 0
        if k not in self.problems:
            F, z, histories = self.layout.state(self.rows[k])
            t, dt = self.time
            old, system = self._unknowns(CellState(F, z)), self.cell.system
            step = Step(t, t, old, 0.0, np.zeros(system.size), dt, histories)
            self.problems[k] = system.problem(step)
        return self.problems[k]


def _distance(state: CellState, F: Array) -> float:
    return float(np.linalg.norm(F - state.F))


class RemoteGroup:
    """Cells in a process of their own, which ends with this object."""

    def __init__(self, cell: Cell) -> None:
        """Raises StudyError where the cell cannot go to another process."""
        try:
            data = pickle.dumps(_without_definition(cell))
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            raise StudyError(
                f"processes: the unit cell cannot go to another process ({error}): functions of "
                "its study are named ones of a module; or give processes=1"
            ) from None
        command = "from softehl.runtime.analyses.two_scales import serve; serve()"
        self._process = subprocess.Popen(
            [sys.executable, "-c", command],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**environ, "PYTHONPATH": pathsep.join(p or "." for p in sys.path)},
        )
        self._finalizer = weakref.finalize(self, _end, self._process)
        self._send(data)

    def begin(self, task: str, *arguments: Any) -> None:
        """See `CellShare`."""
        self._send(pickle.dumps((task, arguments), protocol=pickle.HIGHEST_PROTOCOL))

    def receive(self) -> Any:
        """See `CellShare`.  Raises what the task raises, StudyError if the process has ended."""
        assert self._process.stdout is not None
        data = _read(self._process.stdout)
        if data is None:
            raise StudyError("a process of unit cells has ended; its message is on stderr")
        result = pickle.loads(data)
        if isinstance(result, BaseException):
            raise result
        return result

    def _send(self, data: bytes) -> None:
        assert self._process.stdin is not None
        _write(self._process.stdin, data)


def _without_definition(cell: Cell) -> Cell:
    """A copy of a cell that can be pickled: definitions may hold functions."""
    return replace(cell, system=replace(cell.system, definition=None))


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process without waiting for its task."""
    process.kill()
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with suppress(OSError):  # a request that was not sent
                stream.close()
    process.wait()


def _write(stream: IO[bytes], data: bytes) -> None:
    stream.write(len(data).to_bytes(8, "little"))
    stream.write(data)
    stream.flush()


def _read(stream: IO[bytes]) -> bytes | None:
    """The next message; None at the end."""
    head = stream.read(8)
    return stream.read(int.from_bytes(head, "little")) if len(head) == 8 else None


def serve() -> None:
    """Solve cells for another process until it closes stdin."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the terminal sends it to all processes
    requests, replies = sys.stdin.buffer, sys.stdout.buffer
    sys.stdout = sys.stderr
    data = _read(requests)
    if data is None:
        return
    group = CellGroup(pickle.loads(data))
    while (data := _read(requests)) is not None:
        task, arguments = pickle.loads(data)
        result: Any
        try:
            result = getattr(group, task)(*arguments)
        except SoftehlError as error:
            result = error
        _write(replies, pickle.dumps(result, protocol=pickle.HIGHEST_PROTOCOL))


@dataclass(eq=False)
class UnitCells:
    """Unit cells of a block: a constitutive model.

    processes: number of processes that share the cells, this one among them.
    """

    cell: Cell
    processes: int = 1
    _states: Array | None = field(default=None, init=False, repr=False)
    _time: tuple[float, float] | None = field(default=None, init=False, repr=False)
    _groups: list[CellShare] = field(default_factory=list, init=False, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """For `copy` and `pickle`: without what only saves time."""
        return {**vars(self), "_states": None, "_time": None, "_groups": []}

    @cached_property
    def signature(self) -> str:
        """See `ConstitutiveModel`."""
        digest = sha256(self.cell.fluctuations.indices.tobytes())
        for values in digests_of(self.cell.system).values():
            digest.update(values.tobytes())
        return digest.hexdigest()

    @property
    def parameters(self) -> tuple[str, ...]:
        """See `ConstitutiveModel`."""
        blocks = self.cell.system.blocks.values()
        timed = any("dt" in b.kernel.parameters and "dt" not in b.parameters for b in blocks)
        return ("t", "dt") if timed else ("t",)

    def initial(self, elements: int, points: int) -> Array:
        """Return the states (elements, points, k) of cells at rest."""
        layout, system = StateLayout.of(self.cell), self.cell.system
        z = self.cell.basis.coordinates(system.at_rest())
        row = layout.row(np.eye(layout.dim), z, system.histories())
        return np.tile(row, (elements, points, 1))

    def stress(self, states: Array, parameters: Array, F: Array) -> Array:
        """See `ConstitutiveModel`."""
        return self._solved(states, parameters, F, moduli=False)[0]

    def moduli(self, states: Array, parameters: Array, F: Array) -> tuple[Array, Array]:
        """See `ConstitutiveModel`."""
        P, A = self._solved(states, parameters, F, moduli=True)
        assert A is not None
        return P, A

    def renewed(self, states: Array, parameters: Array, F: Array) -> Array:
        """See `ConstitutiveModel`."""
        self._begin(states, parameters)
        n, points, dim = F.shape[:3]
        result = np.empty((n * points, states.shape[2]))
        for part, rows in self._shared("renewed", F.reshape(-1, dim, dim)):
            result[part] = rows
        return result.reshape(states.shape)

    def fault(self, states: Array, parameters: Array, F: Array, element: int) -> str:
        """See `ConstitutiveModel`."""
        self._begin(states, parameters)
        for point, gradient in enumerate(F[element]):
            message = self._one(element * F.shape[1] + point, "fault", gradient)
            if message:
                return f"its unit cell at point {point} is not in equilibrium: {message}"
        return ""

    def state(
        self, states: Array, parameters: Array, F: Array, element: int, point: int
    ) -> Homogenised:
        """See `ConstitutiveModel`."""
        group = CellGroup(self.cell)
        group.start([states[element, point]], _time_of(parameters))
        return group.homogenised(0, F[element, point])

    def _solved(
        self, states: Array, parameters: Array, F: Array, *, moduli: bool
    ) -> tuple[Array, Array | None]:
        self._begin(states, parameters)
        n, points, dim = F.shape[:3]
        P = np.empty((n * points, dim, dim))
        A = np.empty((n * points, dim**2, dim**2))
        for part, result in self._shared("solve", F.reshape(-1, dim, dim), moduli):
            P[part] = result[0]
            if moduli:
                A[part] = result[1]
        return P.reshape(F.shape), A.reshape(n, points, dim**2, dim**2) if moduli else None

    def _begin(self, states: Array, parameters: Array) -> None:
        """Give states before the step to all shares, unless they have them."""
        time, same = _time_of(parameters), self._states is states
        if same and self._time == time:
            return
        if not self._groups:
            others = [RemoteGroup(self.cell) for _ in range(self.processes - 1)]
            self._groups = [CellGroup(self.cell), *others]
        self._shared("start", None if same else states.reshape(-1, states.shape[2]), time)
        self._states, self._time = states, time

    def _shared(self, task: str, values: Array | None, *more: Any) -> list[tuple[slice, Any]]:
        """Results of a task of all cells, with the part (a slice) of the cells of each share.

        Cells go round: plastic zones are in one place.
        """
        parts = [slice(k, None, self.processes) for k in range(self.processes)]
        try:
            for part, share in zip(parts, self._groups, strict=True):
                share.begin(task, None if values is None else values[part], *more)
            return [(p, s.receive()) for p, s in zip(parts, self._groups, strict=True)]
        except BaseException:  # replies that are not received would be those of the next task
            self._groups, self._states = [], None
            raise

    def _one(self, number: int, task: str, F: Array) -> Any:
        """Result of a task of one cell."""
        share = self._groups[number % self.processes]
        share.begin(task, number // self.processes, F)
        return share.receive()


def _time_of(parameters: Array) -> tuple[float, float]:
    """t and dt of a step."""
    t, *dt = parameters.tolist()
    return t, dt[0] if dt else 0.0


def add_unit_cells(
    definition: ProblemDefinition,
    name: str,
    cell: object,
    form: PageOptions,
    *,
    geometry: str,
    on: On,
    cells: str | None,
    options: Mapping[str, Any],
) -> None:
    """Add a body with a unit cell at each point; see `Study.add`."""
    if geometry == "axisymmetric" or on is not None:
        where = f"on = {on!r}" if on is not None else f"geometry = {geometry!r}"
        raise StudyError(
            f"{name!r}: {where}: unit cells are at the points of cells in 3-D or in plane strain"
        )
    if form.shared or form.along or form.constant:
        raise StudyError(f"{name!r}: shared, along and constant are not for unit cells")
    unit_cell = _checked(name, cell, definition.mesh.dimension)
    processes = _processes(name, options)
    origin = KernelOrigin(page_loader.stress_page, None, geometry, law=False)
    existing = set(definition.blocks)
    add_block(definition, name, origin, form, on=None, cells=cells, arguments={})
    for label in definition.blocks.keys() - existing:
        block, model = definition.blocks[label], UnitCells(unit_cell, processes)
        points = len((form.rule or block.kernel.default_rule).weights)
        definition.blocks[label] = replace(
            block,
            kernel=ModelKernel.of(block.kernel, model),
            initial=model.initial(len(block.nodes), points),
            parameters={"t": _time},
            differentiated=None,
            twice_differentiated=None,
            valued=None,
        )


def _time(t: float) -> float:
    return t


def _processes(name: str, options: Mapping[str, Any]) -> int:
    """Number of processes.  Raises StudyError for other options."""
    others = [key for key in options if key != "processes"]
    if others:
        hint = "; cells are shared by processes, processes=2" if "threads" in others else ""
        raise StudyError(
            f"{name!r}: {join_names(others)}: of unit cells processes=... alone can be given{hint}"
        )
    count = count_of(options.get("processes", 1))
    if count is None:
        raise StudyError(
            f"{name!r}: processes = {options['processes']!r}: a whole number of at least 1 is "
            "needed"
        )
    return count


def _checked(name: str, cell: object, dimension: int) -> Cell:
    """The unit cell.  Raises StudyError where it cannot be one of a body."""
    if not isinstance(cell, Cell):
        raise StudyError(
            f"{name!r}: cell is a {type(cell).__name__}: a periodic cell is needed, as "
            'study.periodic(("left", "right"), ("bottom", "top")) returns'
        )
    system = cell.system
    if system.mesh.dimension != dimension:
        raise StudyError(
            f"{name!r}: the unit cell is in {system.mesh.dimension}-D, the mesh in {dimension}-D"
        )
    definition = system.definition
    if definition is not None and definition.axisymmetric:
        raise StudyError(f"{name!r}: the unit cell is axisymmetric: plane strain is needed")
    blocks = system.blocks.values()
    rated = [b.name for b in blocks if b.rates or b.accelerations]
    if rated:
        raise StudyError(
            f"{name!r}: {join_names(rated)} of the unit cell has rates: history with dt is allowed"
        )
    if system.contacts or len(system.assembler.blocks) > len(system.blocks):
        raise StudyError(
            f"{name!r}: the unit cell has loads, springs, ties or contacts: pages and materials "
            "are allowed"
        )
    return cell
