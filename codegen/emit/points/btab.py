"""The tangent of a cell from the moduli at its points: B^T A B, summed over the points.

The moduli are pulled back to the parent cell first, so that shape functions and their slopes are
constants. Then node b of a pair is outermost and the sums over the points stay in registers; in
cells that are products of lines one direction after the other is summed instead: there a pair of
nodes (a, b) is three pairs of nodes of a line. Summed over the points of the last direction first,
with the pair of that direction outermost, the moduli become fewer: what was a slope along that
direction becomes a value.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

from softehl.codegen.emit.points.basis_tables import LineTable
from softehl.codegen.emit.points.c_lines import Lines
from softehl.codegen.emit.points.point_function import PointOutputs
from softehl.codegen.emit.points.point_layout import PointLayout
from softehl.codegen.language.definition import Component, PointQuantity

STEM = "pairs_"
"""Beginning of the names of files that models share, and of what is in them."""


@dataclass(frozen=True, eq=False)
class Parent:
    """Moduli by values and parent gradients: the array S of a point."""

    layout: PointLayout
    outputs: PointOutputs

    @property
    def symmetric(self) -> bool:
        """True if only the upper triangle is stored."""
        return self.outputs.symmetric

    @cached_property
    def moduli(self) -> dict[tuple[PointQuantity, PointQuantity], str]:
        """Moduli at the point by row and column, from the function of the point; both triangles."""
        q, by_pair = self.layout.form.cell_quantities, {}
        for k, (i, j) in enumerate(self.outputs.moduli):
            if j not in q:
                continue
            by_pair[q[i], q[j]] = f"A[{k}]"
            if self.symmetric:
                by_pair[q[j], q[i]] = f"A[{k}]"
        return by_pair

    @cached_property
    def of_centroid(self) -> list[dict[PointQuantity, str]]:
        """Derivatives of fluxes by each value at the centroid; empty where all are zero."""
        q, columns = self.layout.form.cell_quantities, []
        numbers = {value: k for k, value in enumerate(self.layout.form.unknowns)}
        for value in (self.layout.form.all[k] for k in self.layout.form.centroid):
            column = numbers.get(value)
            pairs = enumerate(self.outputs.moduli)
            columns.append({q[i]: f"A[{k}]" for k, (i, j) in pairs if j == column})
        return columns if any(columns) else []

    @cached_property
    def blocks(
        self,
    ) -> dict[tuple[Component, bool, Component, bool], list[tuple[PointQuantity, ...]]]:
        """Nonempty blocks of the moduli by component and whether it is a gradient."""
        by_block: dict[
            tuple[Component, bool, Component, bool], list[tuple[PointQuantity, ...]]
        ] = {}
        for row, column in self.moduli:
            key = (row.component, row.axis is not None, column.component, column.axis is not None)
            by_block.setdefault(key, []).append((row, column))
        return by_block

    @cached_property
    def quantities(self) -> list[PointQuantity]:
        """Values and parent gradients of the components, in the order of the weak form."""
        parent_quantities: dict[PointQuantity, None] = {}
        for q in self.layout.form.cell_quantities.values():
            axes = [None] if q.axis is None else range(self.layout.dimension)
            parent_quantities.update(dict.fromkeys(PointQuantity(q.component, k) for k in axes))
        order = {c: k for k, c in enumerate(self.layout.components)}
        return sorted(
            parent_quantities, key=lambda q: (order[q.component], -1 if q.axis is None else q.axis)
        )

    @cached_property
    def numbers(self) -> dict[tuple[PointQuantity, PointQuantity], int]:
        """Indices in S of the nonzero entries."""
        entry_numbers: dict[tuple[PointQuantity, PointQuantity], int] = {}
        for n, row in enumerate(self.quantities):
            for column in self.quantities[n if self.symmetric else 0 :]:
                is_gradient = row.axis is not None, column.axis is not None
                if (row.component, is_gradient[0], column.component, is_gradient[1]) in self.blocks:
                    entry_numbers[row, column] = len(entry_numbers)
        return entry_numbers

    @property
    def size(self) -> int:
        """Entries of S at one point."""
        return max(len(self.numbers), 1)

    def number(self, row: PointQuantity, column: PointQuantity) -> int | None:
        """Index in S of an entry of either triangle."""
        mirrored = (column, row) if self.symmetric else (row, column)
        return self.numbers.get((row, column), self.numbers.get(mirrored))

    def of(self, c: Component) -> list[PointQuantity]:
        """Value and parent gradient of a component."""
        return [q for q in self.quantities if q.component == c]


def pull_back(out: Lines, layout: PointLayout, outputs: PointOutputs) -> None:
    """Write S of the point q: w T A T^T, where T turns gradients into parent gradients."""
    parent, D = Parent(layout, outputs), range(layout.dimension)
    for k in D:
        out.add(f"const V {', '.join(f'wI{k}{m} = w * I{k}{m}' for m in D)};")
        out.idle(f"wI{k}{m}" for m in D)
    half: dict[tuple[PointQuantity, PointQuantity], str] = {}
    for (row, column), n in parent.numbers.items():
        terms = []
        for axis in [None] if row.axis is None else D:
            inner = PointQuantity(row.component, axis)
            value = _half(out, parent, half, inner, column)
            if value:
                terms.append(f"w * {value}" if axis is None else f"wI{row.axis}{axis} * {value}")
        out.add(f"S[q][{n}] = {' + '.join(terms) or 'softehl_splat(0.0)'};")


def _half(
    out: Lines,
    parent: Parent,
    half: dict[tuple[PointQuantity, PointQuantity], str],
    row: PointQuantity,
    column: PointQuantity,
) -> str:
    """Name of a modulus whose column is pulled back; empty where it is zero."""
    if (row, column) not in half:
        terms = []
        for axis in [None] if column.axis is None else range(parent.layout.dimension):
            value = parent.moduli.get((row, PointQuantity(column.component, axis)))
            if value:
                terms.append(value if axis is None else f"{value} * I{column.axis}{axis}")
        name = f"H{len(half)}" if terms else ""
        half[row, column] = name
        if terms:
            out.add(f"const V {name} = {' + '.join(terms)};")
    return half[row, column]


@dataclass(frozen=True, eq=False)
class Pair:
    """Rows and columns of the tangent of components with shape functions of two orders."""

    parent: Parent
    order: tuple[int, int]
    half: bool
    """Whether rows and columns are the same and symmetric."""

    @property
    def layout(self) -> PointLayout:
        return self.parent.layout

    @property
    def tables(self) -> str:
        """Prefix of the names of tables, different from that in the file of the model."""
        return f"{STEM}{self.layout.d.cell}"

    def components(self, side: int) -> list[Component]:
        """Of the rows (0) or columns (1)."""
        distinct = dict.fromkeys(q.component for q in self.parent.quantities)
        return [c for c in distinct if c.order == self.order[side]]

    @cached_property
    def entries(self) -> list[tuple[Component, Component]]:
        """Components of rows and columns that have moduli."""
        met = {(row.component, column.component) for row, column in self.parent.moduli}
        every = product(self.components(0), self.components(1))
        return [pair for pair in every if pair in met]

    def store(self, out: Lines, i: Component, j: Component, a: str, b: str, value: str) -> None:
        """Write an entry of the tangent; of a symmetric one that above the diagonal."""
        size = len(self.layout.d.unknowns)
        row, column = self.layout.entries(i).at(a), self.layout.entries(j).at(b)
        if self.parent.symmetric and self.layout.field(i) > self.layout.field(j):
            row, column = column, row
        out.add(f"k_lanes[({row}) * {size} + {column}] = {value};")


def ranks(layout: PointLayout) -> list[tuple[Any, ...]]:
    """Ranks of the unknowns: of two mirrored entries that with the lower row is stored."""
    names = {c.name: c for c in layout.components}
    ranked = []
    for n, (name, node) in enumerate(layout.d.dof_nodes):
        c = names[name]
        line = layout.shape(c.order).line
        along = line.node_indices[node or 0][::-1] if line is not None else (node,)
        ranked.append((layout.field(c), along, n))
    return ranked


Columns = dict[tuple[PointQuantity, Component], int]


def assemble(out: Lines, pair: Pair) -> None:
    """Node b outermost, two nodes a at a time, the sums over the points innermost."""
    layout = pair.layout
    nodes = [layout.shape(order).nodes for order in pair.order]
    columns: Columns = {}
    for q in pair.parent.quantities:
        for j in pair.components(1):
            some = [pair.parent.number(q, o) for o in pair.parent.of(j)]
            if q.component.order == pair.order[0] and any(n is not None for n in some):
                columns[q, j] = len(columns)
    out.open(f"for (int b = 0; b < {nodes[1]}; ++b)")
    out.add(f"V C[{layout.points}][{len(columns)}];")
    _columns(out, pair, columns)
    last = "b" if pair.half else str(nodes[0] - 1)
    out.open(f"for (int a = 0; a <= {last}; a += 2)")
    out.add(f"const int a2 = a + 1 < {nodes[0]} ? a + 1 : a;")
    _sums(out, pair, columns)
    out.close()
    out.close()


def _factor(q: PointQuantity, node: str) -> str:
    """Variable with the shape function of a node, or its derivative."""
    return f"N{node}" if q.axis is None else f"D{node}{q.axis}"


def _factors(out: Lines, pair: Pair, side: int, node: str, index: str) -> None:
    name, order = pair.tables, pair.order[side]
    some = [q for q in pair.parent.quantities if q.component.order == order]
    for axis in sorted({-1 if q.axis is None else q.axis for q in some}):
        table = (
            f"{name}_N{order}[q][{index}]" if axis < 0 else f"{name}_D{order}[q][{index}][{axis}]"
        )
        factor = f"N{node}" if axis < 0 else f"D{node}{axis}"
        out.add(f"const double {factor} = {table};")
        out.idle([factor])


def _columns(out: Lines, pair: Pair, columns: Columns) -> None:
    """C = S B of the node b at every point."""
    out.open(f"for (int q = 0; q < {pair.layout.points}; ++q)")
    _factors(out, pair, 1, "b", "b")
    for (q, j), n in columns.items():
        terms = []
        for o in pair.parent.of(j):
            entry = pair.parent.number(q, o)
            if entry is not None:
                terms.append(f"S[q][{entry}] * {_factor(o, 'b')}")
        out.add(f"C[q][{n}] = {' + '.join(terms)};")
    out.close()


def _sums(out: Lines, pair: Pair, columns: Columns) -> None:
    """B^T C of two nodes a."""
    entries = pair.entries
    for node in ("", "2"):
        names = [f"k{node}_{n} = softehl_splat(0.0)" for n in range(len(entries))]
        out.add(f"V {', '.join(names)};")
    out.open(f"for (int q = 0; q < {pair.layout.points}; ++q)")
    _factors(out, pair, 0, "a", "a")
    _factors(out, pair, 0, "c", "a2")
    for n, (i, j) in enumerate(entries):
        for q in pair.parent.of(i):
            if (q, j) in columns:
                for node, letter in (("", "a"), ("2", "c")):
                    out.add(f"k{node}_{n} += C[q][{columns[q, j]}] * {_factor(q, letter)};")
    out.close()
    for n, (i, j) in enumerate(entries):
        for node, index in (("", "a"), ("2", "a2")):
            pair.store(out, i, j, index, "b", f"k{node}_{n}")


Key = tuple[Component, int | None, Component, int | None]
"""A modulus: component and direction (None: value) of the row and of the column."""


def assemble_by_directions(out: Lines, pair: Pair) -> None:
    """The loops over pairs of nodes along the directions, the last one outermost."""
    values: dict[Key, str] = {}
    for row, column in _both(pair):
        n = pair.parent.number(row, column)
        if n is not None:
            values[row.component, row.axis, column.component, column.axis] = str(n)
    _Level(out, pair, pair.layout.dimension - 1, "S").write(values, alike=pair.half)


def _both(pair: Pair) -> list[tuple[PointQuantity, PointQuantity]]:
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
    def lines(self) -> list[LineTable]:
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
