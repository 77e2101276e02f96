"""Tangents by products B^T M B at the points (`derive.point_products`), as lines of C.

B has a block for each set of unknowns that several values at a point share, without zeros; M and
the tangent are full. A symmetric tangent has its lower triangle until it is stored.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from softehl.codegen.derive.output_entries import OutputArray, OutputEntry
from softehl.codegen.derive.point_products import ProductBlock, blocks
from softehl.codegen.emit.c_printer import Printer
from softehl.codegen.graph.graph import FREE, Node

LARGE = 65536
"""Entries of a tangent from which it is no longer on the stack."""


def operations(entries: Sequence[OutputEntry], unknowns: int, *, symmetric: bool) -> int:
    """Multiplications and additions of all products at one point."""
    groups = blocks(entries)
    total = 0
    for a in groups:
        for b in groups:
            total += 2 * len(a.rows) * len(b.rows) * len(b.columns)
            entries_of_pair = len(a.columns) * len(b.columns)
            total += 2 * len(a.rows) * entries_of_pair // (1 + symmetric)
    return total


class ProductLoops:
    """Arrays and loops of the products of one tangent."""

    def __init__(self, p: Printer, entries: Sequence[OutputEntry]) -> None:
        self.p, self.size = p, len(p.d.unknowns)
        self.entries = [x for x in entries if x.array is not OutputArray.OUTPUT]
        self.symmetric = p.d.conservative
        self.blocks = blocks(self.entries)
        self.rank = {row: (n, k) for n, b in enumerate(self.blocks) for k, row in enumerate(b.rows)}
        self.lanes = [{j: k for k, j in enumerate(b.columns)} for b in self.blocks]
        self.pending: dict[Node, list[OutputEntry]] = {}
        for x in self.entries:
            self.pending.setdefault(x.node, []).append(x)

    def once(self) -> list[Node]:
        """Values at the point that only one line reads, right after they are computed."""
        return [n for n, some in self.pending.items() if len(some) == 1 and n.varying]

    def declare(self) -> None:
        """Print the arrays; what is not written later is zero."""
        p, m, count = self.p, len(self.rank), self.size**2
        storage = "static _Thread_local " if count > LARGE else ""
        p.line(1, f"{storage}V k_lanes[{count}];")
        p.line(1, f"for (ptrdiff_t i = 0; i < {count}; ++i) k_lanes[i] = {p.zero};")
        if m:
            p.line(1, f"V M_lanes[{m}][{m}];")
            p.line(1, f"for (int i = 0; i < {m}; ++i)")
            p.line(2, f"for (int j = 0; j < {m}; ++j) M_lanes[i][j] = {p.zero};")
        for n, b in enumerate(self.blocks):
            p.line(1, f"V B{n}_lanes[{len(b.rows)}][{len(b.columns)}];")
            columns = ", ".join(map(str, b.columns))
            p.line(1, f"static const short at{n}[{len(b.columns)}] = {{{columns}}};")

    def start(self) -> None:
        """Print what is ready before the statements of the loop."""
        self.computed([n for n in self.pending if n.op in FREE and n.varying])
        fixed = [n for n in self.pending if not n.varying]
        for n in fixed:
            some = self.pending[n]
            self._print(2, [x for x in some if x.array is not OutputArray.ADDED])
            self.pending[n] = [x for x in some if x.array is OutputArray.ADDED]

    def computed(self, nodes: Iterable[Node]) -> None:
        """Print what becomes of values at the point."""
        for n in nodes:
            if n.varying:
                self._print(2, self.pending.pop(n, []))

    def _print(self, depth: int, entries: Iterable[OutputEntry]) -> None:
        for x in entries:
            value = self.p.value(x.node)
            self.p.line(
                depth,
                f"{self._target(x)} = {value};"
                if x.array is not OutputArray.ADDED
                else f"{self._target(x)} += {value};",
            )

    def _target(self, x: OutputEntry) -> str:
        assert x.column is not None
        i, j = x.row.position, x.column.position
        if x.array is OutputArray.ADDED:
            return f"k_lanes[{self.size * i + j}]"
        n, k = self.rank.get(i, (0, 0))
        if x.array is OutputArray.SLOPES:
            return f"B{n}_lanes[{k}][{self.lanes[n][j]}]"
        row, column = self._row(i), self._row(j)
        if self.symmetric and column > row:
            row, column = column, row
        return f"M_lanes[{row}][{column}]"

    def _row(self, value: int) -> int:
        """Row of M: values in the order of the blocks."""
        n, k = self.rank[value]
        return sum(len(b.rows) for b in self.blocks[:n]) + k

    def multiply(self) -> None:
        """Print the loops that add the products of one point."""
        p = self.p
        if self.symmetric and self.rank:
            m = len(self.rank)
            p.line(2, f"for (int i = 0; i < {m}; ++i)")
            p.line(3, f"for (int j = i + 1; j < {m}; ++j) M_lanes[i][j] = M_lanes[j][i];")
        for a, b, m, n in self._pairs():
            self._product(a, b, m, n)

    def _pairs(self) -> Iterator[tuple[ProductBlock, ProductBlock, int, int]]:
        for m, a in enumerate(self.blocks):
            for n, b in enumerate(self.blocks):
                yield a, b, m, n

    def _product(self, a: ProductBlock, b: ProductBlock, m: int, n: int) -> None:
        p, rows, columns = self.p, len(a.rows), len(b.columns)
        first, second = self._row(a.rows[0]), self._row(b.rows[0])
        p.line(2, "{")
        p.line(3, f"V S[{rows}][{columns}];")
        p.line(3, f"for (int k = 0; k < {rows}; ++k)")
        p.line(4, f"for (int j = 0; j < {columns}; ++j) {{")
        terms = [
            f"M_lanes[{first} + k][{second + r}] * B{n}_lanes[{r}][j]" for r in range(len(b.rows))
        ]
        p.line(5, f"S[k][j] = {terms[0]};")
        for term in terms[1:]:
            p.line(5, f"S[k][j] += {term};")
        p.line(4, "}")
        p.line(3, f"for (int i = 0; i < {len(a.columns)}; ++i)")
        if self.symmetric and m == n:
            p.line(4, "for (int j = 0; j <= i; ++j) {")
        elif self.symmetric:
            p.line(4, f"for (int j = 0; j < {columns} && at{n}[j] <= at{m}[i]; ++j) {{")
        else:
            p.line(4, f"for (int j = 0; j < {columns}; ++j) {{")
        p.line(5, f"V entry = B{m}_lanes[0][i] * S[0][j];")
        for k in range(1, rows):
            p.line(5, f"entry += B{m}_lanes[{k}][i] * S[{k}][j];")
        p.line(5, f"k_lanes[{self.size} * at{m}[i] + at{n}[j]] += entry;")
        p.line(4, "}")
        p.line(2, "}")

    def finish(self) -> None:
        """Print what is added once, and the stores."""
        p, size, count = self.p, self.size, self.size**2
        for some in self.pending.values():
            self._print(1, some)
        if self.symmetric:
            p.line(1, f"for (int i = 0; i < {size}; ++i)")
            p.line(2, f"for (int j = i + 1; j < {size}; ++j)")
            p.line(3, f"k_lanes[{size} * i + j] = k_lanes[{size} * j + i];")
        p.line(1, f"for (ptrdiff_t k = 0; k < {count - count % 4}; k += 4)")
        values = ", ".join(f"k_lanes[k + {i}]" for i in range(4))
        p.line(2, f"softehl_store4(K + k, {count}, {values});")
        for k in range(count - count % 4, count):
            p.line(1, f"softehl_store1(K + {k}, {count}, k_lanes[{k}]);")
