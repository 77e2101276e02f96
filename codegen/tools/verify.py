"""Compare compiled kernels with the slow oracle at random states: what `softehl generate` reports.

The C is called through ctypes on a batch, so that full groups of lanes and the remainder are
both covered; the oracle walks the unoptimised graph in 90 digits and differentiates by central
differences, sharing nothing with derivation and emission.

Errors are relative.  Residual and tangent: row i of R and of K w (one random direction w without
zeros reaches every column), over the sum of |K_ij w_j| of its row, or |R_i| if that is larger.
In elements of more than 8 unknowns every eighth row is added, with random factors: eight sums,
at one state.
Derivatives by an argument: over the largest component.  Energy: over |Pi| or max |R| max |u|.
Each field: over its largest value at the points.  No scale is below 1e-6 of the largest of its
kind (1e-6 for fields), so that zeros may be rounded.
"""

from __future__ import annotations

import ctypes
import math
import random
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from softehl.codegen import abi
from softehl.codegen.derive.variants import outputs
from softehl.codegen.graph.differentiate import gradient
from softehl.codegen.graph.evaluate import State
from softehl.codegen.graph.graph import Input, Op
from softehl.codegen.graph.traverse import reachable
from softehl.codegen.language.definition import Definition
from softehl.codegen.tools import samples
from softehl.codegen.tools.oracle import Oracle

BOUND = 1e-10
"""Largest relative error that is rounding; a wrong derivative is off by far more."""
BATCH = 5
COMPARED = (BATCH - 1, 0)
"""States that are compared: in the remainder and, of up to `ROWS` unknowns, in a full group too."""

ROWS = 8
FLOOR = 1e-6

Vector = list[float]


def errors(
    definition: Definition, tasks: Iterable[str], library: Path, written: Definition | None = None
) -> dict[str, float]:
    """Largest error of each task of one kernel; NoStateError if no admissible state is found.

    The oracle walks `written`, the same page with its names written out (`user.written_out`), if
    there is one. Where the page gives a derivative of its own, only energy and fields can be
    compared.
    """
    tasks = [t for t in tasks if not definition.given or t in (abi.Task.ENERGY, abi.Task.FIELDS)]
    states = samples.admissible(definition, BATCH)
    rng = random.Random(f"{definition.name} direction")
    ndof = len(states[0].dofs)
    along = [[rng.choice((-1, 1)) * rng.uniform(0.5, 1) for _ in range(ndof)] for _ in states]
    called = Batch(definition, ctypes.CDLL(str(library)), states, along)
    if any(called.silent(t) for t in tasks):
        raise samples.NoStateError(
            f"{definition.name} cannot be checked: its local iteration finds no solution at random "
            f"states; say where it does, e.g. m.example({samples.suggestion(definition)})"
        )
    compared = _Compared(definition, states, along, called, written or definition)
    return {t: max(map(_finite, compared.errors(t)), default=0.0) for t in tasks}


def culprit(d: Definition, task: str) -> str | None:
    """What has no value in a task whose result is not a number, for the author of the page."""
    slopes = gradient(d.graph, d.potential, d.directions, constant=d.constant, given=d.given)
    states = samples.admissible(d, BATCH)
    for nodes in ([slopes[u] for u in d.directions], [x.node for x in outputs(d, task)]):
        for state in states:
            found = samples.first_fault(nodes, state)
            if found is not None:
                return found
    return None


def _finite(error: float) -> float:
    """Not-a-number compares with nothing: make it the largest error."""
    return error if math.isfinite(error) else math.inf


