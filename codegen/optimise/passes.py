"""Named rewrites of a set of root nodes, and the trace of what each one bought.

Every pass maps roots to roots of the same value.  `STANDARD` is the order in which the compiler
runs them.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import mpmath

from softehl.codegen.external_function import ExternalFunction
from softehl.codegen.graph.graph import BOOLEAN, Graph, InputEntry, Node, Op, ResultIndex
from softehl.codegen.graph.precise_arithmetic import number
from softehl.codegen.graph.routines import External
from softehl.codegen.graph.run_time_arrays import Network
from softehl.codegen.graph.tensor_functions import lower
from softehl.codegen.graph.term_reductions import Entry, Reduction
from softehl.codegen.graph.traversal import (
    Recursion,
    always,
    operations,
    reachable,
    recursion,
    rewrite,
    written_out,
)
from softehl.codegen.optimise.common_sums import common_sums
from softehl.codegen.optimise.factoring import chain, factor, product, uses
from softehl.codegen.optimise.value_numbering import merge_equal_values

Roots = list[Node]


@dataclass(frozen=True)
class Pass:
    """A rewrite with the name it carries in the trace."""

    name: str
    apply: Callable[[Graph, Roots], Roots]


@dataclass(frozen=True)
class TraceRow:
    """State of the graph after a pass."""

    name: str
    nodes: int
    operations: int


def run(g: Graph, roots: Roots, passes: Sequence[Pass]) -> tuple[Roots, list[TraceRow]]:
    """Apply `passes` in order; the first row of the trace is the input."""
    trace = [_row("input", roots)]
    for p in passes:
        roots = p.apply(g, roots)
        trace.append(_row(p.name, roots))
    return roots, trace


def _row(name: str, roots: Roots) -> TraceRow:
    return TraceRow(name, len(reachable(roots)), operations(roots))


def fold(g: Graph, roots: Roots) -> Roots:
    """Drop names, fold exact constants, apply the identities of the constructors again."""

    def rule(g: Graph, n: Node, args: tuple[Node, ...]) -> Node:
        return args[0] if n.op is Op.NAME else g.rebuild(n.op, args, n.payload)

    return rewrite(g, roots, rule)


def calls(g: Graph, roots: Roots) -> Roots:
    """Values and derivatives by one call: of a C function, of a loop over terms, of a network.

    The results of a C function or network of a lower order are the first ones of a higher order; a
    loop has all results that are asked for.
    """
    roots = _loops(g, roots)
    highest: dict[tuple[ExternalFunction, tuple[Node, ...]], External] = {}
    networks = {(n.payload, n.args) for n in reachable(roots) if isinstance(n.payload, Network)}
    for n in reachable(roots):
        if isinstance(n.payload, External):
            key = n.payload.function, n.args
            if key not in highest or highest[key].order < n.payload.order:
                highest[key] = n.payload
    if not highest and not networks:
        return roots

    def rule(g: Graph, n: Node, args: tuple[Node, ...]) -> Node:
        payload = n.payload
        if isinstance(payload, External):
            payload = highest[payload.function, n.args]
        if isinstance(payload, Network) and (payload.higher, n.args) in networks:
            payload = payload.higher
        return g.rebuild(n.op, args, payload)

    return rewrite(g, roots, rule)


def _loops(g: Graph, roots: Roots) -> Roots:
    """One loop over terms for all results with the same operands."""
    entries_of_calls: dict[tuple[int, tuple[Node, ...]], dict[Entry, None]] = {}
    for n in reachable(roots):
        call = n.args[0] if n.op is Op.ITEM else n
        if isinstance(call.payload, Reduction) and isinstance(n.payload, ResultIndex):
            key = call.payload.root, call.args
            entries_of_calls.setdefault(key, {})[call.payload.entries[n.payload.index]] = None
    if not entries_of_calls:
        return roots
    together = {key: tuple(sorted(entries)) for key, entries in entries_of_calls.items()}

    def rule(g: Graph, n: Node, args: tuple[Node, ...]) -> Node:
        payload, call = n.payload, n.args[0] if n.op is Op.ITEM else n
        loop = call.payload
        if isinstance(loop, Reduction):
            entries = together.get((loop.root, call.args), loop.entries)
            if isinstance(payload, ResultIndex):
                payload = ResultIndex(entries.index(loop.entries[payload.index]))
            else:
                payload = loop.with_entries(entries)
        return g.rebuild(n.op, args, payload)

    return rewrite(g, roots, rule)


def powers(g: Graph, roots: Roots) -> Roots:
    """Powers as products, square roots and cube roots that share one reciprocal.

    x^(2/3) is x r^2 with r = x^(-1/3), which has no value at x = 0: there it is 0 by a branch,
    unless the kernel divides by x or takes its logarithm in any case.
    """
    inverted = {n.args[0] for n in always(roots) if _fails_at_zero(n)}

    def rule(g: Graph, n: Node, args: tuple[Node, ...]) -> Node:
        if n.op is not Op.POW:
            return g.rebuild(n.op, args, n.payload)
        e = n.payload
        assert isinstance(e, Fraction)
        if args[0] is g.zero:
            return g.rebuild(n.op, args, e) if e < 0 else g.zero
        value = _power(g, args[0], e)
        if e.denominator == 3 and e > 0 and n.args[0] not in inverted:
            return g.branch(g.compare(Op.EQ, args[0], g.zero), g.zero, value)
        return value

    return rewrite(g, roots, rule)


def _fails_at_zero(n: Node) -> bool:
    negative = isinstance(n.payload, Fraction) and n.op is Op.POW and n.payload < 0
    return negative or n.op in (Op.RECIP, Op.LOG)


def _power(g: Graph, a: Node, e: Fraction) -> Node:
    n = abs(e.numerator)
    match e.denominator, e < 0:
        case 1, negative:
            base = g.recip(a) if negative else a
        case 2, negative:
            base = g.call(Op.SQRT, g.recip(a) if negative else a)
        case 3, True:
            base = g.call(Op.RCBRT, a)
        case 3, False:  # one kind of root for both signs
            r = g.call(Op.RCBRT, a)
            base = g.mul(a, g.mul(r, r))
        case _:
            return g.power(a, e)
    return _integer_power(g, base, n)


def _integer_power(g: Graph, a: Node, n: int) -> Node:
    if n == 1:
        return a
    half = _integer_power(g, a, n // 2)
    square = g.mul(half, half)
    return g.mul(square, a) if n % 2 else square


def invariants_first(g: Graph, roots: Roots) -> Roots:
    """Reorder products: constants, then what does not vary with the point, then the rest."""
    counted = uses(roots)
    new: dict[Node, Node] = {}
    for n in reachable(roots):
        if n.op is Op.MUL:
            factors = [new[f] for f in chain(n, (Op.MUL,), counted)]
            new[n] = product(g, factors)
        else:
            new[n] = g.rebuild(n.op, tuple(new[a] for a in n.args), n.payload)
    return [new[r] for r in roots]


def inverses(g: Graph, roots: Roots) -> Roots:
    """1/x next to x^(-1/3) is its third power: two multiplications for a division.

    A negative x has no such root.  Only roots that are taken whichever way branches go count:
    where they have no value, neither has the kernel.
    """
    rooted = {n.args[0] for n in always(roots) if n.op is Op.RCBRT}

    def rule(g: Graph, n: Node, args: tuple[Node, ...]) -> Node:
        if n.op is Op.RECIP and n.args[0] in rooted:
            y = g.call(Op.RCBRT, args[0])
            return g.mul(y, g.mul(y, y))
        return g.rebuild(n.op, args, n.payload)

    return rewrite(g, roots, rule)


def assume(g: Graph, roots: Roots) -> Roots:
    """Inside one side of a branch its condition is known: drop inner branches on it."""
    memo: dict[tuple[Node, tuple[tuple[Node, bool], ...]], Node] = {}
    nodes = reachable(roots)
    conditions = _conditions_below(nodes)

    def visit(n: Node, assumed: tuple[tuple[Node, bool], ...]) -> Recursion[Node]:
        assumed = tuple(
            k for k in assumed if k[0] in conditions[n]
        )  # others decide nothing below it
        key = (n, assumed)
        if key not in memo:
            memo[key] = yield build(n, assumed)
        return memo[key]

    def build(n: Node, assumed: tuple[tuple[Node, bool], ...]) -> Recursion[Node]:
        if n.op is not Op.BRANCH:
            args = []
            for a in n.args:
                args.append((yield visit(a, assumed)))
            return g.rebuild(n.op, args, n.payload)
        c, then, otherwise = n.args
        for condition, holds in assumed:
            if condition is c:
                return (yield visit(then if holds else otherwise, assumed))
        order = tuple(sorted((*assumed, (c, True)), key=lambda k: k[0].id))
        negated = tuple(sorted((*assumed, (c, False)), key=lambda k: k[0].id))
        decides = yield visit(c, assumed)
        return g.branch(decides, (yield visit(then, order)), (yield visit(otherwise, negated)))

    if all(n.op is not Op.BRANCH for n in nodes):
        return roots
    for n in nodes:
        recursion(visit(n, ()))  # in ascending order, as every pass goes
    return [memo[r, ()] for r in roots]


def _conditions_below(nodes: Sequence[Node]) -> dict[Node, frozenset[Node]]:
    """Conditions of the branches at and below each node; operands come before their users."""
    conditions: dict[Node, frozenset[Node]] = {}
    for n in nodes:
        condition = frozenset(n.args[:1]) if n.op is Op.BRANCH else frozenset()
        conditions[n] = condition.union(*(conditions[a] for a in n.args))
    return conditions


def literals(g: Graph, roots: Roots) -> Roots:
    """Values that depend on no argument become numbers, correctly rounded at the last moment."""
    value: dict[Node, mpmath.mpf] = {}

    def rule(g: Graph, n: Node, args: tuple[Node, ...]) -> Node:
        constant = all(a.op is Op.CONST for a in args) and (bool(args) or n.op is Op.PI)
        if not constant or n.op in (Op.SUM, Op.BRANCH, Op.CALL) or n.op in BOOLEAN:
            return g.rebuild(n.op, args, n.payload)
        with mpmath.workdps(50):
            exact = [value.get(o, _exact(a)) for o, a in zip(n.args, args, strict=True)]
            result = _real(n, exact)
            if result is None:
                return g.node(n.op, args, n.payload)
            value[n] = result
            return g.const(Fraction(float(result)))

    return rewrite(g, roots, rule)


def _real(n: Node, args: Sequence[mpmath.mpf]) -> mpmath.mpf | None:
    """Value of an operation; None where that is no real number, on a side that is not taken."""
    try:
        result = number(n, args)
    except (ArithmeticError, ValueError):
        return None
    real = isinstance(result, mpmath.mpf) and mpmath.isfinite(result)
    return result if real and abs(result) <= sys.float_info.max else None


def _exact(n: Node) -> mpmath.mpf:
    return mpmath.mpf(n.value.numerator) / n.value.denominator


def unrolled(points: Sequence[Sequence[Fraction]], data: tuple[int, int] = (0, 0)) -> Pass:
    """Loops over the points written out; `points` holds (coordinates..., weight) of each.

    The coordinates are rationals good to far more digits than a double holds.  `data` are the
    numbers of data of the element and of one of its points.
    """

    def apply(g: Graph, roots: Roots) -> Roots:
        def leaf(n: Node, q: int) -> Node:
            assert isinstance(n.payload, InputEntry)
            if n.payload.array == "point data":
                return g.input("data", data[0] + data[1] * q + n.payload.index)
            return g.const(points[q][n.payload.index])

        return written_out(g, roots, len(points), leaf)

    return Pass("unroll", apply)


STANDARD = (
    Pass("tensor functions", lower),
    Pass("fold", fold),
    Pass("calls", calls),
    Pass("assume", assume),
    Pass("powers", powers),
    Pass("invariants first", invariants_first),
    Pass("common factors", factor),
    Pass("common sums", common_sums),
    Pass("common factors again", factor),
    Pass("literals", literals),
)


def straight_line(
    points: Sequence[Sequence[Fraction]], data: tuple[int, int] = (0, 0)
) -> tuple[Pass, ...]:
    """The passes of a kernel whose loop over the points is written out."""
    return (
        Pass("tensor functions", lower),
        Pass("fold", fold),
        Pass("calls", calls),
        Pass("assume", assume),
        Pass("powers", powers),
        Pass("common factors", factor),
        Pass("inverses of roots", inverses),
        unrolled(points, data),
        Pass("equal values", merge_equal_values),
        Pass("invariants first", invariants_first),
        Pass("common sums", common_sums),
        Pass("common factors again", factor),
        Pass("common sums again", common_sums),
        Pass("literals", literals),
    )
