"""The compiled kernels of one family, called through ctypes on a batch of states."""

from __future__ import annotations

import ctypes
import math
import random
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

from softehl.codegen import abi
from softehl.codegen.emit.c_printer import design_width, point_width
from softehl.codegen.graph.evaluation import EvaluationState
from softehl.codegen.graph.graph import Op
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.language.definition import Definition

Vector = list[float]


class Batch:
    """The kernels of one family called on all states at once."""

    def __init__(
        self,
        d: Definition,
        library: Any,
        states: Sequence[EvaluationState],
        along: Sequence[Vector],
    ) -> None:
        states = [_with_addresses(d, s) for s in states] if d.functions else states
        self.d, self.library, self.states = d, library, states
        first = states[0]
        self.ndof, self.points = len(first.dofs), len(first.rule)
        flat = [v for point in first.basis for pair in point for v in pair]
        self.arrays = [
            _doubles(v for s in states for v in s.coordinates),
            _doubles(v for s in states for v in s.dofs),
            _doubles(v for s in states for v in data_of_element(d, s)),
            _doubles(()),
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
        terms = self.states[0].term_history[:1]
        count = sum(len(h) for row in terms for h in row[: len(self.d.term_history)])
        width = {abi.Task.ENERGY: 1}
        width |= {t: self.points * (point_width(self.d, t) + count) for t in abi.AT_POINTS}
        width[abi.Task.ADJOINT_RATE] = design_width(self.d) + self.ndof
        wide = width.get(abi.Task(task), self.ndof) if task in set(abi.Task) else self.ndof
        square = self.ndof**2 if task == abi.Task.TANGENT else 0
        n = len(self.states)
        values, tangent = _doubles([math.nan] * n * wide), _doubles([math.nan] * n * square)
        function = getattr(self.library, abi.function_name(self.d.name, task))
        function.restype = None
        sizes = (ctypes.c_ssize_t(v) for v in (n, self.points, self.modes))
        self.arrays[3] = _doubles(parameters_of(self.states[0], rates=task in abi.DESIGN))
        self.arrays[4] = _doubles(v for e in range(n) for v in self.direction(task, e))
        arguments = (*sizes, *self.arrays, values, tangent)
        return (wide, values), (square, tangent), lambda: function(*arguments)

    def direction(self, task: str, e: int) -> Vector:
        """Direction of a task in one element: its unknowns, or a random variation of all else."""
        if task not in abi.DESIGN:
            return self.along[e]
        state = self.states[e]
        rng = random.Random(f"{self.d.name} variation {e}")
        sizes = [len(state.coordinates), len(state.data), len(state.parameters)]
        values = [*state.coordinates, *state.data, *state.parameters]
        varied = [rng.uniform(-1, 1) * abs(float(v)) for v in values[: sum(sizes)]]
        vectors = 3 if task in abi.ADJOINT else int(task == abi.Task.FIELDS_RATE)
        return varied + vectors * self.along[e]

    def silent(self, task: str, *, first: bool = False) -> bool:
        """True if a model with routines gives not-a-number in a whole element: no local solution.

        In any element, or in the first one.
        """
        if all(n.op is not Op.CALL for n in reachable([self.d.potential])):
            return False
        values = self.call(task)[0]
        return any(all(map(math.isnan, v)) for v in (values[:1] if first else values))


def _with_addresses(d: Definition, s: EvaluationState) -> EvaluationState:
    """A state with the addresses that the page knows, and nowhere where it knows none."""
    addresses = dict(d.addresses)
    values = [
        addresses.get(a.name, 0.0) if a.name in d.functions else v
        for a, v in zip(d.parameters, s.parameters, strict=True)
    ]
    return replace(s, parameters=values)


def data_of_element(d: Definition, s: EvaluationState) -> list[float]:
    """Data of an element, then those of each point: its own, history of terms, then their rates."""
    half = len(d.point_data) // 2 if d.point_rates else len(d.point_data)
    values = [float(v) for v in s.data]
    for q in range(len(s.rule)):
        history = list(s.point_data[q]) if s.point_data else []
        terms = list(s.term_history[q]) if s.term_history else []
        for some, rows in (
            (history[:half], terms[: len(d.term_history)]),
            (history[half:], terms[len(d.term_history) :]),
        ):
            values += [float(v) for v in some] + [float(v) for row in rows for v in row]
    return values


def parameters_of(state: EvaluationState, *, rates: bool = False) -> list[float]:
    """Parameters of a call with its run-time arrays, as `codegen.abi` has them."""
    at = len(state.parameters) + abi.ARRAY_ENTRIES * len(state.arrays)
    entries: list[float] = []
    values: list[float] = []
    moving = state.array_rates if rates else [()] * len(state.arrays)
    for array, rate in zip(state.arrays, moving, strict=True):
        position = at + len(values)
        entries += [position, len(array), position + len(array) if len(rate) else 0]
        values += [float(v) for v in (*array, *rate)]
    return [*map(float, state.parameters), *entries, *values]


def _doubles(values: Iterable[Any]) -> Any:
    numbers = [float(v) for v in values]
    return (ctypes.c_double * max(len(numbers), 1))(*numbers)


def _split(values: Any, width: int, n: int) -> list[Vector]:
    return [list(values[width * e : width * (e + 1)]) for e in range(n)]
