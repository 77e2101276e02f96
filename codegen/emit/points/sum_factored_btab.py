"""B^T S B one direction after the other, for cells that are products of lines.

A pair of nodes (a, b) is three pairs of nodes of a line. Summed over the points of the last
direction first, with the pair of that direction outermost, the moduli become fewer: what was a
slope along that direction becomes a value.
"""

from __future__ import annotations

from dataclasses import dataclass

from softehl.codegen.emit.points.basis_tables import Line
from softehl.codegen.emit.points.btab import Pair
from softehl.codegen.emit.points.c_lines import Lines
from softehl.codegen.language.definition import Component, Quantity

Key = tuple[Component, int | None, Component, int | None]
"""A modulus: component and direction (None: value) of the row and of the column."""


def assemble(out: Lines, pair: Pair) -> None:
    """The loops over pairs of nodes along the directions, the last one outermost."""
    values: dict[Key, str] = {}
    for row, column in _both(pair):
        n = pair.parent.number(row, column)
        if n is not None:
            values[row.component, row.axis, column.component, column.axis] = str(n)
    _Level(out, pair, pair.layout.dimension - 1, "S").write(values, alike=pair.half)


def _both(pair: Pair) -> list[tuple[Quantity, Quantity]]:
    rows = [q for q in pair.parent.quantities if q.component.order == pair.order[0]]
    columns = [q for q in pair.parent.quantities if q.component.order == pair.order[1]]
    return [(a, b) for a in rows for b in columns]


@dataclass(frozen=True, eq=False)
class _Level:
    """Sums over the points along an axis of the array `source`."""

    out: Lines
    pair: Pair
    axis: int
    source: str

    @property
    def lines(self) -> list[Line]:
        """Shape functions along a direction, of rows and of columns."""
        order_lines = [self.pair.layout.shape(order).line for order in self.pair.order]
        return [line for line in order_lines if line is not None]

    def write(self, moduli: dict[Key, str], *, alike: bool) -> None:
        """Write loops over pairs of nodes along the axis; moduli: indices in the source.

        alike: the nodes of the pair are the same along the directions that are done, so that what
        stands in the source is symmetric, and one of two mirrored pairs is enough.
        """
        out, axis = self.out, self.axis
        rows, columns = (len(line.values[0]) for line in self.lines)
        out.open(f"for (int b{axis} = 0; b{axis} < {columns}; ++b{axis})")
        if alike:
            out.open("")
            out.add(f"const int a{axis} = b{axis};")
            self._one(moduli, alike=True)
            out.close()
        out.open(f"for (int a{axis} = 0; a{axis} < {f'b{axis}' if alike else rows}; ++a{axis})")
        self._one(moduli, alike=False)
        out.close()
        out.close()

    def _one(self, moduli: dict[Key, str], *, alike: bool) -> None:
        """The sums of one pair of nodes along the axis."""
        out, axis, size = self.out, self.axis, len(self.lines[0].values)
        targets: dict[Key, list[tuple[int, str]]] = {}
        for (i, k, j, m), entry in moduli.items():
            reduced = (i, None if k == axis else k, j, None if m == axis else m)
            targets.setdefault(reduced, []).append((2 * (k == axis) + (m == axis), entry))
        mirrored = {(i, k, j, m): (j, m, i, k) for i, k, j, m in targets}
        if alike:
            turn = {key: n for n, key in enumerate(targets)}
            targets = {key: t for key, t in targets.items() if turn[key] <= turn[mirrored[key]]}
        numbers = {key: str(n) for n, key in enumerate(targets)}
        if axis:
            out.add(f"V T{axis}[{size**axis}][{len(targets)}];")
            out.open(f"for (int p = 0; p < {size**axis}; ++p)")
        self._sums(targets, size)
        if axis:
            for n in numbers.values():
                out.add(f"T{axis}[p][{n}] = t{n};")
            out.close()
            every = {
                **numbers,
                **({mirrored[key]: n for key, n in numbers.items()} if alike else {}),
            }
            _Level(out, self.pair, axis - 1, f"T{axis}").write(every, alike=alike)
        else:
            self._stores(numbers)

    def _sums(self, targets: dict[Key, list[tuple[int, str]]], size: int) -> None:
        """The sums t0, t1, ... over the points."""
        out, axis = self.out, self.axis
        table = f"{self.pair.tables}_C{self.pair.order[0]}{self.pair.order[1]}"
        for s in range(size):
            point = f"p * {size} + {s}" if axis else str(s)
            out.add(f"const double *const c{s} = {table}[{s}][a{axis}][b{axis}];")
            out.add(f"const V *const m{s} = {self.source}[{point}];")
        for n, terms in enumerate(targets.values()):
            total = [f"m{s}[{k}] * c{s}[{c}]" for s in range(size) for c, k in terms]
            out.add(f"const V t{n} = {' + '.join(total)};")

    def _stores(self, numbers: dict[Key, str]) -> None:
        """Entries of the tangent of the nodes that the pairs along the directions make."""
        out, pair = self.out, self.pair
        for side, letter in enumerate("ab"):
            index = f"{letter}0"
            for k in range(1, pair.layout.dimension):
                index = f"({index}) * {len(self.lines[side].values[0])} + {letter}{k}"
            nodes = f"{pair.tables}_nodes{pair.order[side]}"
            out.add(f"const int {letter} = {nodes}[{index}];")
        for (i, _, j, _), n in numbers.items():
            pair.store(out, i, j, "a", "b", f"t{n}")
