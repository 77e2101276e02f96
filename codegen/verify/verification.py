"""Compare compiled kernels with the model as written: what `softehl generate` reports.

The C is called through ctypes on a batch, so that full groups of lanes and the remainder are
both covered. It is compared with an evaluation of the model's own SymPy expressions in 90 digits,
which differentiates numerically (`reference_evaluator`) and shares nothing with the compiler, not
even the conversion to a graph. First at an ordinary state (`random_states`), row by row, then at
far and steered ones (`state_search`), until all are done or the time is over.

Errors are relative.  Residual and tangent: row i of R and of K w (one random direction w without
zeros reaches every column), over the sum of |K_ij w_j| of its row, or |R_i| if that is larger.
In elements of more than 8 unknowns every eighth row is added, with random factors: eight sums,
at one state; of the other states all rows are added, with random factors.
Derivatives by an argument: over the largest component.  Energy: over |Pi| or max |R| max |u|.
Each field: over its largest value at the points.  No scale is below 1e-6 of the largest of its
kind (1e-6 for fields), so that zeros may be rounded.

Far from the ordinary state a model may cancel so many digits that no evaluation in doubles is good
to 1e-10. There the model is evaluated once more with a rounding error in every operation
(`arithmetics.Rounded`), and the kernel may be off by `ROUNDINGS` times what this changes. A state
where it changes more than `LOST` of a value, or has no value in the range of doubles, says nothing.
"""

from __future__ import annotations

import ctypes
import math
import random
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import Any

from softehl.codegen import abi
from softehl.codegen.derive.task_outputs import outputs
from softehl.codegen.graph.differentiation import gradient
from softehl.codegen.graph.evaluation import EvaluationState
from softehl.codegen.graph.graph import InputEntry
from softehl.codegen.language.definition import Definition
from softehl.codegen.verify import random_states
from softehl.codegen.verify.arithmetics import Exact, Rounded
from softehl.codegen.verify.kernel_batch import Batch, Vector
from softehl.codegen.verify.reference_evaluator import (
    Evaluator,
    NotRealError,
    OutOfTimeError,
    ReferenceTasks,
)
from softehl.codegen.verify.state_search import StateSearch
from softehl.codegen.verify.sympy_program import program

BOUND = 1e-10
"""Largest relative error that is rounding; a wrong derivative is off by far more."""
ROWS = 8
FLOOR = 1e-6
SHOWN = 5
"""Unreached places that are named; of others their number is told."""
ROUNDINGS = 1000
"""A kernel has other operations than its model, and their errors add up."""
LOST = 1e-6
"""Part of a value: where one rounding of each operation changes more, nothing is compared."""


@dataclass
class Report:
    """Result of the check of one kernel.

    errors: the largest of each task. compared: states. unreal, unsolved, unclear: states left out
    because the model has no real value there, a local iteration has no solution, or doubles cannot
    hold the result. missing: conditions that no state met, in words; tasks: those that were
    compared at no state. late: whether time was short.
    """

    errors: dict[str, float] = field(default_factory=dict)
    compared: int = 0
    unreal: int = 0
    unsolved: int = 0
    unclear: int = 0
    missing: list[str] = field(default_factory=list)
    tasks: list[str] = field(default_factory=list)
    late: bool = False

    def summary(self, seconds: float) -> str:
        """Extent of the check, in one line."""
        left = {
            "without a real value": self.unreal,
            "without a local solution": self.unsolved,
            "where rounding hides the result": self.unclear,
        }
        parts = [f"compared with its page at {self.compared - self.unclear} states"]
        out = [f"{count} {what}" for what, count in left.items() if count]
        parts += [f"left out: {', '.join(out)}"] if out else []
        if self.missing:
            more = len(self.missing) - SHOWN
            named = self.missing[:SHOWN] + ([f"{more} more"] if more > 0 else [])
            parts.append(f"not reached: {', '.join(named)}")
        if self.late:
            parts.append(f"not all states in {seconds:g} s: --check-seconds gives more")
        return "; ".join(parts)

    def omitted_tasks(self, seconds: float) -> str:
        """Tasks that could not be compared, and what to do."""
        why = f"the {seconds:g} s of --check-seconds are too few"
        if not self.late:
            why = "rounding hides them at all states; name better ones with m.example(...)"
        return f"{', '.join(self.tasks)} could not be compared: {why}"