class Batch:
    """The kernels of one family called on all states at once."""

    def __init__(
        self, d: Definition, library: Any, states: Sequence[State], along: Sequence[Vector]
    ) -> None:
        self.d, self.library, self.states = d, library, states
        first = states[0]
        self.ndof, self.points = len(first.dofs), len(first.rule)
        flat = [v for point in first.basis for pair in point for v in pair]
        self.arrays = [
            _doubles(v for s in states for v in s.coordinates),
            _doubles(v for s in states for v in s.dofs),
            _doubles(v for s in states for row in (s.data, *s.point_data) for v in row),
            _doubles(first.parameters),
            _doubles(()),
            _doubles(v for row in first.rule for v in row),
            _doubles(flat),
        ]
        self.along = along
        self.modes = len(first.basis[0]) if first.basis else 0

    def call(self, task: str) -> tuple[list[Vector], list[Vector]]:
        """Values and, of the task `tangent`, tangents of every state, flat."""
        (wide, values), (square, tangent), run = self.prepared(task)
        run()
        n = len(self.states)
        return _split(values, wide, n), _split(tangent, square, n)

    def prepared(self, task: str) -> tuple[Any, Any, Callable[[], None]]:
        """Width and array of values and of tangents, and the call that fills them."""
        fields = self.points * len(self.d.fields)
        width = {abi.Task.ENERGY: 1, **dict.fromkeys(abi.AT_POINTS, fields)}
        wide = width.get(abi.Task(task), self.ndof) if task in set(abi.Task) else self.ndof
        square = self.ndof**2 if task == abi.Task.TANGENT else 0
        n = len(self.states)
        values, tangent = _doubles([math.nan] * n * wide), _doubles([math.nan] * n * square)
        function = getattr(self.library, abi.function_name(self.d.name, task))
        function.restype = None
        sizes = (ctypes.c_ssize_t(v) for v in (n, self.points, self.modes))
        self.arrays[4] = _doubles(v for e in range(n) for v in self.direction(task, e))
        arguments = (*sizes, *self.arrays, values, tangent)
        return (wide, values), (square, tangent), lambda: function(*arguments)

    def direction(self, task: str, e: int) -> Vector:
        """What a task follows in one element: its unknowns, or a random variation of all else."""
        if task not in (abi.Task.PSEUDO_LOAD, abi.Task.FIELDS_RATE):
            return self.along[e]
        state = self.states[e]
        rng = random.Random(f"{self.d.name} variation {e}")
        sizes = [len(state.coordinates), len(state.data), len(state.parameters)]
        values = [*state.coordinates, *state.data, *state.parameters]
        varied = [rng.uniform(-1, 1) * abs(float(v)) for v in values[: sum(sizes)]]
        return varied + (self.along[e] if task == abi.Task.FIELDS_RATE else [])

    def silent(self, task: str) -> bool:
        """Whether a model with routines is not-a-number in a whole element: its way to say no."""
        if all(n.op is not Op.CALL for n in reachable([self.d.potential])):
            return False
        return any(all(map(math.isnan, v)) for v in self.call(task)[0])


def _doubles(values: Iterable[Any]) -> Any:
    numbers = [float(v) for v in values]
    return (ctypes.c_double * max(len(numbers), 1))(*numbers)


def _split(values: Any, width: int, n: int) -> list[Vector]:
    return [list(values[width * e : width * (e + 1)]) for e in range(n)]


def _combs(size: int, rng: random.Random) -> list[Vector]:
    """Each row on its own up to `ROWS`; else so many sums of rows that lie `ROWS` apart."""
    if size <= ROWS:
        return [[float(i == k) for i in range(size)] for k in range(size)]
    factors = [rng.choice((-1, 1)) * rng.uniform(0.5, 1) for _ in range(size)]
    return [[f * (i % ROWS == k) for i, f in enumerate(factors)] for k in range(ROWS)]


