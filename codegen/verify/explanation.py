"""Explanation of a kernel at a state: every named value, and the first operation without one.

The graph of the page is evaluated as written, in more digits than a kernel has; a value beyond the
range of doubles counts as none. Sides of branches that are not taken are left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import mpmath
from mpmath.libmp import NoConvergence

from softehl.codegen.graph.differentiation import gradient
from softehl.codegen.graph.evaluation import EvaluationState, Walk
from softehl.codegen.graph.graph import BOOLEAN, InputEntry, Node, Op, ResultIndex, Routine
from softehl.codegen.graph.routines import NewtonRoutine
from softehl.codegen.graph.run_time_arrays import ArrayRoutine
from softehl.codegen.graph.tensor_functions import TensorRoutine
from softehl.codegen.graph.traversal import reachable
from softehl.codegen.language.definition import Definition

DIGITS = 30
LARGEST = 1.7976931348623157e308
"""Largest double."""
GEOMETRY = ("parent_", "shape_")
"""Beginnings of names that cells give to their geometry, which stand on no line of a page."""
DEPTH = 4
"""Levels of operations that are printed of an expression."""


@dataclass(frozen=True)
class NamedValue:
    """Values of a name at the points, nan where there is none, and its line (`file:line`)."""

    name: str
    values: tuple[float, ...]
    where: str


@dataclass(frozen=True)
class GraphExplanation:
    """Named values in the order of the page; fault: the first operation without a value, or ""."""

    values: tuple[NamedValue, ...]
    fault: str


def explain(d: Definition, state: EvaluationState) -> GraphExplanation:
    """Explanation of a model at a state of one element."""
    with mpmath.workdps(DIGITS):
        evaluation = _Evaluation(d, state)
        return GraphExplanation(tuple(evaluation.named_values()), evaluation.fault())


class _Evaluation:
    """Values of the nodes of a model at a state; None where there is no double."""

    def __init__(self, d: Definition, state: EvaluationState) -> None:
        self.d, self.state = d, state
        self.walk = Walk(state, {})
        self.points = range(len(state.rule))
        self.labels = _labels(d)

    def value(self, n: Node, q: int) -> Any:
        """Value of a node at a point; a list of those of a routine."""
        try:
            v = self.walk.at(n, q)
        except (ArithmeticError, ValueError, TypeError, NoConvergence):
            return None  # TypeError: complex numbers have no order
        real = isinstance(v, (bool, list)) or (
            isinstance(v, mpmath.mpf) and mpmath.isfinite(v) and abs(v) <= LARGEST
        )
        return v if real else None

    # named values -------------------------------------------------------------------------------

    def named_values(self) -> Iterator[NamedValue]:
        """Arguments, then what the page names."""
        for n, label in self.labels.items():
            yield NamedValue(label, self._row(n), "")
        solutions = self._solutions()
        for s in self.d.statements:
            if s.name and s.value not in self.labels:
                local = {
                    n.payload.array
                    for n in reachable([s.value])
                    if isinstance(n.payload, InputEntry)
                } - _ARRAYS
                where = "" if s.name.startswith(GEOMETRY) else _page_line(s.where)
                if not local:
                    yield NamedValue(s.name, self._row(s.value), where)
                elif local <= set(solutions):
                    yield NamedValue(s.name, self._at_solution(s.value, solutions), where)

    def _row(self, n: Node) -> tuple[float, ...]:
        return tuple(_double(self.value(n, q)) for q in (self.points if n.varying else [0]))

    def _solutions(self) -> dict[str, list[Node]]:
        """Solutions of local equations by their array of placeholders."""
        solutions: dict[str, dict[int, Node]] = {}
        for n in reachable([s.value for s in self.d.statements]):
            if isinstance(n.payload, ResultIndex) and isinstance(n.args[0].payload, NewtonRoutine):
                items = solutions.setdefault(f"local {n.args[0].payload.name}", {})
                items[n.payload.index] = n
        return {array: [items[k] for k in sorted(items)] for array, items in solutions.items()}

    def _at_solution(self, n: Node, solutions: Mapping[str, Sequence[Node]]) -> tuple[float, ...]:
        """Values of what stands inside local equations, at their solution."""
        row = []
        for q in self.points:
            inside = _Evaluation(self.d, self.state)
            for array, items in solutions.items():
                inside.walk.arrays[array] = [self.value(item, q) for item in items]
            row.append(_double(inside.value(n, q)))
        return tuple(row)

    # fault --------------------------------------------------------------------------------------

    def fault(self) -> str:
        """The first operation without a value: of the equations, their derivatives, the fields."""
        d = self.d
        written = self._first([s.value for s in d.statements if not s.name] or [d.potential])
        if written:
            return self._described(*written)
        residual, tangent = _derivatives(d)
        for roots in (residual, tangent, [n for _, n in d.fields]):
            first = self._first(roots)
            if first:
                return self._described(*first)
        return ""

    def _first(self, roots: Sequence[Node]) -> tuple[Node, int] | None:
        """Operation and point of the first node without a value, operands before users."""
        seen: set[tuple[Node, int]] = set()
        for root in roots:
            for q in self.points if root.varying else [0]:
                if self.value(root, q) is not None:
                    continue
                stack = [(root, q, False)]
                while stack:
                    n, k, done = stack.pop()
                    k = k if n.varying else 0
                    if done:
                        if n.op not in (*BOOLEAN, Op.CALL) and self.value(n, k) is None:
                            return n, k
                    elif (n, k) not in seen:
                        seen.add((n, k))
                        stack.append((n, k, True))
                        stack += [(a, j, False) for a, j in self._operands(n, k)]
        return None

    def _operands(self, n: Node, q: int) -> list[tuple[Node, int]]:
        """Operands of a node at a point, of a branch the side that is taken, last one first."""
        if n.op is Op.SUM:
            return [(n.args[0], k) for k in reversed(self.points)]
        if n.op is Op.BRANCH:
            condition = self.value(n.args[0], q)
            active = [] if condition is None else [(n.args[1 if condition else 2], q)]
            return [*active, (n.args[0], q)]
        return [(a, q) for a in reversed(n.args)]

    def _described(self, n: Node, q: int) -> str:
        """An operation without a value: text, operands, point, line of the page."""
        names = dict(self.labels)
        for s in self.d.statements:
            if s.name:
                names.setdefault(s.value, s.name)
        point = f" at point {q}" if n.varying and len(self.points) > 1 else ""
        if n.op is Op.ITEM and isinstance(n.args[0].payload, ArrayRoutine):
            operands = n.args[0].args[:-1]
            args = [f"{_text(a, names, DEPTH)} = {_double(self.value(a, q)):.6g}" for a in operands]
            array = self.d.arrays[n.args[0].payload.array].name
            at = ", ".join(args)
            return f"{array} has no value{point}, {at}{self._line(n)}"
        if n.op is Op.ITEM and isinstance(n.args[0].payload, TensorRoutine):
            return f"{n.args[0].payload.function.what} has no value{point}{self._line(n)}"
        if n.op is Op.ITEM and isinstance(n.args[0].payload, Routine):
            return f"{n.args[0].payload.name} has no solution{point}{self._line(n)}"
        values_of = {_text(a, names, 1): self.value(a, q) for a in n.args if a.op is not Op.CONST}
        values = ", ".join(f"{k} = {_double(v):.6g}" for k, v in values_of.items())
        text = _text(n, names, DEPTH)
        return f"{text} has no value{point}{', ' if values else ''}{values}{self._line(n)}"

    def _line(self, n: Node) -> str:
        """The statement of the page that holds an operation, in words."""
        for s in self.d.statements:
            if n in reachable([s.value]):
                return f" ({s.name or 'equation'}{_comma(_page_line(s.where))})"
        inside = set(reachable([n]))
        below = [s for s in self.d.statements if s.name and s.value in inside]
        if not below:
            return ""
        return f" (in a derivative, of {below[-1].name}{_comma(_page_line(below[-1].where))})"


def _comma(text: str) -> str:
    return text and f", {text}"


def _derivatives(d: Definition) -> tuple[list[Node], list[Node]]:
    """Residual, and the derivatives of a sum of its rows with weights that do not cancel."""
    g = d.graph
    first = gradient(g, d.potential, d.directions, constant=d.constant, prescribed=d.prescribed)
    residual = [first[u] for u in d.directions]
    total = g.zero
    for k, r in enumerate(residual):
        total = g.add(total, g.mul(g.const(Fraction(k + 1)), r))
    second = gradient(g, total, d.directions, prescribed=d.prescribed)
    return residual, [second[u] for u in d.directions]


def _page_line(where: str) -> str:
    """File and line of a statement; empty where the package itself makes it."""
    path = Path(where.rpartition(":")[0])
    inside = any(path.is_relative_to(_PACKAGE / room) for room in ("codegen", "runtime"))
    inside = inside or (path.parent.name, path.name) == ("softehl", "__init__.py")
    return "" if inside and not path.is_relative_to(_PACKAGE / "codegen" / "models") else where


_PACKAGE = Path(__file__).resolve().parents[2]
_ARRAYS = {"coordinates", "dofs", "data", "parameters", "rule", "point data", "interpolated"} | {
    *("arrays", "term history")
}


def _labels(d: Definition) -> dict[Node, str]:
    """Arguments of a model that it uses, with their names."""
    names = {
        "coordinates": [f"{c}{k + 1}" for k in range(d.nodes) for c in d.coordinates],
        "dofs": [*d.unknowns],
        "data": [a.name for a in d.data],
        "parameters": [a.name for a in d.parameters],
        "point data": [a.name for a in d.point_data],
    }
    roots = [d.potential, *(s.value for s in d.statements), *(n for _, n in d.fields)]
    labels = {}
    for n in reachable(roots):
        if isinstance(n.payload, InputEntry) and n.payload.array in names:
            labels[n] = names[n.payload.array][n.payload.index]
    return labels


_INFIX = {
    Op.ADD: " + ",
    Op.SUB: " - ",
    Op.MUL: "*",
    Op.LT: " < ",
    Op.LE: " <= ",
    Op.EQ: " = ",
    Op.AND: " and ",
    Op.OR: " or ",
}


def _text(n: Node, names: Mapping[Node, str], depth: int) -> str:
    """An expression as a formula; `...` below so many levels."""
    if n in names:
        return names[n]
    if n.op is Op.CONST:
        return str(n.value)
    if n.op is Op.NAME:
        return str(n.payload)
    if n.op is Op.INPUT or depth == 0:
        return "..."
    parts = [_text(a, names, depth - 1) for a in n.args]
    enclosed = [
        p if " " not in p or a.op not in _INFIX else f"({p})"
        for p, a in zip(parts, n.args, strict=True)
    ]
    if n.op is Op.ADD and n.args[1].op is Op.CONST and n.args[1].value < 0:
        return f"{parts[0]} - {-n.args[1].value}"
    if n.op in _INFIX:
        return _INFIX[n.op].join(parts if n.op is Op.ADD else enclosed)
    if n.op is Op.RECIP:
        return f"1/{enclosed[0]}" if "*" not in enclosed[0] else f"1/({parts[0]})"
    if n.op is Op.NEG:
        return f"-{enclosed[0]}"
    if n.op is Op.POW:
        exponent = Fraction(n.payload)  # type: ignore[arg-type]
        root, integral = f"sqrt({parts[0]})", exponent.denominator == 1
        special = {Fraction(1, 2): root, Fraction(-1, 2): f"1/{root}"}
        return (
            special.get(exponent) or f"{enclosed[0]}**{exponent if integral else f'({exponent})'}"
        )
    if n.op is Op.POWER:
        return f"{enclosed[0]}**{enclosed[1]}"
    return f"{n.op}({', '.join(parts)})"


def _double(v: Any) -> float:
    return float("nan") if v is None else float(v)


__all__ = ["GraphExplanation", "NamedValue", "explain"]
