"""Common partial sums: constant linear maps with few additions.

Unrolled quadrature, modal transforms and their transposes are linear maps with small constant
coefficients.  Each maximal sum is written as a signed sum of terms (constant times value), equal
constants are taken out, and the pair of terms that most sums share is computed once, again and
again (Paar's greedy algorithm for constant matrix multiplication).  For the 4-node quadrilateral
this finds the fast Walsh-Hadamard transform.

Counts of pairs are kept while rows change, and a heap holds the candidates: a row of n terms that
others share costs n^2 / 2 counts once.  Of longer rows, terms that stand in the same rows are
summed first; what is longer still stays.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from heapq import heappop, heappush

from softehl.codegen.graph.graph import Graph, InputEntry, Node, Op
from softehl.codegen.graph.traversal import reachable

Row = dict[Node, int]
"""A signed sum: term -> +1 or -1."""
Pair = int
"""Ids of two terms in one number, the larger first; its last bit is 1 where the signs differ.

A number is counted and compared in a fraction of the time of a tuple.
"""
WIDTH = 32
"""Bits of an id."""
ABOVE = 2 * WIDTH + 1
"""Bits of a pair: candidates have minus the number of its rows above them."""

LONG = 200
"""Shared terms of a row whose pairs are not all counted."""


def share(g: Graph, rows: Sequence[Row]) -> None:
    """Replace the most frequent pair of terms by one value until no pair is shared."""
    at = _rows_with(rows)
    if any(sum(len(at[n]) > 1 for n in row) > LONG for row in rows):
        _bundle(g, rows, at)
        at = _rows_with(rows)
    table = _Pairs(g, rows, at)
    while (pair := table.best()) is not None:
        table.replace(pair)


def build(g: Graph, row: Row) -> Node:
    """A signed sum as a node."""
    total = g.zero
    for n, s in sorted(row.items(), key=lambda t: (t[0].varying, -t[1], t[0].id)):
        total = g.add(total, n) if s > 0 else g.sub(total, n)
    return total


def insert(g: Graph, row: Row, value: Node, sign: int) -> None:
    """Add a term to a signed sum; equal terms combine."""
    while row.get(value) == sign:
        row.pop(value)
        value = g.mul(g.const(2), value)
    if value in row:
        row.pop(value)
    else:
        row[value] = sign


def _rows_with(rows: Sequence[Row]) -> dict[Node, set[int]]:
    """Rows that contain each term."""
    at: dict[Node, set[int]] = {}
    for k, row in enumerate(rows):
        for n in row:
            at.setdefault(n, set()).add(k)
    return at


def _bundle(g: Graph, rows: Sequence[Row], at: dict[Node, set[int]]) -> None:
    """Sum the terms that occur in the same rows with the same relative signs."""
    groups: dict[tuple[tuple[int, int], ...], list[Node]] = {}
    for n, rows_with in at.items():
        if len(rows_with) > 1:
            order = sorted(rows_with)
            lead = rows[order[0]][n]
            groups.setdefault(tuple((k, rows[k][n] * lead) for k in order), []).append(n)
    for key, nodes in groups.items():
        if len(nodes) > 1:
            first = rows[key[0][0]]
            value, sign = _unsigned(build(g, {n: first[n] for n in nodes}))
            for k, s in key:
                for n in nodes:
                    rows[k].pop(n)
                insert(g, rows[k], value, s * sign)


def _unsigned(value: Node) -> tuple[Node, int]:
    return (value.args[0], -1) if value.op is Op.NEG else (value, 1)


class _Pairs:
    """Numbers of rows that share each pair of terms."""

    def __init__(self, g: Graph, rows: Sequence[Row], at: dict[Node, set[int]]) -> None:
        self.g, self.rows, self.at = g, rows, at
        self.nodes = {n.id: n for n in at}
        self.where: dict[Pair, set[int]] = {}
        self.heap: list[int] = []
        shared = [self._shared(row) for row in rows]
        self.long = {k for k, terms in enumerate(shared) if len(terms) > LONG}
        for k, terms in enumerate(shared):
            for first, n in enumerate(terms, 1):
                self._note(k, n, terms[first:])

    def _shared(self, row: Row) -> list[Node]:
        """Terms of other rows, too: only these can make a pair that two rows have."""
        at = self.at
        return [n for n in row if len(at[n]) > 1]

    def _note(self, k: int, n: Node, others: Sequence[Node]) -> None:
        if k in self.long:
            return
        row, where, heap = self.rows[k], self.where, self.heap
        sign, i = row[n], n.id
        for m in others:
            j = m.id
            low, high = (i, j) if i < j else (j, i)
            pair = (high << WIDTH | low) << 1 | (row[m] != sign)
            rows = where.get(pair)
            if rows is None:
                where[pair] = {k}
                continue
            rows.add(k)
            if len(rows) > 1:
                heappush(heap, pair - (len(rows) << ABOVE))

    def best(self) -> Pair | None:
        """The pair of most rows, of equal ones the first; None where no two rows share one."""
        while self.heap:
            entry = heappop(self.heap)
            pair = entry & (1 << ABOVE) - 1
            count = len(self.where[pair])
            if count == -(entry >> ABOVE):
                return pair
            if count > 1:
                heappush(self.heap, pair - (count << ABOVE))
        return None

    def replace(self, pair: Pair) -> None:
        """One value for a pair of terms, in all rows that have it."""
        a = self.nodes[pair >> 1 & (1 << WIDTH) - 1]
        b = self.nodes[pair >> WIDTH + 1]
        value, lead = _unsigned(self.g.sub(a, b) if pair & 1 else self.g.add(a, b))
        for k in sorted(self.where[pair]):
            row = self.rows[k]
            sign = row[a] * lead
            self._remove(k, a)
            self._remove(k, b)
            previous = value
            while row.get(previous) == sign:
                self._remove(k, previous)
                previous = self.g.mul(self.g.const(2), previous)
            if previous in row:
                self._remove(k, previous)
            else:
                self._add(k, previous, sign)

    def _remove(self, k: int, n: Node) -> None:
        row, where = self.rows[k], self.where
        sign, i = row.pop(n), n.id
        self.at[n].discard(k)
        if k in self.long:
            return
        for m, other in row.items():
            j = m.id
            low, high = (i, j) if i < j else (j, i)
            rows = where.get((high << WIDTH | low) << 1 | (other != sign))
            if rows is not None:
                rows.discard(k)

    def _add(self, k: int, n: Node, sign: int) -> None:
        row, rows_with = self.rows[k], self.at.setdefault(n, set())
        self.nodes[n.id] = n
        row[n] = sign
        rows_with.add(k)
        if len(rows_with) == 2:  # noted nowhere while it stood in one row
            (first,) = rows_with - {k}
            self._note(first, n, [m for m in self._shared(self.rows[first]) if m is not n])
        if len(rows_with) > 1:
            self._note(k, n, [m for m in self._shared(row) if m is not n])


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
    arrays = {a.payload.array for a in n.args if isinstance(a.payload, InputEntry)}
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
        remainder: Row = {}
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
                        insert(self.g, remainder, value, sign)
            else:
                pieces.append((size, self._row(row)))
        if remainder:
            pieces.append((Fraction(1), self._row(remainder)))
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