class _Compared:
    """Errors of each task at the compared states."""

    def __init__(
        self,
        d: Definition,
        states: Sequence[State],
        along: Sequence[Vector],
        called: Batch,
        walked: Definition,
    ) -> None:
        self.d, self.states, self.along, self.called = d, states, along, called
        self.oracle = Oracle(walked)
        self.left = _combs(len(along[0]), random.Random(f"{d.name} rows"))
        self.compared = COMPARED if len(along[0]) <= ROWS else COMPARED[:1]
        pairs = [(e, states[e]) for e in self.compared]
        self.products = {e: self.oracle.product(at, along[e], self.left) for e, at in pairs}
        self.residuals = {e: self.oracle.residual(at, self.left) for e, at in pairs}
        self.scales = {e: self._scale(e) for e in self.compared}

    def _scale(self, e: int) -> Vector:
        """Size of each row: |R_i|, or the sum of |K_ij w_j| where the tangent is offered."""
        pairs = zip(self.residuals[e], self.products[e], strict=True)
        rows = [max(abs(float(r)), abs(float(p))) for r, p in pairs]
        if hasattr(self.called.library, abi.function_name(self.d.name, abi.Task.TANGENT)):
            sizes = [math.fsum(map(abs, entries)) for entries in self._rows(e)]
            for k, factors in enumerate(self.left):
                combined = math.fsum(abs(f) * s for f, s in zip(factors, sizes, strict=True))
                rows[k] = max(rows[k], combined)
        return [max(r, FLOOR * max(rows)) or 1.0 for r in rows]

    def _rows(self, e: int) -> list[Vector]:
        """Entries K_ij w_j of the compiled tangent."""
        K, n = self.called.call(abi.Task.TANGENT)[1][e], self.called.ndof
        return [[K[n * i + j] * self.along[e][j] for j in range(n)] for i in range(n)]

    def errors(self, task: str) -> Iterator[float]:
        """Relative errors of all values of a task."""
        values = self.called.call(task)[0]
        for e in self.compared:
            if task == abi.Task.ENERGY:
                exact = self.oracle.potential(self.states[e])
                work = max(abs(float(r)) for r in self.residuals[e])
                size = max(abs(float(exact)), work * max(map(abs, self.states[e].dofs)))
                yield from self._by_row(values[e], [exact], [size or 1.0])
            elif task in abi.AT_POINTS:
                rows = self._at_points(task, e)
                sizes = [max(FLOOR, *(abs(float(v)) for v in c)) for c in zip(*rows, strict=True)]
                expected = [v for row in rows for v in row]
                yield from self._by_row(values[e], expected, sizes * len(rows))
            elif task.startswith("d_") or task == abi.Task.PSEUDO_LOAD:
                expected = self._derivative(task, e)
                size = max(abs(float(v)) for v in expected) or 1.0
                yield from self._by_row(self._led(values[e]), expected, [size] * len(expected))
            elif task == abi.Task.PRODUCT:
                yield from self._by_row(self._led(values[e]), self.products[e], self.scales[e])
            else:
                yield from self._by_row(self._led(values[e]), self.residuals[e], self.scales[e])
                if task == abi.Task.TANGENT:
                    product = [math.fsum(row) for row in self._rows(e)]
                    yield from self._by_row(self._led(product), self.products[e], self.scales[e])

    def _at_points(self, task: str, e: int) -> list[Vector]:
        """Fields, or their rates, [point][field]."""
        if task == abi.Task.FIELDS:
            return self.oracle.fields(self.states[e])
        return self.oracle.fields_rate(self.states[e], self.called.direction(task, e))

    def _derivative(self, task: str, e: int) -> list[Any]:
        if task == abi.Task.PSEUDO_LOAD:
            variation = self.called.direction(task, e)
            return self.oracle.pseudo_load(self.states[e], variation, self.left)
        node = dict(self.d.derivatives)[task.removeprefix("d_")]
        assert isinstance(node.payload, Input)
        source = node.payload
        return self.oracle.derivative(self.states[e], source.array, source.index, self.left)

    def _led(self, values: Vector) -> Vector:
        """The compared sums of rows."""
        return [math.fsum(f * v for f, v in zip(c, values, strict=True)) for c in self.left]

    def _by_row(self, given: Vector, right: Sequence[Any], scale: Vector) -> Iterator[float]:
        for a, b, s in zip(given, right, scale, strict=True):
            yield abs(float(a - b)) / s
