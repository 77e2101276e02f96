"""Values and derivatives of a model as written, in one of the arithmetics of `arithmetics`.

Derivatives are central differences of values: the residual that of the potential with the frozen
quantities held, the tangent that of the residual. Local equations are solved by Newton's method
with differences for slopes. Nothing of the compiler is used.

A value that is not real is None, and so is what needs it; the side of a branch that is not taken
may be None.

`ReferenceTasks` has the results of the tasks of a kernel, by differences of these values.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from decimal import localcontext
from functools import wraps
from time import perf_counter
from typing import Any, ParamSpec, TypeVar

import mpmath
from mpmath.libmp import NoConvergence

from softehl.codegen.graph import matrix_functions
from softehl.codegen.graph.evaluation import EvaluationState
from softehl.codegen.verify.arithmetics import CONTEXT, DIGITS, UNIT, Exact, Function, Number
from softehl.codegen.verify.sympy_program import Program, ProgramStep

Vector = list[Number]
Row = list[Any]
NOT_REAL = (ArithmeticError, ValueError, TypeError, NoConvergence)
ITERATIONS = 60
"""Newton steps after which a local iteration has no solution."""


class OutOfTimeError(Exception):
    """The evaluation was ended at its deadline."""


class NotRealError(ArithmeticError):
    """The model has no real value at a state."""


@dataclass(frozen=True)
class StepOperation:
    """A step with the function of its operands; None: a step with a special evaluation."""

    step: ProgramStep
    function: Function | None


class Evaluator:
    """A program in one arithmetic."""

    def __init__(self, program: Program, arithmetic: Exact, deadline: float = float("inf")) -> None:
        self.program, self.arithmetic, self.deadline = program, arithmetic, deadline
        self._operations: dict[int, StepOperation] = {}
        self._inner: dict[int, list[StepOperation]] = {}
        self._selected: dict[Any, list[StepOperation]] = {}
        slots = [slot for slot, _ in program.potentials]
        at_points = [*program.fields, *program.updates]
        self.order = self.operations(program.above([*slots, *at_points]))

    def operations(self, steps: Sequence[ProgramStep]) -> list[StepOperation]:
        """The steps with their functions."""
        for s in steps:
            if s.slot not in self._operations:
                self._operations[s.slot] = StepOperation(s, _function(s, self.arithmetic))
        return [self._operations[s.slot] for s in steps]

    def inner(self, s: ProgramStep) -> list[StepOperation]:
        """The operations inside a step."""
        if s.slot not in self._inner:
            self._inner[s.slot] = self.operations(s.inner)
        return self._inner[s.slot]

    def depending(self, arrays: frozenset[str], roots: tuple[int, ...]) -> list[StepOperation]:
        """The operations that `roots` need and that depend on some arrays."""
        key = (arrays, roots)
        if key not in self._selected:
            steps = self.program.above(roots)
            self._selected[key] = self.operations([s for s in steps if s.depends & arrays])
        return self._selected[key]

    def at(self, state: EvaluationState) -> Evaluation:
        """All values at a state."""
        points = len(state.rule)
        made = Evaluation(self, state, [[None] * len(self.program.steps) for _ in range(points)])
        made.run(self.order)
        return made


def _function(s: ProgramStep, n: Exact) -> Function | None:
    """Function of the operands of a step."""
    plain: dict[str, Function] = {
        "<": operator.lt,
        "<=": operator.le,
        ">": operator.gt,
        ">=": operator.ge,
        "==": operator.eq,
        "!=": operator.ne,
        "not": operator.not_,
        "and": _all,
        "or": _any,
        "pieces": _pieces,
        "choice": lambda c, a, b: a if _decided(c) else b,
        "max": max,
        "min": min,
        "abs": abs,
        "sign": lambda a: n.number((a > 0) - (a < 0)),
        "heaviside": lambda a, at: at if a == 0 else n.number(int(a > 0)),
        "same": lambda a: a,
        "item": lambda solution: solution[s.content],
    }
    if s.name in plain:
        return plain[s.name]
    match s.name:
        case "sum":
            return n.sum(s.slot, len(s.args))
        case "product":
            return n.product(s.slot, len(s.args))
        case "fixed power":
            return n.settled(s.slot, _fixed_power(n, s.content))
        case "power":
            return n.settled(s.slot, n.power)
        case "arctangent":
            return n.settled(s.slot, n.arctangent)
    return n.settled(s.slot, n.functions[s.name]) if s.name in n.functions else None


def _of_array(layout: Any, n: Exact) -> Function:
    return lambda array, args: layout.value(array, args, n.functions)


def _fixed_power(n: Exact, e: Any) -> Function:
    top, bottom = e.numerator, e.denominator
    if bottom == 1:
        return (lambda a: 1 / a ** (-top)) if top < 0 else lambda a: a**top
    if bottom == 2:
        root = n.functions["sqrt"]
        return (lambda a: 1 / root(a) ** -top) if top < 0 else lambda a: root(a) ** top
    exponent = n.number(e)
    return lambda a: n.power(a, exponent)


def _decided(condition: bool | None) -> bool:
    if condition is None:
        raise NotRealError
    return condition


def _all(*conditions: bool | None) -> bool:
    return False not in conditions and all(map(_decided, conditions))


def _any(*conditions: bool | None) -> bool:
    return True in conditions or any(map(_decided, conditions))


def _pieces(*pairs: Any) -> Number:
    for condition, value in zip(pairs[::2], pairs[1::2], strict=True):
        if _decided(condition):
            return value
    raise NotRealError


class Evaluation:
    """All values of a program at one state, a row of them for each point."""

    def __init__(self, evaluator: Evaluator, state: EvaluationState, rows: list[Row]) -> None:
        self.evaluator, self.state, self.rows = evaluator, state, rows
        n = evaluator.arithmetic
        self.arrays: dict[str, Vector] = {
            "coordinates": [n.number(v) for v in state.coordinates],
            "dofs": [n.number(v) for v in state.dofs],
            "data": [n.number(v) for v in state.data],
            "parameters": [n.number(v) for v in state.parameters],
            "arrays": [n.number(0)] * len(state.arrays),
            "term history": [n.number(0) for row in state.term_history[:1] for _ in row],
        }
        self.moving = [
            [(n.number(v), n.number(w)) for v, w in zip(a, b, strict=True)]
            for a, b in zip(state.arrays, state.array_rates, strict=True)
        ]
        self.solved: dict[tuple[int, int], tuple[Vector, list[Vector]]] = {}
        self.frozen: frozenset[int] = frozenset()

    # values -------------------------------------------------------------------------------------

    def run(self, operations: Sequence[StepOperation], only: int | None = None) -> None:
        """Compute these operations at all points, or only one."""
        rows = self.rows if only is None else self.rows[only : only + 1]
        for o in operations:
            s = o.step
            if perf_counter() > self.evaluator.deadline:
                raise OutOfTimeError
            if s.slot in self.frozen:
                continue
            for q, row in enumerate(rows):
                if q and not s.varying:
                    row[s.slot] = rows[0][s.slot]
                    continue
                try:
                    if o.function is None:
                        row[s.slot] = self._special(s, row, q if only is None else only)
                    else:
                        row[s.slot] = o.function(*[row[a] for a in s.args])
                except NOT_REAL:
                    row[s.slot] = None

    def _special(self, s: ProgramStep, row: Row, q: int) -> Any:
        n = self.evaluator.arithmetic
        match s.name:
            case "input":
                return n.settled(s.slot, self._input)(*s.content, q)
            case "number":
                if s.content in ("pi", "e"):
                    return n.pi() if s.content == "pi" else n.functions["exp"](n.number(1))
                exact = isinstance(s.content, bool)
                return s.content if exact else n.settled(s.slot, n.number)(s.content)
            case "integral":
                return self._integral(s)
            case "solve":
                return self._solve(s, row, q)
            case "slope":
                return self._slope(s, q)
            case "terms":
                return self._terms(s, row, q)
            case "of array":
                layout, number = s.content
                amount, *args = (row[a] for a in s.args)
                array = [v + amount * w if amount else v for v, w in self.moving[number]]
                return n.settled(s.slot, _of_array(layout, n))(array, args)
            case "external":
                return s.content.near([row[a] for a in s.args], n.number)
            case "stretches":
                squares, energy = s.content
                stretches = n.eigenvalues([row[a] for a in s.args])
                return self._with(s, q, squares, stretches, (energy,))[0]
            case "isotropic" | "eigenvalues" | "exponential":
                return self._matrix_function(s, [row[a] for a in s.args], q)
        return None

    def _matrix_function(self, s: ProgramStep, entries: Vector, q: int) -> Vector:
        """All results, row by row."""
        n = self.evaluator.arithmetic
        if s.name == "exponential":
            return matrix_functions.exponential(entries)
        values, Q = matrix_functions.eigenvectors(entries, n.functions["sqrt"])
        values = n.disturbed(values)
        if s.name == "eigenvalues":
            return sorted(values, reverse=True)
        local, f = s.content
        at = [self._with(s, q, local, [c], f)[0] for c in values]
        return [
            sum(v * x * y for v, x, y in zip(at, left, right, strict=True))
            for left in Q
            for right in Q
        ]

    def _input(self, array: str, index: int, q: int) -> Number:
        number = self.evaluator.arithmetic.number
        if array == "rule":
            return number(self.state.rule[q][index])
        if array == "point data":
            return number(self.state.point_data[q][index])
        if array == "interpolated":
            modes = self.state.basis[q]
            unknowns = self.arrays["dofs"][-len(modes) :]
            pairs = zip(modes, unknowns, strict=True)
            return sum(number(b[index]) * p for b, p in pairs)
        return self.arrays[array][index]

    def _terms(self, s: ProgramStep, row: Row, q: int) -> Number:
        """Reduction over the terms of run-time arrays."""
        entries, value, kind, numbers = s.content
        number = self.evaluator.arithmetic.number
        columns = [
            [number(v) for v in self.state.term_history[q][k]]
            if array == "term history"
            else [v + row[a] * w if row[a] else v for v, w in self.moving[k]]
            for (array, k), a in zip(numbers, s.args, strict=True)
        ]
        terms = [self._with(s, q, entries, list(t), value)[0] for t in zip(*columns, strict=True)]
        if None in terms:
            raise NotRealError
        if kind == "each":
            return terms
        n = self.evaluator.arithmetic
        if kind == "sum":
            return n.sum(s.slot, len(terms))(*terms)
        if kind == "product":
            return n.product(s.slot, len(terms))(*terms)
        return (min if kind == "minimum" else max)(terms)

    def _integral(self, s: ProgramStep) -> Number:
        n = self.evaluator.arithmetic
        weights = [n.number(point[-1]) for point in self.state.rule]
        terms = [row[s.args[0]] * w for row, w in zip(self.rows, weights, strict=True)]
        return n.sum(s.slot, len(terms))(*terms)

    def _with(
        self, s: ProgramStep, q: int, slots: Sequence[int], values: Vector, results: Sequence[int]
    ) -> Vector:
        """Values of `results` if `slots` of point q have other values, by the inner operations."""
        inner = self.evaluator.inner(s)
        all_points = any(o.step.name == "integral" for o in inner)
        rows = self.rows if all_points else self.rows[q : q + 1]
        saved = [[row[o.step.slot] for o in inner] for row in rows]
        previous = [[row[k] for k in slots] for row in rows]
        frozen, self.frozen = self.frozen, frozenset(slots)
        try:
            for k, v in zip(slots, values, strict=True):
                shared = all_points and not self.evaluator.program.steps[k].varying
                for row in rows if shared else [self.rows[q]]:
                    row[k] = v
            self.run(inner, None if all_points else q)
            return [self.rows[q][k] for k in results]
        finally:
            self.frozen = frozen
            for row, old, restored in zip(rows, saved, previous, strict=True):
                for o, v in zip(inner, old, strict=True):
                    row[o.step.slot] = v
                for k, v in zip(slots, restored, strict=True):
                    row[k] = v

    def _slope(self, s: ProgramStep, q: int) -> Number:
        value, by = s.args
        if value == by:
            return self.evaluator.arithmetic.number(1)
        if not s.inner:
            return self.evaluator.arithmetic.number(0)
        h, x = self.evaluator.arithmetic.step, self.rows[q][by]
        plus, minus = (self._with(s, q, (by,), [x + t * h], (value,))[0] for t in (1, -1))
        return (plus - minus) / (2 * h)

    def largest(self) -> Number:
        """Largest part of a potential: what the digits of a difference are counted from."""
        steps, sizes = self.evaluator.program.steps, []
        for slot, _ in self.evaluator.program.potentials:
            parts = [a for a in steps[slot].args if steps[slot].name in ("sum", "integral")]
            sizes += [self.value(k, q) for k in (slot, *parts) for q in range(len(self.rows))]
        return max(map(abs, sizes))

    def real(self) -> bool:
        """True if potentials and fields have real values."""
        page = self.evaluator.program
        try:
            for slot, _ in page.potentials:
                self.value(slot)
            for q in range(len(self.rows)):
                for slot in (*page.fields, *page.updates):
                    self.value(slot, q)
        except NotRealError:
            return False
        return True

    def value(self, slot: int, q: int = 0) -> Number:
        """A value; `NotRealError` if there is none."""
        v = self.rows[q][slot]
        if v is None or isinstance(v, bool):
            raise NotRealError
        return v

    # local equations ----------------------------------------------------------------------------

    def _solve(self, s: ProgramStep, row: Row, q: int) -> Vector:
        unknowns, equations = s.content
        n = self.evaluator.arithmetic

        def residual(values: Vector) -> Vector:
            return self._with(s, q, unknowns, values, equations)

        solution, inverse = self.solved.get((s.slot, q), ([row[a] for a in s.args], None))
        changed: Number = None
        for _ in range(ITERATIONS):
            inverse = inverse or _inverse(_jacobian(residual, solution, n.coarse))
            g = residual(solution)
            step = [sum(a * b for a, b in zip(line, g, strict=True)) for line in inverse]
            solution = [v - d for v, d in zip(solution, step, strict=True)]
            size, previous = max(map(abs, solution)), changed
            changed = max(map(abs, step))
            tolerance = n.step_tolerance * (size or 1)
            if changed <= tolerance or (
                previous is not None and 2 * changed > previous <= 10**6 * tolerance
            ):
                self.solved[s.slot, q] = solution, inverse
                return solution
            if changed > n.close * size:
                inverse = None
        raise NotRealError

    # moved states -------------------------------------------------------------------------------

    def moved(
        self,
        moves: Mapping[str, Vector],
        roots: tuple[int, ...],
        frozen: Sequence[int] = (),
    ) -> Evaluation:
        """Values of `roots` for changed arrays; `frozen` quantities keep their values."""
        made = Evaluation.__new__(Evaluation)
        made.evaluator, made.state, made.moving = self.evaluator, self.state, self.moving
        made.rows = [list(row) for row in self.rows]
        made.solved, made.frozen = dict(self.solved), frozenset(frozen)
        made.arrays = {
            k: [a + b for a, b in zip(v, moves[k], strict=True)] if k in moves else v
            for k, v in self.arrays.items()
        }
        made.run(self.evaluator.depending(frozenset(moves), roots))
        return made


def _jacobian(residual: Callable[[Vector], Vector], at: Vector, h: Number) -> list[Vector]:
    columns = []
    for j in range(len(at)):
        plus, minus = (residual([v + t * h * (i == j) for i, v in enumerate(at)]) for t in (1, -1))
        columns.append([(a - b) / (2 * h) for a, b in zip(plus, minus, strict=True)])
    return [list(line) for line in zip(*columns, strict=True)]


def _inverse(A: list[Vector]) -> list[Vector]:
    """Gauss and Jordan with partial pivoting."""
    n = len(A)
    rows = [[*line, *(int(i == j) for j in range(n))] for i, line in enumerate(A)]
    for k in range(n):
        pivot = max(range(k, n), key=lambda i: abs(rows[i][k]))
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [v / rows[k][k] for v in rows[k]]
        for i in range(n):
            if i != k:
                rows[i] = [a - rows[i][k] * b for a, b in zip(rows[i], rows[k], strict=True)]
    return [line[n:] for line in rows]


Along = Sequence[Sequence[float]]


P = ParamSpec("P")
T = TypeVar("T")


def _in_digits(function: Callable[P, T]) -> Callable[P, T]:
    @wraps(function)
    def inside(*args: P.args, **named: P.kwargs) -> T:
        with localcontext(CONTEXT), mpmath.workdps(DIGITS):
            return function(*args, **named)

    return inside


class ReferenceTasks:
    """The model at one state; `exact.NotRealError` where it has no real value.

    Every result is that of a task; `along` are combinations of rows.
    """

    @_in_digits
    def __init__(self, evaluator: Evaluator, state: EvaluationState) -> None:
        self.evaluator, self.state = evaluator, state
        self.program = evaluator.program
        self.base = evaluator.at(state)

    @_in_digits
    def energy(self) -> Number:
        """Sum of the potentials."""
        return sum(self.base.value(slot) for slot, _ in self.program.potentials)

    @_in_digits
    def fields(self) -> list[Vector]:
        """Fields, [point][field]."""
        return self._fields(self.base)

    @_in_digits
    def residual(self, along: Along) -> Vector:
        """Combinations of the residual."""
        return self._residual(self.base, along)

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
        roots = (*self.program.fields, *self.program.updates)
        plus, minus = (self._fields(self.base.moved(_times(moves, t * h), roots)) for t in (1, -1))
        return [
            [(a - b) / (2 * h) for a, b in zip(*rows, strict=True)]
            for rows in zip(plus, minus, strict=True)
        ]

    @_in_digits
    def noise(self, order: int) -> float:
        """Error of a derivative of this order by differences: digits that cancel."""
        n = self.evaluator.arithmetic
        return float(self.base.largest() * n.step_tolerance / n.step**order)

    @_in_digits
    def rounding(self, order: int, changes: float) -> float:
        """Error of a derivative of this order by the unknowns if the potential is rounded once.

        The model is taken to change so many times within the size of the unknowns.
        """
        size = max(abs(float(u)) for u in self.state.dofs) or 1.0
        return UNIT * float(self.base.largest()) * (changes / size) ** order

    def _numbers(self, values: Sequence[float]) -> Vector:
        return [self.evaluator.arithmetic.number(v) for v in values]

    def _split(self, direction: Sequence[float]) -> dict[str, Vector]:
        moves, numbers = {}, self._numbers(direction)
        for array in ("coordinates", "data", "parameters", "dofs"):
            size = len(getattr(self.state, array))
            if numbers[:size]:
                moves[array] = numbers[:size]
            numbers = numbers[size:]
        if self.state.arrays:
            moves["arrays"] = self._numbers([1.0] * len(self.state.arrays))
        return moves

    def _fields(self, at: Evaluation) -> list[Vector]:
        points = range(len(self.state.rule))
        fields, updates = self.program.fields, self.program.updates
        return [
            [*(at.value(k, q) for k in fields), *(v for k in updates for v in at.value(k, q))]
            for q in points
        ]

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
            self._residual(self.base.moved(_times(moves, t * h), roots), along) for t in (1, -1)
        )
        return [(a - b) / (2 * h) for a, b in zip(plus, minus, strict=True)]


def _times(moves: dict[str, Vector], factor: Number) -> dict[str, Vector]:
    return {k: [factor * v for v in values] for k, values in moves.items()}