class Comparison:
    """Comparison of the kernels of one family with the model `written`; results are in `report`."""

    def __init__(
        self, d: Definition, written: Definition, library: Path, deadline: float = math.inf
    ) -> None:
        self.d, self.library, self.report = d, ctypes.CDLL(str(library)), Report()
        self.program = program(written)
        self.exact = Evaluator(self.program, Exact(), deadline)
        self.rounded = Evaluator(self.program, Rounded(), deadline)
        self.rng = random.Random(f"{d.name} direction")
        self.moving: set[int] = set()
        self.size = 0

    def batch(self, states: Sequence[EvaluationState]) -> Batch:
        """The kernels on some states, each with a random direction without zeros."""
        self.size = len(states[0].dofs)
        along = [self._direction() for _ in states]
        return Batch(self.d, self.library, states, along)

    def _direction(self) -> Vector:
        return [self.rng.choice((-1, 1)) * self.rng.uniform(0.5, 1) for _ in range(self.size)]

    def ordinary(self, states: Sequence[EvaluationState], tasks: Sequence[str]) -> None:
        """The last state, in the remainder of a batch, and of small elements the first one, too.

        At once with all rows added, so that every task is met early, then row by row.
        """
        called = self.batch(states)
        indices = [len(states) - 1, 0] if self.size <= ROWS else [len(states) - 1]
        self._at(called, indices[0], [self._direction()], tasks, far=False)
        for e in indices:
            self._at(called, e, self._combs(), tasks, far=False)

    def far(
        self, state: EvaluationState, others: Sequence[EvaluationState], tasks: Sequence[str]
    ) -> None:
        """A state first and last in a batch, others of the same parameters between."""
        between = [replace(s, parameters=state.parameters) for s in others[2:]]
        called = self.batch([state, *between, state])
        if any(called.silent(t, first=True) for t in tasks):
            self.report.unsolved += 1
            return
        self._at(called, 0, [self._direction()], tasks, far=True)

    def _combs(self) -> list[Vector]:
        """Single rows up to `ROWS` of them; else `ROWS` sums of rows with that stride."""
        if self.size <= ROWS:
            return [[float(i == k) for i in range(self.size)] for k in range(self.size)]
        factors = self._direction()
        return [[f * (i % ROWS == k) for i, f in enumerate(factors)] for k in range(ROWS)]

    def _at(
        self, called: Batch, e: int, left: list[Vector], tasks: Sequence[str], *, far: bool
    ) -> None:
        unclear = False
        try:
            view = _View(self.d, called, e, left, ReferenceTasks(self.exact, called.states[e]))
            for task in tasks:
                error = view.error(task)
                if not error <= BOUND:
                    allowed = self._rounding(view, task, far=far)
                    if allowed is None:
                        unclear = True
                        continue
                    error /= 1 + allowed / BOUND
                self.report.errors[task] = max(self.report.errors.get(task, 0.0), error)
        except NotRealError:
            self.report.unreal += 1
            return
        self.report.compared += 1
        self.report.unclear += unclear
        self.moving.update(view.moving())

    def _rounding(self, view: _View, task: str, *, far: bool) -> float | None:
        """The error that rounding explains; None if it explains any."""
        digits, doubles = view.smallest_scale(task) if far else (0.0, 0.0)
        if digits > LOST:
            return None
        try:
            page = ReferenceTasks(self.rounded, view.page.state)
            change = max(doubles, view.change(task, page))
        except NotRealError:
            return None if far else 0.0
        return ROUNDINGS * change if change <= LOST else None


