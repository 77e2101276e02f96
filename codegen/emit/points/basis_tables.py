"""Shape functions of a cell at the points of a rule, as tables of constants in C."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from math import prod
from typing import Any

import mpmath
import sympy as sp

from softehl.codegen.elements.element import Element
from softehl.codegen.elements.quadrature import QuadratureRule
from softehl.codegen.emit.c_printer import number

DIGITS = 40


@dataclass(frozen=True)
class LineTable:
    """Shape functions of a product along one direction.

    values: [point][node] of a line, derivatives too. node_indices: of every node of the cell its
    nodes along the directions.
    """

    values: tuple[tuple[float, ...], ...]
    derivatives: tuple[tuple[float, ...], ...]
    node_indices: tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class BasisTable:
    """Shape functions of an order: values [point][node], derivatives [point][node][direction].

    line: for cells that are products of lines, under a rule that is a product too. long: whether
    tables of the cell would be long, so that loops multiply what they need from those of the line.
    """

    order: int
    values: tuple[tuple[float, ...], ...]
    derivatives: tuple[tuple[tuple[float, ...], ...], ...]
    line: LineTable | None
    long: bool = False

    @property
    def nodes(self) -> int:
        """Number of shape functions."""
        return len(self.values[0])

    def texts(self, name: str) -> dict[str, Callable[[], str]]:
        """Tables NAME_N<order>, NAME_D<order>, of products of lines also NAME_L<order>,
        NAME_M<order> (values and slopes of the line) and NAME_along<order>, by name.
        """
        writers: dict[str, Callable[[], str]] = {}

        def table(letter: str, values: Any) -> None:
            label = f"{name}_{letter}{self.order}"
            writers[label] = lambda: _array(label, values)

        table("N", self.values)
        if self.line is None:
            table("D", self.derivatives)
        else:
            line = self.line
            derivative_name = f"{name}_D{self.order}"
            writers[derivative_name] = lambda: _derivative_table(derivative_name, line)
            table("L", line.values)
            table("M", line.derivatives)
            label = f"{name}_along{self.order}"
            writers[label] = lambda: _whole_numbers(label, line.node_indices)
        return writers


@cache
def shape(order: int, cell: Element, rule: QuadratureRule) -> BasisTable:
    """Shape functions of a cell at the points of a rule."""
    line = _line(cell, rule)
    if cell.lines is not None and line is not None:
        return BasisTable(order, *_products(line, cell.dimension), line, long=True)
    values, derivatives = _evaluated(cell.shape, cell.gradient, rule.points, cell.dimension)
    return BasisTable(order, values, derivatives, line)


def constant(points: int, dimension: int) -> BasisTable:
    """Shape function of a field that is constant in the cell."""
    return BasisTable(0, ((1.0,),) * points, (((0.0,) * dimension,),) * points, None)


def _evaluated(
    function: Any, gradient: Any, points: Sequence[Sequence[Any]], dimension: int
) -> tuple[Any, Any]:
    at = sp.symbols(f"x:{dimension}", real=True)
    N = [sp.sympify(v) for v in function(*at)]
    flat = [*N, *(v for row in gradient(*at) for v in row)]
    compiled = sp.lambdify(at, flat, "mpmath")
    values, derivatives = [], []
    with mpmath.workdps(DIGITS):
        for p in points:
            numbers = [float(v) for v in compiled(*(mpmath.mpf(sp.N(x, DIGITS)) for x in p))]
            values.append(tuple(numbers[: len(N)]))
            flat_derivatives = numbers[len(N) :]
            starts = range(0, len(flat_derivatives), dimension)
            derivatives.append(tuple(tuple(flat_derivatives[k : k + dimension]) for k in starts))
    return tuple(values), tuple(derivatives)


def _line(cell: Element, rule: QuadratureRule) -> LineTable | None:
    """The line that a cell of all products is made of, with the points of the rule along it."""
    sides = sorted({c for node in cell.nodes for c in node}, key=lambda c: (abs(c) != 1, c))
    count = round(len(rule.points) ** (1 / cell.dimension))
    of_lines = len(cell.nodes) == len(sides) ** cell.dimension and -1 in sides
    if not of_lines or count**cell.dimension != len(rule.points):
        return None
    along = [p[-1] for p in rule.points[:count]]
    grid = [rule.points[k][0] for k in range(0, len(rule.points), count ** (cell.dimension - 1))]
    if along != grid:
        return None
    number_of = {c: k for k, c in enumerate(sides)}
    node_indices = tuple(tuple(number_of[c] for c in node) for node in cell.nodes)

    def lagrange(x: Any) -> list[Any]:
        return [
            sp.prod([(x - b) / (a - b) for b in sides if b != a]) if len(sides) > 1 else 1
            for a in sides
        ]

    def slope(x: Any) -> list[Any]:
        return [(sp.diff(v, x),) for v in lagrange(x)]

    values, derivatives = _evaluated(lagrange, slope, [(x,) for x in along], 1)
    return LineTable(values, tuple(tuple(s for (s,) in row) for row in derivatives), node_indices)


def _products(line: LineTable, dimension: int) -> tuple[Any, Any]:
    """Values and derivatives of the products of a line's shape functions."""
    values, derivatives = [], []
    for point in product(range(len(line.values)), repeat=dimension):
        directions = (-1, *range(dimension))  # -1: the value
        pairs = [(line.values[q], line.derivatives[q]) for q in point]
        rows = [
            [prod(pairs[k][k == by][a] for k, a in enumerate(node)) for by in directions]
            for node in line.node_indices
        ]
        values.append(tuple(row[0] for row in rows))
        derivatives.append(tuple(tuple(row[1:]) for row in rows))
    return tuple(values), tuple(derivatives)


