"""Loops of a device that add B' S B of elements to a sparse matrix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from softehl.codegen.emit.device.block_sizes import BlockSizes, Nodal, node_of, nodes_of
from softehl.codegen.emit.points.btab import Parent
from softehl.codegen.emit.points.c_lines import Lines


@dataclass(frozen=True, eq=False)
class AssemblyLoops:
    """Loops that add the entries of two fields of an order each.

    each: elements at a time. slice_points: points of an element at a time.
    """

    sizes: BlockSizes
    parent: Parent
    out: Lines
    fields: Sequence[Nodal]
    row: Nodal
    column: Nodal
    each: int
    slice_points: int

    @cached_property
    def k(self) -> tuple[int, int]:
        """Nodes of rows and of columns."""
        return self.row.n**self.sizes.D, self.column.n**self.sizes.D

    @cached_property
    def parts(self) -> int:
        """Threads that share the rows of a column."""
        (k, width), count = self.k, self.row.count
        all_columns = self.column.count * width * self.each
        parts = max(1, min(k, self.sizes.threads // all_columns, -(-count * k // 24)))
        return max(parts, -(-count * k // 96))

    @cached_property
    def rows(self) -> int:
        """Nodes of the rows of a thread."""
        return -(-self.k[0] // self.parts)

    @property
    def columns(self) -> int:
        """Columns of all elements, as often as they have parts."""
        return self.column.count * self.each * self.k[1] * self.parts

    def write(self) -> None:
        """Write the loops, if any entry can differ from zero."""
        out, g, each, points = self.out, self.sizes, self.each, self.sizes.points
        if not any(self._half(j) for j in range(self.column.first, self.column.last)):
            return
        rounds, entries = -(-self.columns // g.threads), self.row.count * self.rows
        out.open(f"for (int some = 0; some < {g.elements}; some += {each})")
        out.open(f"for (int turn = 0; turn < {rounds}; ++turn)")
        out.add(f"OWNED(V, sums, {entries}, {g.threads});")
        out.open(f"for (int first = 0; first < {points}; first += {self.slice_points})")
        self._load()
        out.open(f"OWN(l, {g.threads})")
        out.open(f"if (turn * {g.threads} + l < {self.columns})")
        self._column()
        out.add("V *const r = MINE(sums, l);")
        out.add(f"UNROLL for (int i = 0; first == 0 && i < {entries}; ++i) r[i] = 0;")
        out.add(
            f"const int last = {points} - first < {self.slice_points} "
            f"? {points} - first : {self.slice_points};"
        )
        for j in range(self.column.first, self.column.last):
            self._sums(j)
        for _ in range(3):
            out.close()
        self._store()
        for _ in range(2):
            out.close()

    def _load(self) -> None:
        """Moduli of some elements, or of a slice of one, to shared memory."""
        out, g, each, count = self.out, self.sizes, self.each, self.slice_points
        size = self.parent.size
        out.add("SYNC")
        out.open(f"THREADS(l, {each * count * size}, {g.threads})")
        out.add(f"const int p = l % {each * count}, number = l / {each * count};")
        out.add(f"const int e = p / {count}, q = first + p % {count};")
        out.add(
            f"const long long at = ((long long)block * {size} + number) * {g.owners} "
            f"+ (some + e) * {g.points} + q;"
        )
        out.add(f"S[p][number] = some + e < {g.elements} && q < {g.points} ? kept[at] : 0;")
        out.close()
        out.add("SYNC")

    def _column(self) -> None:
        """Component c, node b, element e and part of the rows of a thread."""
        out, each, k, parts = self.out, self.each, self.k[1], self.parts
        out.add(f"const int own = turn * {self.sizes.threads} + l;")
        out.add(f"const int c = own / {each * k * parts}, b = own % {k};")
        out.add(f"const int e = own / {k} % {each}, part = own / {k * each} % {parts};")

    def _sums(self, j: int) -> None:
        """B' S B of the columns of a component."""
        out, halves = self.out, self._half(j)
        c = j - self.column.first
        out.open(f"{'else ' if c else ''}if (c == {c})")
        out.open("for (int p = 0; p < last; ++p)")
        out.add(f"const V *const N = basis_of_{self.column.order}[first + p][b];")
        out.add(f"const V *const s = S[e * {self.slice_points} + p];")
        out.add("(void)N, (void)s;")
        for i, terms in halves.items():
            for at, total in terms.items():
                out.add(f"const V T{i}{at} = {total};")
        out.open(f"UNROLL for (int a = 0; a < {self.rows}; ++a)")
        out.add(f"const int node = part * {self.rows} + a;")
        out.open(f"if (node < {self.k[0]})")
        out.add(f"const V *const B = basis_of_{self.row.order}[first + p][node];")
        out.add("(void)B;")
        for i, terms in halves.items():
            total = " + ".join(f"T{i}{at} * B[{at}]" for at in terms)
            out.add(f"r[{self.row.count} * a + {i}] += {total};")
        for _ in range(4):
            out.close()

    def _half(self, j: int) -> dict[int, dict[int, str]]:
        """S B of a column of the component j: component of the rows -> place in B -> its sum."""
        parent, components = self.parent, self.sizes.components
        of_rows: dict[int, dict[int, str]] = {}
        for i in range(self.row.first, self.row.last):
            for q in parent.of(components[i]):
                terms = []
                for o in parent.of(components[j]):
                    entry = parent.number(q, o)
                    if entry is not None:
                        terms.append(f"s[{entry}] * N[{0 if o.axis is None else 1 + o.axis}]")
                if terms:
                    at = 0 if q.axis is None else 1 + q.axis
                    of_rows.setdefault(i - self.row.first, {})[at] = " + ".join(terms)
        return of_rows

    def _store(self) -> None:
        """The sums of a thread, added to the matrix."""
        out, g, (k, _) = self.out, self.sizes, self.k
        total = nodes_of(self.fields, g.D)
        out.open(f"OWN(l, {g.threads})")
        out.open(f"if (turn * {g.threads} + l < {self.columns})")
        self._column()
        out.add(f"const int el = block * {g.elements} + some + e;")
        out.add("const V *const r = MINE(sums, l);")
        out.open(f"if (some + e < {g.elements} && el < n)")
        out.open(f"UNROLL for (int a = 0; a < {self.rows}; ++a)")
        out.add(f"const int node = part * {self.rows} + a;")
        out.open(f"if (node < {k})")
        out.add(f"const int at = el * {total} + {node_of(self.row, 'node')};")
        out.add(f"const long long pair = (long long)at * {total} + {node_of(self.column, 'b')};")
        out.add("const int row = low[at], place = slots[pair] + c;")
        for i in range(self.row.count):
            out.add(f"ADD(values + rows[row + {i}] + place, r[{self.row.count} * a + {i}]);")
        for _ in range(5):
            out.close()