class _View:
    """One element of a batch and the model at its state."""

    def __init__(
        self, d: Definition, called: Batch, e: int, left: list[Vector], page: ReferenceTasks
    ):
        self.d, self.called, self.e, self.left, self.page = d, called, e, left, page
        self._memo: dict[Any, Vector] = {}
        self._rows: Vector | None = None

    def error(self, task: str) -> float:
        """Largest relative error of the values of a task; infinite if one is not a number."""
        computed, exact = self.computed(task), self.expected(task, self.page)
        scale = self.scales(task, exact)
        errors = [abs(a - b) / s for a, b, s in zip(computed, exact, scale, strict=True)]
        return max(map(finite, errors), default=0.0)

    def change(self, task: str, other: ReferenceTasks) -> float:
        """Largest difference between the model and another evaluation of it, over the scale."""
        exact = self.expected(task, self.page)
        reference = self.expected(task, other)
        scale = self.scales(task, exact)
        changes = [abs(a - b) / s for a, b, s in zip(reference, exact, scale, strict=True)]
        return max(changes, default=0.0)

    def smallest_scale(self, task: str) -> tuple[float, float]:
        """Smallest errors over the smallest scale: of differences in so many digits, of doubles."""
        if task in (abi.Task.ENERGY, *abi.AT_POINTS):
            return 0.0, 0.0
        scale = min(self.scales(task, self.expected(task, self.page)))
        order = 1 if task == abi.Task.RESIDUAL else 2
        by = 2 if task in (abi.Task.TANGENT, abi.Task.PRODUCT) else 1
        return self.page.noise(order) / scale, self.page.rounding(by, ROUNDINGS) / scale / ROUNDINGS

    def moving(self) -> set[int]:
        """Rows of the residual that are not zero."""
        task = abi.Task.RESIDUAL
        if not self._offered(task):
            return set(range(self.called.ndof))
        return {k for k, v in enumerate(self._called(task)) if v}

    def _offered(self, task: str) -> bool:
        return hasattr(self.called.library, abi.function_name(self.d.name, task))

    def _called(self, task: str) -> Vector:
        return self.called.call(task)[0][self.e]

    def computed(self, task: str) -> Vector:
        """Values of the kernel: of the tangent the residual, then products with the direction."""
        values = self._called(task)
        if task in (abi.Task.ENERGY, *abi.AT_POINTS):
            return values
        led = self._led(values)
        if task == abi.Task.TANGENT:
            led += self._led([math.fsum(row) for row in self._tangent()])
        return led

    def _led(self, values: Vector) -> Vector:
        """The compared sums of rows."""
        return [math.fsum(f * v for f, v in zip(c, values, strict=True)) for c in self.left]

    def _tangent(self) -> list[Vector]:
        """Entries K_ij w_j of the compiled tangent."""
        K, n = self.called.call(abi.Task.TANGENT)[1][self.e], self.called.ndof
        w = self.called.along[self.e]
        return [[K[n * i + j] * w[j] for j in range(n)] for i in range(n)]

    def expected(self, task: str, page: ReferenceTasks) -> Vector:
        """Values of the model, in the order of the kernel."""
        key = (id(page), task)
        if key not in self._memo:
            self._memo[key] = [_double(v) for v in self._expected(task, page)]
        return self._memo[key]

    def _expected(self, task: str, page: ReferenceTasks) -> Sequence[Any]:
        match task:
            case abi.Task.ENERGY:
                return [page.energy()]
            case abi.Task.RESIDUAL:
                return page.residual(self.left)
            case abi.Task.PRODUCT:
                return page.rate("dofs", self.called.along[self.e], self.left)
            case abi.Task.TANGENT:
                both = (abi.Task.RESIDUAL, abi.Task.PRODUCT)
                return [v for t in both for v in self.expected(t, page)]
            case abi.Task.FIELDS:
                return [v for row in page.fields() for v in row]
            case abi.Task.FIELDS_RATE:
                return [v for row in page.fields_rate(self._variation(task)) for v in row]
            case abi.Task.PSEUDO_LOAD:
                return page.pseudo_load(self._variation(task), self.left)
        node = dict(self.d.derivatives)[task.removeprefix("d_")]
        assert isinstance(node.payload, InputEntry)
        array, index = node.payload.array, node.payload.index
        unit = [float(k == index) for k in range(len(getattr(page.state, array)))]
        return page.rate(array, unit, self.left)

    def _variation(self, task: str) -> Vector:
        return self.called.direction(task, self.e)

    def scales(self, task: str, exact: Vector) -> Vector:
        """Reference sizes of errors."""
        if task == abi.Task.ENERGY:
            work = max(map(abs, self.expected(abi.Task.RESIDUAL, self.page)))
            size = max(abs(exact[0]), work * max(abs(float(u)) for u in self.page.state.dofs))
            return [size or 1.0]
        if task in abi.AT_POINTS:
            count = len(exact) // self.called.points
            columns = [exact[k::count] for k in range(count)]
            return [max(FLOOR, *map(abs, c)) for c in columns] * (len(exact) // count)
        if task in (abi.Task.RESIDUAL, abi.Task.PRODUCT):
            return self.rows()
        if task == abi.Task.TANGENT:
            return self.rows() * 2
        return [max([*map(abs, exact), *self._sizes(self._called(task))]) or 1.0] * len(exact)

    def _sizes(self, rows: Vector) -> Vector:
        """Sums of absolute values of the compared rows; of not-a-number nothing."""
        sizes = [abs(v) if math.isfinite(v) else 0.0 for v in rows]
        pairs = [zip(c, sizes, strict=True) for c in self.left]
        return [math.fsum(abs(f) * s for f, s in pair) for pair in pairs]

    def rows(self) -> Vector:
        """Size of each row: |R_i|, or the sum of |K_ij w_j| where the tangent is offered."""
        if self._rows is None:
            page = self.page
            residual, product = (
                self.expected(t, page) for t in (abi.Task.RESIDUAL, abi.Task.PRODUCT)
            )
            rows = [max(abs(r), abs(p)) for r, p in zip(residual, product, strict=True)]
            if self._offered(abi.Task.TANGENT):
                sizes = self._sizes([math.fsum(map(abs, row)) for row in self._tangent()])
                rows = [max(a, b) for a, b in zip(rows, sizes, strict=True)]
            self._rows = [max(r, FLOOR * max(rows)) or 1.0 for r in rows]
        return self._rows


def finite(error: float) -> float:
    """Not-a-number compares with nothing: make it the largest error."""
    return error if math.isfinite(error) else math.inf


def _double(v: Any) -> float:
    """A number as a double; `NotRealError` beyond their range."""
    value = float(v)
    if math.isinf(value):
        raise NotRealError
    return value


def idle(comparison: Comparison) -> Iterator[str]:
    """Rows of the residual that a model fills and that were zero at every state, in words."""
    for k in sorted(comparison.program.moved() - comparison.moving):
        yield f"the residual of {comparison.d.unknowns[k]} other than zero"


__all__ = ["BOUND", "Report", "check", "errors", "undefined_expression"]

BATCH = 5
"""Ordinary states, so that a group of lanes is full and some remain."""
SECONDS = 10.0
"""For the check of one kernel."""
SEARCH = 1 / 4
"""Part of these for the search of states."""


def errors(
    definition: Definition, tasks: Iterable[str], library: Path, written: Definition | None = None
) -> dict[str, float]:
    """Largest error of each task of one kernel; NoStateError if no admissible state is found."""
    return check(definition, tasks, library, written).errors


def check(
    definition: Definition,
    tasks: Iterable[str],
    library: Path,
    written: Definition | None = None,
    seconds: float = SECONDS,
) -> Report:
    """Compare one kernel with its model; NoStateError if no admissible state is found.

    The model is `written`, the same one with its names written out (`model_loader.written_out`), if
    there is one. If it gives a derivative of its own, only energy and fields can be compared.
    """
    start = perf_counter()
    tasks = [
        t for t in tasks if not definition.prescribed or t in (abi.Task.ENERGY, abi.Task.FIELDS)
    ]
    states = random_states.admissible_states(definition, BATCH)
    comparison = Comparison(definition, written or definition, library, start + seconds)
    report = comparison.report
    if any(comparison.batch(states).silent(t) for t in tasks):
        raise random_states.NoStateError(
            f"{definition.name} cannot be checked: its local iteration finds no solution at random "
            f"states; say where it does, e.g. m.example({random_states.suggestion(definition)})"
        )
    explorer = StateSearch(comparison.program, states)
    try:
        comparison.ordinary(states, tasks)
        for state in list(explorer.states(SEARCH * seconds)):
            comparison.far(state, states, tasks)
    except OutOfTimeError:
        report.late = True
    report.late = report.late or explorer.late
    report.unreal += explorer.unreal
    report.tasks = [t for t in tasks if t not in report.errors]
    report.missing += [explorer.text(t) for t in explorer.missing]
    report.missing += idle(comparison) if report.compared else []
    return report


def undefined_expression(d: Definition, task: str) -> str | None:
    """Expression without a value in a task whose result is not a number, for the model's author."""
    gradients = gradient(
        d.graph, d.potential, d.directions, constant=d.constant, prescribed=d.prescribed
    )
    states = random_states.admissible_states(d, BATCH)
    for nodes in ([gradients[u] for u in d.directions], [x.node for x in outputs(d, task)]):
        for state in states:
            fault = random_states.first_fault(nodes, state)
            if fault is not None:
                return fault
    return None
