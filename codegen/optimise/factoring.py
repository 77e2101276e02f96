"""Products and sums of products: the order of factors, and common factors taken out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from heapq import heapify, heappop, heappush
from itertools import chain as joined

from softehl.codegen.graph.graph import Graph, Node, Op
from softehl.codegen.graph.traversal import Recursion, reachable, recursion

LONG = 200
"""Terms of a sum whose partial sums are not looked at on their own."""


_SUMS = (Op.ADD, Op.SUB)
_MUL, _CONST, _SUB = Op.MUL, Op.CONST, Op.SUB


def uses(roots: Sequence[Node]) -> Counter[Node]:
    counted = Counter(roots)
    for n in reachable(roots):
        counted.update(n.args)
    return counted


def chain(n: Node, ops: tuple[Op, ...], counted: Counter[Node]) -> list[Node]:
    """Operands of a chain of `ops` whose inner results have no other use."""
    out: list[Node] = []
    stack = [*reversed(n.args)]
    while stack:
        a = stack.pop()
        if a.op in ops and counted[a] == 1:
            stack += reversed(a.args)
        else:
            out.append(a)
    return out


def product(g: Graph, factors: list[Node]) -> Node:
    if len(factors) == 1:
        return factors[0]
    ranked = sorted(factors, key=lambda f: (f.op is not _CONST, f.varying, f.id))
    result = g.one
    for f in ranked:
        result = g.mul(result, f)
    return result


def factor(g: Graph, roots: Sequence[Node]) -> list[Node]:
    """Common factors: a b + a c becomes a (b + c), the most frequent factor first."""
    counted = uses(roots)
    partial = _partial_sums(roots, counted)
    factored = _Factored(g)
    new: dict[Node, Node] = {}
    inner: dict[Node, list[Term]] = {}
    for n in reachable(roots):
        if n.op in _SUMS and n not in partial:
            terms = _terms(n, counted, new, inner)
            shared = _Shared(terms)
            if shared.best() is None:
                new[n] = _as_it_was(g, n, new)
            else:
                new[n] = recursion(factored.of(shared))
            if counted[n] == 1:
                inner[n] = terms
        else:
            new[n] = _as_it_was(g, n, new)
    return [new[r] for r in roots]


def _partial_sums(roots: Sequence[Node], counted: Counter[Node]) -> set[Node]:
    """Sums that are only a part of a long one."""
    length: dict[Node, int] = {}
    inner: dict[Node, Node] = {}
    nodes = [n for n in reachable(roots) if n.op in _SUMS]
    for n in nodes:
        length[n] = sum(length.get(a, 1) if counted[a] == 1 else 1 for a in n.args)
        inner.update((a, n) for a in n.args if a in length and counted[a] == 1)
    long: set[Node] = set()
    for n in reversed(nodes):
        if n in inner and (inner[n] in long or length[inner[n]] > LONG):
            long.add(n)
    return long


Term = tuple[int, list[Node]]


def _terms(
    n: Node, counted: Counter[Node], new: dict[Node, Node], inner: dict[Node, list[Term]]
) -> list[Term]:
    """Signed products of new nodes whose sum is `n`.

    inner: those of sums that may be a part of it; they are taken out, for they have no other use.
    """
    out: list[Term] = []
    stack = _signed(n, 1)
    while stack:
        s, a = stack.pop()
        known = inner.pop(a, None)
        if known is not None:
            out += known if s > 0 else [(-t, factors) for t, factors in known]
        elif counted[a] > 1:
            out.append((s, [new[a]]))
        elif a.op in _SUMS:
            stack += _signed(a, s)
        elif a.op is _MUL:
            out.append((s, [new[f] for f in chain(a, (_MUL,), counted)]))
        else:
            out.append((s, [new[a]]))
    return out


def _signed(n: Node, sign: int) -> list[tuple[int, Node]]:
    """The operands of a sum or difference with their signs, the last one first."""
    a, b = n.args
    return [(-sign if n.op is _SUB else sign, b), (sign, a)]


def _as_it_was(g: Graph, n: Node, new: dict[Node, Node]) -> Node:
    """Keep the order of a sum unless operations are saved: its order decides the rounding."""
    return g.rebuild(n.op, tuple(new[a] for a in n.args), n.payload)


class _Shared:
    """The factors that the terms of a sum share, while terms are taken away."""

    def __init__(self, terms: Sequence[Term]) -> None:
        self.terms = terms
        self.factors = [fs if len(fs) == 1 else list(dict.fromkeys(fs)) for _, fs in terms]
        counted = Counter(joined.from_iterable(self.factors))
        self.count = {f: c for f, c in counted.items() if c > 1}
        self.where: dict[Node, list[int]] = {f: [] for f in self.count}
        self.left = dict.fromkeys(range(len(terms)))
        self.heap = [(-c, f.id, f) for f, c in self.count.items()]
        if self.heap:
            heapify(self.heap)
            for k, factors in enumerate(self.factors):
                for f in factors:
                    if f in self.where:
                        self.where[f].append(k)

    def best(self) -> Node | None:
        """The factor of most terms that are left, None where no two of them share one."""
        while self.heap:
            count, _, f = self.heap[0]
            if -count == self.count[f]:
                return f if -count > 1 and f.payload != 1 else None
            heappop(self.heap)
            heappush(self.heap, (-self.count[f], f.id, f))
        return None

    def take(self, f: Node) -> list[Term]:
        """Take away the terms that have a factor."""
        rows = [k for k in self.where[f] if k in self.left]
        for k in rows:
            del self.left[k]
            for other in self.factors[k]:
                if other in self.count:
                    self.count[other] -= 1
        return [self.terms[k] for k in rows]

    def remainder(self) -> list[Term]:
        """The terms that are left."""
        return [self.terms[k] for k in self.left]


class _Factored:
    """Sums with their common factors taken out; partial sums meet the same groups of terms."""

    def __init__(self, g: Graph) -> None:
        self.g = g
        self.known: dict[tuple[tuple[int, tuple[Node, ...]], ...], Node] = {}

    def of(self, shared: _Shared) -> Recursion[Node]:
        """The sum of the terms."""
        g = self.g
        groups: list[Node] = []
        while (best := shared.best()) is not None:
            inside: list[Term] = []
            for s, factors in shared.take(best):
                others = list(factors)
                others.remove(best)
                inside.append((s, others or [g.one]))
            key = tuple([(s, tuple(factors)) for s, factors in inside])
            value = self.known.get(key)
            if value is None:
                value = self.known[key] = yield self.of(_Shared(inside))
            groups.append(g.mul(best, value))
        result = _sum(g, [(s, product(g, factors)) for s, factors in shared.remainder()])
        for group in reversed(groups):
            result = g.add(result, group)
        return result


def _sum(g: Graph, terms: list[tuple[int, Node]]) -> Node:
    result = g.zero
    for s, n in sorted(terms, key=lambda t: (t[1].varying, -t[0])):
        result = g.add(result, n) if s > 0 else g.sub(result, n)
    return result
