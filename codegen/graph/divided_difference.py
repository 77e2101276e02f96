"""Divided differences: (f(x) - f(x')) / gap on the graph, without a difference of close numbers.

Every operation has a rule that is exact for any distance of its operands (Kahan and Fateman 1999,
Reps and Rall 2003), e.g. uv - u'v' = u (v - v') + (u - u') v' and 1/u - 1/u' = -(u - u') / (u u').
So the result keeps its digits where x and x' are close, equal, or near a singularity of f.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from softehl.codegen.graph.graph import BOOLEAN, Graph, Node, Op, ResultIndex, Routine
from softehl.codegen.graph.guarded_products import guarded, plus
from softehl.codegen.graph.partial_derivatives import DifferentiationError
from softehl.codegen.graph.traversal import reachable

ROUNDING = Fraction(1, 2**48)
"""Eigenvalues that differ by less, relative to their sum, are equal but for their rounding."""


@dataclass(frozen=True, eq=False)
class Quotient(Routine):
    """(f(u) - f(v)) / (u - v) of a function of the C library; operands u, v, f(u), f(v).

    POWER has the exponent as a fifth operand. ATAN2 has two arguments, and operands y, x at both
    states, the two angles, y x' - x y' divided by the gap, and the gap; its result is the whole
    divided difference.
    """

    op: Op

    def divided(self, between: Divided, call: Node) -> list[Node]:
        """Divided difference of a quotient: first u moves, then v."""
        if self.op is Op.ATAN2:
            raise DifferentiationError("atan2 has no second divided difference; write atan(y / x)")
        g = between.g
        u, v, f_u, f_v, *exponent = call.args
        if any(between.other[e] is not e for e in exponent):
            raise DifferentiationError("the exponent of a power may not be an eigenvalue")
        u2, v2, g_u, g_v = (between.other[a] for a in (u, v, f_u, f_v))

        def twice(a: Node, b: Node, c: Node, values: Sequence[Node]) -> Node:
            at, other, fixed = values
            first = [(a, c, at, fixed), (b, c, other, fixed), (a, b, at, other)]
            quotients = [g.run(self, [*pair, *exponent])[0] for pair in first]
            return g.run(SECOND_QUOTIENTS[self.op], [a, b, c, *quotients, *exponent])[0]

        total = g.zero
        if between.rates[u] is not g.zero:
            total = guarded(g, between.rates[u], twice(u, u2, v, (f_u, g_u, f_v)))
        if between.rates[v] is not g.zero:
            moved = guarded(g, between.rates[v], twice(v, v2, u2, (f_v, g_v, g_u)))
            total = plus(g, total, moved)
        return [total]


@dataclass(frozen=True, eq=False)
class SecondQuotient(Routine):
    """Second divided difference f[u, v, w] of a function of the C library.

    Operands u, v, w, then f[u, w], f[v, w] and f[u, v]; POWER has the exponent as a seventh.
    """

    op: Op


QUOTIENTS = {
    op: Quotient(f"divided_{op}", {Op.POWER: 5, Op.ATAN2: 8}.get(op, 4), 1, op)
    for op in Op
    if op not in BOOLEAN
}
SECOND_QUOTIENTS: dict[Op, SecondQuotient] = {
    op: SecondQuotient(f"divided_twice_{op}", 6 + (op is Op.POWER), 1, op)
    for op in QUOTIENTS
    if op is not Op.ATAN2
}


@dataclass
class Divided:
    """Divided differences of values between a state and another one.

    other: the sources, and what each is at the other state; gap: what is divided by. rates: the
    divided differences of the sources.
    """

    g: Graph
    other: dict[Node, Node]
    gap: Node
    rates: dict[Node, Node]
    equal: Node | None = None
    symmetric: Callable[[Node], bool] = lambda _: False
    calls: dict[Node, list[Node]] = field(default_factory=dict)

    def __call__(self, root: Node) -> Node:
        for n in reachable([root], stop=self.rates.__contains__):
            if n in self.rates:
                continue
            if self.symmetric(n) or all(self.other[a] is a for a in n.args):
                self.other[n], self.rates[n] = n, self.g.zero
                continue
            args = tuple(self.other[a] for a in n.args)
            self.other[n] = self.g.rebuild(n.op, args, n.payload)
            if n.op not in BOOLEAN and n.op is not Op.CALL:
                self.rates[n] = self._rate(n)
            else:
                self.rates[n] = self.g.zero
        return self.rates[root]

    def _rate(self, n: Node) -> Node:
        g, (a, *operands) = self.g, n.args
        du = self.rates[a]
        match n.op:
            case Op.NAME:
                return du
            case Op.NEG:
                return g.neg(du)
            case Op.ADD:
                return plus(g, du, self.rates[operands[0]])
            case Op.SUB:
                return plus(g, du, g.neg(self.rates[operands[0]]))
            case Op.MUL:
                return self._product(a, operands[0])
            case Op.BRANCH:
                return self._branch(n)
            case Op.ITEM:
                return self._result(n)
            case Op.POWER:
                return self._power(n)
            case Op.ATAN2:
                return self._angle(n)
        return guarded(g, du, self._slope(n, a))

    def _product(self, a: Node, b: Node) -> Node:
        g = self.g
        if a is b:
            return guarded(g, self.rates[a], g.add(a, self.other[a]))
        left = guarded(g, self.rates[a], self.other[b])
        return plus(g, left, guarded(g, self.rates[b], a))

    def _slope(self, n: Node, a: Node) -> Node:
        """(f(u) - f(v)) / (u - v) of a function of one argument."""
        g, at, other = self.g, n, self.other[n]
        match n.op:
            case Op.RECIP:
                return g.neg(g.mul(at, other))
            case Op.SQRT:
                return g.recip(g.add(at, other))
            case Op.CBRT:
                return g.recip(self._squares(at, other))
            case Op.RCBRT:
                cube = g.power(g.mul(at, other), 3)
                return g.neg(g.div(cube, self._squares(at, other)))
            case Op.POW:
                return self._fixed_power(n, a)
        operands = (a, self.other[a], at, other)
        return g.run(QUOTIENTS[n.op], operands)[0]

    def _squares(self, a: Node, b: Node) -> Node:
        g = self.g
        return g.add(g.add(g.mul(a, a), g.mul(a, b)), g.mul(b, b))

    def _fixed_power(self, n: Node, a: Node) -> Node:
        """Powers that are products of roots by their factors, others as functions."""
        g, e = self.g, n.payload
        assert isinstance(e, Fraction)
        if e.denominator > 3:
            operands = (a, self.other[a], n, self.other[n], g.const(e))
            return g.run(QUOTIENTS[Op.POWER], operands)[0]
        root = {1: a, 2: g.call(Op.SQRT, a), 3: g.call(Op.CBRT, a)}[e.denominator]
        inside = Divided(g, {a: self.other[a]}, self.gap, {a: g.one})
        return inside(_inverted(g, _multiplied(g, root, abs(e.numerator)), e < 0))

    def _power(self, n: Node) -> Node:
        """First the base moves, then the exponent."""
        g, (a, e) = self.g, n.args
        b, f = self.other[a], self.other[e]
        between = g.general_power(b, e)
        base = g.run(QUOTIENTS[Op.POWER], (a, b, n, between, e))[0]
        total = guarded(g, self.rates[a], base)
        if e is f:
            return total
        log = g.call(Op.LOG, b)
        operands = (g.mul(e, log), g.mul(f, log), between, self.other[n])
        exponent = g.mul(log, g.run(QUOTIENTS[Op.EXP], operands)[0])
        return plus(g, total, guarded(g, self.rates[e], exponent))

    def _angle(self, n: Node) -> Node:
        g, (y, x) = self.g, n.args
        v, w = self.other[y], self.other[x]
        turned = g.sub(g.mul(self.rates[y], w), g.mul(self.rates[x], v))
        operands = (y, x, v, w, n, self.other[n], turned, self.gap)
        return g.run(QUOTIENTS[Op.ATAN2], operands)[0]

    def _branch(self, n: Node) -> Node:
        """The rule of one side where both states take it, else the difference of the values."""
        g, (c, a, b) = self.g, n.args
        then, otherwise = self.rates[a], self.rates[b]
        if self.other[c] is c or self.equal is None:
            return g.branch(c, then, otherwise)
        quotient = g.div(g.sub(n, self.other[n]), self.gap)
        first, second = (g.branch(self.equal, side, quotient) for side in (then, otherwise))
        other = self.other[c]
        return g.branch(c, g.branch(other, then, first), g.branch(other, second, otherwise))

    def _result(self, n: Node) -> Node:
        call, routine = n.args[0], n.args[0].payload
        assert isinstance(n.payload, ResultIndex)
        assert isinstance(routine, Routine)
        if call not in self.calls:
            try:
                self.calls[call] = routine.divided(self, call)
            except NotImplementedError:
                raise DifferentiationError(
                    f"{routine.name} has no divided difference: it may not be a function of an "
                    "eigenvalue"
                ) from None
        return self.calls[call][n.payload.index]

    def derivatives(
        self, values: Sequence[Node], other: Mapping[Node, Node]
    ) -> tuple[list[list[Node]], Node | None]:
        """Divided differences of values by each key of `other` alone.

        Also the condition under which they are right: all branches are taken as at the other state.
        """
        g, columns = self.g, []
        for s in other:
            rates = {t: g.one if t is s else g.zero for t in other}
            inside = Divided(g, dict(other), self.gap, rates)
            columns.append([inside(v) for v in values])
        same: Node | None = None
        for n in reachable(values, stop=other.__contains__):
            if n.op is Op.BRANCH and inside.other[n.args[0]] is not n.args[0]:
                c = n.args[0]
                pair = (c, inside.other[c])
                both = g.node(Op.AND, pair)
                none = g.node(Op.NOT, (g.node(Op.OR, pair),))
                alike = g.node(Op.OR, (both, none))
                same = alike if same is None else g.node(Op.AND, (same, alike))
        return [list(row) for row in zip(*columns, strict=True)], same


def _multiplied(g: Graph, a: Node, n: int) -> Node:
    if n == 1:
        return a
    half = _multiplied(g, a, n // 2)
    square = g.mul(half, half)
    return g.mul(square, a) if n % 2 else square


def _inverted(g: Graph, a: Node, negative: bool) -> Node:
    return g.recip(a) if negative else a


def nearly_equal(g: Graph, a: Node, b: Node) -> Node:
    """True if two values are equal but for their rounding."""
    gap, size = g.sub(a, b), g.add(g.mul(a, a), g.mul(b, b))
    bound = g.mul(g.const(2 * ROUNDING**2), size)
    return g.compare(Op.LE, g.mul(gap, gap), bound)


def exchange_inputs(g: Graph, values: Sequence[Node], a: Node, b: Node) -> Divided:
    """Divided differences by a - b between the state and that with `a` and `b` exchanged."""
    gap, total = g.sub(a, b), g.add(a, b)
    bound = g.mul(g.const(ROUNDING**2), g.mul(total, total))
    equal = g.compare(Op.LE, g.mul(gap, gap), bound)
    unchanged = _unchanged(values, {a: b, b: a})
    rates = {a: g.one, b: g.neg(g.one)}
    return Divided(g, {a: b, b: a}, gap, rates, equal, unchanged.__contains__)


def _unchanged(roots: Sequence[Node], swap: Mapping[Node, Node]) -> frozenset[Node]:
    """Values that an exchange of inputs leaves as they are, sums and products in any order."""
    numbers: dict[Any, int] = {}
    current, swapped = _Content(numbers, {}), _Content(numbers, swap)
    return frozenset(n for n in reachable(roots) if current(n) == swapped(n))


class _Content:
    """Number of a value: equal numbers for equal sums or products of equal values."""

    def __init__(self, numbers: dict[Any, int], swap: Mapping[Node, Node]) -> None:
        self.numbers, self.swap = numbers, swap
        self.numbered: dict[Node, int] = {}
        self.parts: dict[Node, Counter[int]] = {}

    def __call__(self, n: Node) -> int:
        """The number; those of the operands are known."""
        if n.op is Op.NAME:
            self.numbered[n] = self.numbered[n.args[0]]
            self.parts[n] = self.parts[n.args[0]]
            return self.numbered[n]
        if n.op in (Op.ADD, Op.SUB, Op.NEG):
            kind, parts = "sum", self._sum(n)
        elif n.op is Op.MUL:
            kind, parts = "product", self._parts(n.args[0], Op.MUL) + self._parts(n.args[1], Op.MUL)
        else:
            kind, parts = "", Counter()
        if kind:
            content: Any = (kind, tuple(sorted((k, c) for k, c in parts.items() if c)))
        elif n.args:
            content = (n.op, n.payload, tuple(self.numbered[a] for a in n.args))
        else:
            content = self.swap.get(n, n)
        self.numbered[n] = self.numbers.setdefault(content, len(self.numbers))
        self.parts[n] = parts
        return self.numbered[n]

    def _sum(self, n: Node) -> Counter[int]:
        total: Counter[int] = Counter()
        for k, a in enumerate(n.args):
            sign = -1 if n.op is Op.NEG or (n.op is Op.SUB and k) else 1
            for part, count in self._parts(a, Op.ADD).items():
                total[part] += sign * count
        return total

    def _parts(self, n: Node, op: Op) -> Counter[int]:
        inner = n
        while inner.op is Op.NAME:
            inner = inner.args[0]
        joined = (Op.MUL,) if op is Op.MUL else (Op.ADD, Op.SUB, Op.NEG)
        return self.parts[inner] if inner.op in joined else Counter({self.numbered[n]: 1})
