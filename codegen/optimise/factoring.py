"""Products and sums of products: the order of factors, and common factors taken out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from heapq import heapify, heappop, heappush

from softehl.codegen.graph.graph import Graph, Node, Op
from softehl.codegen.graph.traversal import Recursion, reachable, recursion

LONG = 200
"""Terms of a sum whose partial sums are not looked at on their own."""


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
    ranked = sorted(factors, key=lambda f: (f.op is not Op.CONST, f.varying, f.id))
    result = g.one
    for f in ranked:
        result = g.mul(result, f)
    return result


def factor(g: Graph, roots: Sequence[Node]) -> list[Node]:
    """Common factors: a b + a c becomes a (b + c), the most frequent factor first."""
    counted = uses(roots)
    partial = _partial_sums(roots, counted)
    new: dict[Node, Node] = {}
    for n in reachable(roots):
        if n.op in (Op.ADD, Op.SUB) and n not in partial:
            terms = [(s, [new[f] for f in fs]) for s, fs in _terms(n, 1, counted)]
            shared = _Shared(terms).best() is not None
            new[n] = recursion(_factored(g, terms)) if shared else _as_it_was(g, n, new)
        else:
            new[n] = _as_it_was(g, n, new)
    return [new[r] for r in roots]


def _partial_sums(roots: Sequence[Node], counted: Counter[Node]) -> set[Node]:
    """Sums that are only a part of a long one."""
    length: dict[Node, int] = {}
    inner: dict[Node, Node] = {}
    nodes = [n for n in reachable(roots) if n.op in (Op.ADD, Op.SUB)]
    for n in nodes:
        length[n] = sum(length.get(a, 1) if counted[a] == 1 else 1 for a in n.args)
        inner.update((a, n) for a in n.args if a in length and counted[a] == 1)
    long: set[Node] = set()
    for n in reversed(nodes):
        if n in inner and (inner[n] in long or length[inner[n]] > LONG):
            long.add(n)
    return long


Term = tuple[int, list[Node]]


def _terms(n: Node, sign: int, counted: Counter[Node]) -> list[Term]:
    """Signed products whose sum is `n`."""
    out: list[Term] = []
    stack = _signed(n, sign)
    while stack:
        s, a = stack.pop()
        if a.op in (Op.ADD, Op.SUB) and counted[a] == 1:
            stack += _signed(a, s)
        elif a.op is Op.MUL and counted[a] == 1:
            out.append((s, chain(a, (Op.MUL,), counted)))
        else:
            out.append((s, [a]))
    return out


def _signed(n: Node, sign: int) -> list[tuple[int, Node]]:
    """The operands of a sum or difference with their signs, the last one first."""
    a, b = n.args
    return [(-sign if n.op is Op.SUB else sign, b), (sign, a)]


def _as_it_was(g: Graph, n: Node, new: dict[Node, Node]) -> Node:
    """Keep the order of a sum unless operations are saved: its order decides the rounding."""
    return g.rebuild(n.op, tuple(new[a] for a in n.args), n.payload)


class _Shared:
    """The factors that the terms of a sum share, while terms are taken away."""

    def __init__(self, terms: Sequence[Term]) -> None:
        self.terms = terms
        self.left = dict.fromkeys(range(len(terms)))
        self.where: dict[Node, list[int]] = {}
        for k, (_, factors) in enumerate(terms):
            for f in dict.fromkeys(factors):
                self.where.setdefault(f, []).append(k)
        self.count = {f: len(at) for f, at in self.where.items()}
        self.heap = [(-c, f.id, f) for f, c in self.count.items()]
        heapify(self.heap)

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
            for other in dict.fromkeys(self.terms[k][1]):
                self.count[other] -= 1
        return [self.terms[k] for k in rows]

    def remainder(self) -> list[Term]:
        """The terms that are left."""
        return [self.terms[k] for k in self.left]


def _factored(g: Graph, terms: Sequence[Term]) -> Recursion[Node]:
    shared = _Shared(terms)
    groups: list[Node] = []
    while (best := shared.best()) is not None:
        inside: list[Term] = []
        for s, factors in shared.take(best):
            others = list(factors)
            others.remove(best)
            inside.append((s, others or [g.one]))
        groups.append(g.mul(best, (yield _factored(g, inside))))
    result = _sum(g, [(s, product(g, factors)) for s, factors in shared.remainder()])
    for group in reversed(groups):
        result = g.add(result, group)
    return result


def _sum(g: Graph, terms: list[tuple[int, Node]]) -> Node:
    result = g.zero
    for s, n in sorted(terms, key=lambda t: (t[1].varying, -t[0])):
        result = g.add(result, n) if s > 0 else g.sub(result, n)
    return result
