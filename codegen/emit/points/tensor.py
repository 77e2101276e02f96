"""B^T S B one direction after the other, for cells that are products of lines.

A pair of nodes (a, b) is three pairs of nodes of a line. Summed over the points of the last
direction first, with the pair of that direction outermost, the moduli become fewer: what was a
slope along that direction becomes a value.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from softehl.codegen.emit.points.pairs import Pair
from softehl.codegen.language.definition import Component, Quantity

if TYPE_CHECKING:
    from softehl.codegen.emit.points.loops import Lines

Key = tuple[Component, int | None, Component, int | None]
"""A modulus: component and direction (None: value) of the row and of the column."""


def assembled(out: Lines, pair: Pair) -> None:
    """The loops over pairs of nodes along the directions, the last one outermost."""
    found: dict[Key, str] = {}
    for row, column in _both(pair):
        n = pair.parent.number(row, column)
        if n is not None:
            found[row.component, row.axis, column.component, column.axis] = str(n)
    _level(out, pair, pair.layout.dimension - 1, "S", found)


def _both(pair: Pair) -> list[tuple[Quantity, Quantity]]:
    rows = [q for q in pair.parent.quantities if q.component.order == pair.order[0]]
    columns = [q for q in pair.parent.quantities if q.component.order == pair.order[1]]
    return [(a, b) for a in rows for b in columns]


def _level(out: Lines, pair: Pair, axis: int, source: str, moduli: dict[Key, str]) -> None:
    """Sum over the points along an axis; moduli: their places in `source`, a row for each point."""
    lines = [pair.layout.shape(order).line for order in pair.order]
    assert lines[0] is not None and lines[1] is not None
    size, along = len(lines[0].values), [len(x.values[0]) for x in lines if x is not None]
    half = pair.half and axis == pair.layout.dimension - 1
    out.open(f"for (int b{axis} = 0; b{axis} < {along[1]}; ++b{axis})")
    last = f"b{axis}" if half else str(along[0] - 1)
    out.open(f"for (int a{axis} = 0; a{axis} <= {last}; ++a{axis})")
    targets: dict[Key, list[tuple[int, str]]] = {}
    for (i, k, j, m), place in moduli.items():
        kept = (i, None if k == axis else k, j, None if m == axis else m)
        targets.setdefault(kept, []).append((2 * (k == axis) + (m == axis), place))
    numbers = {key: str(n) for n, key in enumerate(targets)}
    if axis:
        out.add(f"V T{axis}[{size**axis}][{len(targets)}];")
        out.open(f"for (int p = 0; p < {size**axis}; ++p)")
    _sums(out, pair, axis, source, targets, size)
    if axis:
        for key, n in numbers.items():
            out.add(f"T{axis}[p][{n}] = t{n};")
        out.close()
        _level(out, pair, axis - 1, f"T{axis}", numbers)
    else:
        _stores(out, pair, along, numbers)
    out.close()
    out.close()


def _sums(
    out: Lines,
    pair: Pair,
    axis: int,
    source: str,
    targets: dict[Key, list[tuple[int, str]]],
    size: int,
) -> None:
    """The sums t0, t1, ..., those of a pair of components at a time."""
    table = f"{pair.layout.d.name}_C{pair.order[0]}{pair.order[1]}"
    point = f"p * {size} + s" if axis else "s"
    numbers = {key: n for n, key in enumerate(targets)}
    for i, j in pair.entries:
        here = [key for key in targets if (key[0], key[2]) == (i, j)]
        out.add(f"V {', '.join(f't{numbers[key]} = softehl_splat(0.0)' for key in here)};")
        out.open(f"for (int s = 0; s < {size}; ++s)")
        out.add(f"const double *const c = {table}[s][a{axis}][b{axis}];")
        out.add(f"const V *const m = {source}[{point}];")
        for key in here:
            for c, place in targets[key]:
                out.add(f"t{numbers[key]} += m[{place}] * c[{c}];")
        out.close()


def _stores(out: Lines, pair: Pair, along: list[int], numbers: dict[Key, str]) -> None:
    """Entries of the tangent of the nodes that the pairs along the directions make."""
    name, D = pair.layout.d.name, pair.layout.dimension
    for side, letter in enumerate("ab"):
        index = f"{letter}0"
        for k in range(1, D):
            index = f"({index}) * {along[side]} + {letter}{k}"
        out.add(f"const int {letter} = {name}_nodes{pair.order[side]}[{index}];")
    for (i, _, j, _), n in numbers.items():
        pair.store(out, i, j, "a", "b", f"t{n}")
