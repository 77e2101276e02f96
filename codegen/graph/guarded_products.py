"""Products and sums of derivatives in which nothing of a side that is not taken is evaluated.

An adjoint is zero where no branch that is taken uses its value, and the derivative that it is
multiplied by may be not-a-number there.  The product then stands inside the branch.
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from weakref import WeakKeyDictionary

from softehl.codegen.graph.graph import Graph, Node, Op
from softehl.codegen.graph.length_derivatives import square_of
from softehl.codegen.graph.traversal import Recursion, always, reachable, recursion
from softehl.codegen.graph.value_domain import EVERYWHERE, Domain

_SEEN_THROUGH = frozenset({Op.NEG, Op.NAME, Op.SUM, Op.ADD, Op.SUB, Op.MUL, Op.BRANCH})
"""Operations through which the zero of a side is seen."""


def guarded(g: Graph, a: Node, b: Node) -> Node:
    """Product inside a branch with a zero side: the side that is not taken is never evaluated."""
    for x, y in ((a, b), (b, a)):
        if x.op is Op.NEG and x.args[0].op is Op.BRANCH:
            return g.neg(guarded(g, x.args[0], y))
        if x.op is Op.BRANCH and g.zero in x.args[1:]:
            c, then, otherwise = x.args
            if square_of(x) is not None:  # a length stays whole: by it is differentiated again
                return g.mul(x, y) if exists(g, y) else g.branch(c, g.mul(x, y), g.zero)
            return g.branch(c, guarded(g, then, y), guarded(g, otherwise, y))
    return g.mul(a, b)


def exists(g: Graph, n: Node) -> bool:
    """True if a value is a number for all finite arguments (overflow apart)."""
    return _facts_of(g).domain.exists(n)


class Certain:
    """Values that every side of branches needs: where one is not-a-number, so are the roots."""

    def __init__(self, roots: Iterable[Node] = ()) -> None:
        self.nodes = frozenset(always(roots, conditions=False))
        self._bases = {n.args[0] for n in self.nodes if _is_root(n)}

    def covers(self, n: Node) -> bool:
        """True for these values and for powers of what one of them takes a root of."""
        return n in self.nodes or bool(n.op is Op.POW and n.args[0] in self._bases)


def _is_root(n: Node) -> bool:
    even = isinstance(n.payload, Fraction) and n.payload.denominator % 2 == 0
    return n.op is Op.SQRT or (n.op is Op.POW and even)


def shielded(g: Graph, seed: Node, partial: Node, certain: Certain) -> Node:
    """Product of an adjoint with a derivative of a value that not every side of branches needs.

    The zeros of sides may stand anywhere in the adjoint: in terms of different branches, in
    branches of branches, in sums over points.
    """
    facts = _facts_of(g)
    direct = seed.op is Op.BRANCH and g.zero in seed.args[1:]
    if direct or not recursion(facts.vanishes(seed)) or facts.exists(partial, certain):
        return guarded(g, seed, partial)
    return recursion(_product(g, facts, seed, partial))


def plus(g: Graph, a: Node, b: Node) -> Node:
    """Sum that joins two branches with a zero on the same side of the same condition."""
    if a.op is Op.BRANCH and b.op is Op.BRANCH and a.args[0] is b.args[0]:
        for k in (1, 2):
            if a.args[k] is g.zero and b.args[k] is g.zero:
                return g.branch(
                    a.args[0], plus(g, a.args[1], b.args[1]), plus(g, a.args[2], b.args[2])
                )
    return g.add(a, b)


def _product(g: Graph, facts: _Facts, x: Node, y: Node) -> Recursion[Node]:
    """x y, where y is evaluated only where a branch takes x."""
    if not (yield facts.vanishes(x)):
        return g.mul(x, y)
    match x.op:
        case Op.NEG:
            return g.neg((yield _product(g, facts, x.args[0], y)))
        case Op.BRANCH:
            c, then, otherwise = x.args
            inside = yield _product(g, facts, then, y)
            return g.branch(c, inside, (yield _product(g, facts, otherwise, y)))
        case Op.SUM if not y.varying:
            return g.sum((yield _product(g, facts, x.args[0], y)))
        case Op.ADD | Op.SUB if (yield facts.summed(x)):
            sides = []
            for a in x.args:
                sides.append((yield _product(g, facts, a, y)))
            left, right = sides
            return g.add(left, right) if x.op is Op.ADD else g.sub(left, right)
    active = yield facts.active(g, x)
    return g.mul(x, y) if active is None else g.branch(active, g.mul(x, y), g.zero)


class _Facts:
    """Facts about the values of one graph, memoised."""

    def __init__(self, g: Graph) -> None:
        self.domain = Domain(g)
        self._vanishing: dict[Node, bool] = {g.zero: True}
        self._summed: dict[Node, bool] = {}
        self._active: dict[Node, Node | None] = {g.zero: None}

    def exists(self, n: Node, certain: Certain) -> bool:
        """True if a value is a number wherever those that are certain are."""
        if self.domain.exists(n):
            return True
        inside = (m for m in reachable([n], stop=certain.covers) if not certain.covers(m))
        return all(not m.args or m.op in EVERYWHERE or self.domain.exists(m) for m in inside)

    def vanishes(self, n: Node) -> Recursion[bool]:
        """True if a value is an exact zero on some sides of branches."""
        if n not in self._vanishing:
            conditions = []
            for a in _parts(n):
                conditions.append((yield self.vanishes(a)))
            every = n.op in (Op.ADD, Op.SUB)
            self._vanishing[n] = bool(conditions) and (
                all(conditions) if every else any(conditions)
            )
        return self._vanishing[n]

    def summed(self, n: Node) -> Recursion[bool]:
        """True if a sum over points is among the terms and factors of a value."""
        if n not in self._summed:
            self._summed[n] = n.op is Op.SUM
            for a in _parts(n):
                self._summed[n] = (yield self.summed(a)) or self._summed[n]
        return self._summed[n]

    def active(self, g: Graph, n: Node) -> Recursion[Node | None]:
        """Condition under which branches take a value, None: always."""
        if n not in self._active:
            self._active[n] = None
            if (yield self.vanishes(n)) and n.op is not Op.SUM:
                sides = []
                for a in _parts(n):
                    sides.append((yield self.active(g, a)))
                self._active[n] = _combined(g, n, sides)
        return self._active[n]


def _parts(n: Node) -> tuple[Node, ...]:
    """Operands through which the zero of a side is seen."""
    if n.op not in _SEEN_THROUGH:
        return ()
    return n.args[1:] if n.op is Op.BRANCH else n.args


def _combined(g: Graph, n: Node, sides: list[Node | None]) -> Node | None:
    """Condition of a value from those of its parts."""
    if n.op is Op.BRANCH:
        c = n.args[0]
        if g.zero in n.args[1:]:
            k = n.args.index(g.zero, 1)
            side = c if k == 2 else g.node(Op.NOT, (c,))
            return _joined(g, Op.AND, side, sides[2 - k])
        then = _joined(g, Op.AND, c, sides[0])
        otherwise = _joined(g, Op.AND, g.node(Op.NOT, (c,)), sides[1])
        return None if sides == [None, None] else g.node(Op.OR, (then, otherwise))
    if len(sides) == 1:
        return sides[0]
    first, second = sides
    if n.op is Op.MUL:
        return second if first is None else _joined(g, Op.AND, first, second)
    return None if first is None or second is None else g.node(Op.OR, (first, second))


def _joined(g: Graph, op: Op, a: Node, b: Node | None) -> Node:
    return a if b is None or a is b else g.node(op, (a, b))


def _facts_of(g: Graph) -> _Facts:
    return _KNOWN.get(g) or _KNOWN.setdefault(g, _Facts(g))


_KNOWN: WeakKeyDictionary[Graph, _Facts] = WeakKeyDictionary()
