"""Common partial sums: constant linear maps with few additions.

Unrolled quadrature, modal transforms and their transposes are linear maps with small constant
coefficients.  Each maximal sum is written as a signed sum of terms (constant times value), equal
constants are taken out, and the pair of terms that most sums share is computed once, again and
again (Paar's greedy algorithm for constant matrix multiplication).  For the 4-node quadrilateral
this finds the fast Walsh-Hadamard transform.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from softehl.codegen.graph.graph import Graph, Input, Node, Op
from softehl.codegen.graph.traverse import reachable
from softehl.codegen.optimise.pairs import Row, build, insert, share


def common_sums(g: Graph, roots: list[Node]) -> list[Node]:
    """Rewrite every maximal sum below `roots` through shared partial sums."""
    uses = Counter(roots)
    for n in reachable(roots):
        uses.update(n.args)
    plan = _Plan(g)
    new: dict[Node, Node] = {}
    inner = _inner_sums(roots, uses)
    for layer in _layers(roots, inner):
        for n in layer:
            if n.op in (Op.ADD, Op.SUB) and not first_difference(n):
                plan.add(n, _linear(g, n, inner, new))
            else:
                new[n] = g.rebuild(n.op, tuple(new[a] for a in n.args), n.payload)
        new.update(plan.solve())
    return [new[r] for r in roots]


def _inner_sums(roots: Sequence[Node], uses: Counter[Node]) -> set[Node]:
    """Sums, signs and constant multiples that only one other sum uses: part of that sum."""
    inner: set[Node] = set()
    for n in reversed(reachable(roots)):
        if n.op in (Op.ADD, Op.SUB) or n in inner:
            inner.update(a for a in n.args if uses[a] == 1 and _linear_node(a))
    return inner


def _scaled(n: Node) -> bool:
    return n.op is Op.MUL and n.args[0].op is Op.CONST


def _linear_node(n: Node) -> bool:
    return (n.op in (Op.ADD, Op.SUB, Op.NEG) or _scaled(n)) and not first_difference(n)


def first_difference(n: Node) -> bool:
    """Two arguments of different kinds, e.g. the radius of a node minus that of the rod.

    It is taken first, as the model says: this is where digits would be lost.
    """
    arrays = {a.payload.array for a in n.args if isinstance(a.payload, Input)}
    return len(arrays) == 2


def _layers(roots: Sequence[Node], inner: set[Node]) -> list[list[Node]]:
    """Nodes outside of sums, by the number of sums below them: one layer is solved together."""
    depth: dict[Node, int] = {}
    layers: dict[int, list[Node]] = {}
    for n in reachable(roots):
        below = max((depth[a] for a in n.args), default=0)
        outer = n not in inner and n.op in (Op.ADD, Op.SUB) and not first_difference(n)
        depth[n] = below + (1 if outer else 0)
        if n not in inner:
            # A layer starts with what its sums need and ends with the sums themselves.
            layers.setdefault(2 * depth[n] - (1 if outer else 0), []).append(n)
    return [layers[k] for k in sorted(layers)]


def _linear(g: Graph, n: Node, inner: set[Node], new: dict[Node, Node]) -> dict[Node, Fraction]:
    """Coefficients of a maximal sum over its terms; all constants are one term, times +1 or -1."""
    out: dict[Node, Fraction] = {}

    stack = [(n, Fraction(1))]
    while stack:
        m, c = stack.pop()
        if m is not n and m not in inner:
            value = new[m]
            while value.op is Op.NEG or _scaled(value):
                c, value = (
                    (-c, value.args[0])
                    if value.op is Op.NEG
                    else (c * value.args[0].value, value.args[1])
                )
            if value.op is Op.CONST:
                c, value = c * value.value, g.one
            out[value] = out.get(value, Fraction(0)) + c
        elif _scaled(m):
            stack.append((m.args[1], c * m.args[0].value))
        elif m.op is Op.NEG:
            stack.append((m.args[0], -c))
        else:
            stack.append((m.args[1], -c if m.op is Op.SUB else c))
            stack.append((m.args[0], c))
    constant = out.pop(g.one, Fraction(0))
    if constant:
        out[g.const(abs(constant))] = Fraction(1 if constant > 0 else -1)
    return {v: c for v, c in out.items() if c}


@dataclass
class _Plan:
    """The sums of one layer."""

    g: Graph
    rows: list[Row] = field(default_factory=list)
    pieces: dict[Node, list[tuple[Fraction, int]]] = field(default_factory=dict)

    def add(self, n: Node, terms: dict[Node, Fraction]) -> None:
        """Split a sum by the magnitude of its coefficients into signed sums."""
        by_size: dict[Fraction, Row] = {}
        for value, c in terms.items():
            by_size.setdefault(abs(c), {})[value] = 1 if c > 0 else -1
        pieces = []
        rest: Row = {}
        for size, row in by_size.items():
            if len(row) == 1 or len(by_size) == 1:
                scale = Fraction(1) if len(by_size) > 1 else size
                one = (
                    row
                    if scale == size
                    else {self.g.mul(self.g.const(size), v): s for v, s in row.items()}
                )
                if len(by_size) == 1:
                    pieces.append((size, self._row(one)))
                else:
                    for value, sign in one.items():
                        insert(self.g, rest, value, sign)
            else:
                pieces.append((size, self._row(row)))
        if rest:
            pieces.append((Fraction(1), self._row(rest)))
        self.pieces[n] = pieces

    def _row(self, row: Row) -> int:
        self.rows.append(row)
        return len(self.rows) - 1

    def solve(self) -> dict[Node, Node]:
        """Values of the sums that were added."""
        share(self.g, self.rows)
        values = [build(self.g, row) for row in self.rows]
        out: dict[Node, Node] = {}
        for n, pieces in self.pieces.items():
            total = self.g.zero
            for size, k in pieces:
                total = self.g.add(total, self.g.mul(self.g.const(size), values[k]))
            out[n] = total
        self.rows, self.pieces = [], {}
        return out
