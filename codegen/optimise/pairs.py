"""The pair of terms that most signed sums share, computed once, again and again.

Counts are kept while rows change, and a heap holds the candidates: a row of n terms that others
share costs n^2 / 2 counts once.  Of rows so long that this matters, terms that stand in the same
rows are summed first; what is longer still is left as it is.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from heapq import heappop, heappush
from itertools import combinations

from softehl.codegen.graph.graph import Graph, Node, Op

Row = dict[Node, int]
"""A signed sum: term -> +1 or -1."""
Pair = tuple[int, int, int]
"""Ids of two terms, the smaller first, and the sign of the second relative to the first."""

LONG = 200
"""Shared terms of a row whose pairs are not all counted."""


def share(g: Graph, rows: Sequence[Row]) -> None:
    """Replace the most frequent pair of terms by one value until no pair is shared."""
    at = _places(rows)
    if any(sum(len(at[n]) > 1 for n in row) > LONG for row in rows):
        _bundle(g, rows, at)
        at = _places(rows)
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


def _places(rows: Sequence[Row]) -> dict[Node, set[int]]:
    """The rows in which each term stands."""
    at: dict[Node, set[int]] = {}
    for k, row in enumerate(rows):
        for n in row:
            at.setdefault(n, set()).add(k)
    return at


def _bundle(g: Graph, rows: Sequence[Row], at: dict[Node, set[int]]) -> None:
    """Sum the terms that stand in the same rows with the same signs relative to each other."""
    groups: dict[tuple[tuple[int, int], ...], list[Node]] = {}
    for n, places in at.items():
        if len(places) > 1:
            order = sorted(places)
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
        self.heap: list[tuple[int, int, int, int]] = []
        self.long = {k for k, row in enumerate(rows) if len(self._shared(row)) > LONG}
        for k, row in enumerate(rows):
            self._note(k, combinations(sorted(self._shared(row), key=lambda n: n.id), 2))

    def _shared(self, row: Row) -> list[Node]:
        """Terms of other rows, too: only these can make a pair that two rows have."""
        return [n for n in row if len(self.at[n]) > 1]

    def _pair(self, k: int, a: Node, b: Node) -> Pair:
        i, j = (a, b) if a.id < b.id else (b, a)
        return i.id, j.id, self.rows[k][i] * self.rows[k][j]

    def _note(self, k: int, pairs: Iterable[tuple[Node, Node]]) -> None:
        if k in self.long:
            return
        for a, b in pairs:
            p = self._pair(k, a, b)
            rows = self.where.setdefault(p, set())
            rows.add(k)
            if len(rows) > 1:
                heappush(self.heap, (-len(rows), p[1], p[0], -p[2]))

    def best(self) -> Pair | None:
        """The pair of most rows, of equal ones the first; None where no two rows share one."""
        while self.heap:
            count, j, i, sign = heappop(self.heap)
            p = (i, j, -sign)
            if len(self.where[p]) == -count:
                return p
            if len(self.where[p]) > 1:
                heappush(self.heap, (-len(self.where[p]), j, i, sign))
        return None

    def replace(self, pair: Pair) -> None:
        """One value for a pair of terms, in all rows that have it."""
        a, b = self.nodes[pair[0]], self.nodes[pair[1]]
        value, lead = _unsigned(self.g.add(a, b) if pair[2] > 0 else self.g.sub(a, b))
        for k in sorted(self.where[pair]):
            row = self.rows[k]
            sign = row[a] * lead
            self._remove(k, a)
            self._remove(k, b)
            before = value
            while row.get(before) == sign:
                self._remove(k, before)
                before = self.g.mul(self.g.const(2), before)
            if before in row:
                self._remove(k, before)
            else:
                self._add(k, before, sign)

    def _remove(self, k: int, n: Node) -> None:
        row = self.rows[k]
        for other in row:
            if other is not n:
                self.where.get(self._pair(k, n, other), set()).discard(k)
        row.pop(n)
        self.at[n].discard(k)

    def _add(self, k: int, n: Node, sign: int) -> None:
        row, places = self.rows[k], self.at.setdefault(n, set())
        self.nodes[n.id] = n
        row[n] = sign
        places.add(k)
        if len(places) == 2:  # noted nowhere while it stood in one row
            (first,) = places - {k}
            self._note(first, ((n, m) for m in self._shared(self.rows[first]) if m is not n))
        if len(places) > 1:
            self._note(k, ((n, m) for m in self._shared(row) if m is not n))
