"""B^T S B pair by pair of nodes, for cells of any shape."""

from __future__ import annotations

from softehl.codegen.emit.points.lines import Lines
from softehl.codegen.emit.points.pairs import Pair
from softehl.codegen.language.definition import Component, Quantity

Columns = dict[tuple[Quantity, Component], int]


def assembled(out: Lines, pair: Pair) -> None:
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


def _factor(q: Quantity, node: str) -> str:
    """Variable that holds the shape function of a node, or its slope."""
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
        out.idle(factor)


def _columns(out: Lines, pair: Pair, columns: Columns) -> None:
    """C = S B of the node b at every point."""
    out.open(f"for (int q = 0; q < {pair.layout.points}; ++q)")
    _factors(out, pair, 1, "b", "b")
    for (q, j), n in columns.items():
        terms = []
        for o in pair.parent.of(j):
            place = pair.parent.number(q, o)
            if place is not None:
                terms.append(f"S[q][{place}] * {_factor(o, 'b')}")
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