def _derivative_table(name: str, line: LineTable) -> str:
    """Table NAME of derivatives [point][node][direction] of products; the C compiler multiplies.

    For a cell of 27 nodes that is a twentieth of the text of the numbers.
    """
    D = len(line.node_indices[0])
    lines = []
    for letter, rows in (("L", line.values), ("M", line.derivatives)):
        for point, row in enumerate(rows):
            lines += [f"#define {name}_{letter}{point}{a} {number(v)}" for a, v in enumerate(row)]
    points, nodes = "ijk"[:D], "abc"[:D]
    derivatives = [
        " * ".join(f"{name}_{'M' if k == by else 'L'}##{points[k]}##{nodes[k]}" for k in range(D))
        for by in range(D)
    ]
    lines.append(f"#define {name}_node({', '.join(points + nodes)}) {{{', '.join(derivatives)}}}")
    arguments = ", ".join(points)
    terms = [
        f"    {name}_node({arguments}, {', '.join(map(str, node))})" for node in line.node_indices
    ]
    entries = ", \\\n".join(terms)
    lines.append(f"#define {name}_point({arguments}) {{ \\\n{entries}}}")
    every = product(range(len(line.values)), repeat=D)
    table = ",\n".join(f"{name}_point({', '.join(map(str, q))})" for q in every)
    size = f"[{len(line.values) ** D}][{len(line.node_indices)}][{D}]"
    return "\n".join([*lines, f"static const double {name}{size} = {{\n{table}}};\n"])


def weights(name: str, rule: QuadratureRule) -> str:
    """Table NAME_W of the weights of a rule."""
    return _array(f"{name}_W", [float(sp.N(w, DIGITS)) for w in rule.weights])


def pairs(name: str, first: LineTable, second: LineTable) -> str:
    """Table NAME of products along a line, [point][node of first][node of second][4].

    Value by value, value by slope, slope by value, slope by slope.
    """
    rows = [
        [
            [[p * r, p * s, d * r, d * s] for r, s in zip(b, db, strict=True)]
            for p, d in zip(a, da, strict=True)
        ]
        for a, da, b, db in zip(
            first.values, first.derivatives, second.values, second.derivatives, strict=True
        )
    ]
    return _array(name, rows)


def nodes(name: str, line: LineTable) -> str:
    """Table NAME of the node of every product of nodes along the directions."""
    size, D = len(line.values[0]), len(line.node_indices[0])
    at = {node: k for k, node in enumerate(line.node_indices)}
    order = [at[node] for node in product(range(size), repeat=D)]
    return f"static const int {name}[{size**D}] = {{{', '.join(map(str, order))}}};\n"


def _whole_numbers(name: str, rows: Sequence[Sequence[int]]) -> str:
    """A constant array of rows of whole numbers."""
    inside = ", ".join("{" + ", ".join(map(str, row)) + "}" for row in rows)
    return f"static const int {name}[{len(rows)}][{len(rows[0])}] = {{{inside}}};\n"


def _array(name: str, values: Any) -> str:
    """A constant array of C."""
    sizes, inner = "", values
    while not isinstance(inner, float):
        sizes += f"[{len(inner)}]"
        inner = inner[0]
    return f"static const double {name}{sizes} = {_braces(values)};\n"


def _braces(values: Any) -> str:
    if isinstance(values, float):
        return number(values)
    inner: Iterable[str] = map(_braces, values)
    joined = ", ".join(inner)
    if isinstance(values[0], float):
        return f"{{{joined}}}"
    return "{\n" + joined.replace("}, {", "},\n{") + "}"
