"""Results of the tasks of a kernel, by differences of the values of a page as written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from decimal import localcontext
from functools import wraps
from typing import ParamSpec, TypeVar

import mpmath

from softehl.codegen.graph.evaluate import State
from softehl.codegen.tools.digits import CONTEXT, DIGITS, UNIT, Number
from softehl.codegen.tools.exact import Evaluation, Evaluator, Vector

Along = Sequence[Sequence[float]]


P = ParamSpec("P")
T = TypeVar("T")


def _in_digits(function: Callable[P, T]) -> Callable[P, T]:
    @wraps(function)
    def inside(*args: P.args, **named: P.kwargs) -> T:
        with localcontext(CONTEXT), mpmath.workdps(DIGITS):
            return function(*args, **named)

    return inside


class Page:
    """The page at one state; `exact.NotRealError` where it has no real value.

    Every result is that of a task; `along` are combinations of rows.
    """

    @_in_digits
    def __init__(self, evaluator: Evaluator, state: State) -> None:
        self.evaluator, self.state = evaluator, state
        self.program = evaluator.program
        self.here = evaluator.at(state)

    @_in_digits
    def energy(self) -> Number:
        """Sum of the potentials."""
        return sum(self.here.value(slot) for slot, _ in self.program.potentials)

    @_in_digits
    def fields(self) -> list[Vector]:
        """Fields, [point][field]."""
        return self._fields(self.here)

    @_in_digits
    def residual(self, along: Along) -> Vector:
        """Combinations of the residual."""
        return self._residual(self.here, along)

    @_in_digits
    def rate(self, array: str, direction: Sequence[float], along: Along) -> Vector:
        """Derivative of the residual along a variation of one array; of the dofs: the product."""
        return self._rate({array: self._numbers(direction)}, along)

    @_in_digits
    def pseudo_load(self, direction: Sequence[float], along: Along) -> Vector:
        """Derivative of the residual along a variation of coordinates, data and parameters."""
        return self._rate(self._split(direction), along)

    @_in_digits
    def fields_rate(self, direction: Sequence[float]) -> list[Vector]:
        """Derivative of the fields, [point][field], along a variation that ends with the dofs."""
        moves, h = self._split(direction), self.evaluator.arithmetic.step
        roots = tuple(self.program.fields)
        plus, minus = (self._fields(self.here.moved(_times(moves, t * h), roots)) for t in (1, -1))
        return [
            [(a - b) / (2 * h) for a, b in zip(*rows, strict=True)]
            for rows in zip(plus, minus, strict=True)
        ]

    @_in_digits
    def noise(self, order: int) -> float:
        """Error of a derivative of this order by differences: digits that cancel."""
        n = self.evaluator.arithmetic
        return float(self.here.largest() * n.near / n.step**order)

    @_in_digits
    def rounding(self, order: int, changes: float) -> float:
        """Error of a derivative of this order by the unknowns if the potential is rounded once.

        The page is taken to change so many times within the size of the unknowns.
        """
        size = max(abs(float(u)) for u in self.state.dofs) or 1.0
        return UNIT * float(self.here.largest()) * (changes / size) ** order

    def _numbers(self, values: Sequence[float]) -> Vector:
        return [self.evaluator.arithmetic.number(v) for v in values]

    def _split(self, direction: Sequence[float]) -> dict[str, Vector]:
        moves, rest = {}, self._numbers(direction)
        for array in ("coordinates", "data", "parameters", "dofs"):
            size = len(getattr(self.state, array))
            if rest[:size]:
                moves[array] = rest[:size]
            rest = rest[size:]
        return moves

    def _fields(self, at: Evaluation) -> list[Vector]:
        points = range(len(self.state.rule))
        return [[at.value(slot, q) for slot in self.program.fields] for q in points]

    def _residual(self, at: Evaluation, along: Along) -> Vector:
        h = self.evaluator.arithmetic.step
        out = []
        for combination in map(self._numbers, along):
            total = self.evaluator.arithmetic.number(0)
            for slot, frozen in self.program.potentials:
                plus, minus = (
                    at.moved({"dofs": [t * h * v for v in combination]}, (slot,), frozen)
                    for t in (1, -1)
                )
                total += (plus.value(slot) - minus.value(slot)) / (2 * h)
            out.append(total)
        return out

    def _rate(self, moves: dict[str, Vector], along: Along) -> Vector:
        h = self.evaluator.arithmetic.step
        roots = tuple(slot for slot, _ in self.program.potentials)
        plus, minus = (
            self._residual(self.here.moved(_times(moves, t * h), roots), along) for t in (1, -1)
        )
        return [(a - b) / (2 * h) for a, b in zip(plus, minus, strict=True)]


def _times(moves: dict[str, Vector], factor: Number) -> dict[str, Vector]:
    return {k: [factor * v for v in values] for k, values in moves.items()}
