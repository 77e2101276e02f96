"""Whole element or loops around a point: which form of a page of fields is the faster one.

One long piece of code is the fastest for small elements, and the slowest to build and to run for
large ones. Its operations are estimated from those at a point: what the generator saves by looking
at the element as a whole is about a third, on every cell that was measured.
"""

from __future__ import annotations

from dataclasses import dataclass

from softehl.codegen.emit.points.function import Outputs
from softehl.codegen.emit.points.layout import Layout, orders
from softehl.codegen.emit.points.pairs import Pair, Parent
from softehl.codegen.graph.graph import Op
from softehl.codegen.graph.traverse import reachable

SAVED = 0.35
"""Part of the operations that whole-element code saves: 0.25 to 0.45 on tri3 to tet10."""
LARGE = 12_000
"""Operations up to which simplices and wedges stay whole: there loops save the least.

Neo-Hooke on wedge6 (9,300): loops take 1.35 times as long, and 0.5 s to build instead of 2.6.
On tet10 (12,600): 1.1 times, and 0.6 s instead of 5, with a third of the C.
"""


@dataclass(frozen=True)
class Choice:
    """The chosen form of a page, and why."""

    at_points: bool
    why: str


def choose(layout: Layout, tangent: Outputs, operations: int, short: int) -> Choice:
    """The form of a page. operations: of the moduli at a point; short: up to which whole pays.

    tangent: moduli that are not zero.
    """
    d = layout.d
    if d.unroll is not None:
        return Choice(d.unroll is False, "the page asks for it")
    work = layout.points * (2 * multiply_adds(layout, tangent) + operations)
    whole = round((1 - SAVED) * work)
    told = f"about {whole} operations of the whole element"
    if any(n.op is Op.CALL for n in reachable([x.node for x in tangent.entries])):
        return Choice(True, f"local unknowns or functions of stretches, {told}")
    if d.history and layout.points > 1:
        return Choice(True, f"history at {layout.points} points, {told}")
    simple = d.cell.startswith(("tri", "tet", "wedge"))
    limit = LARGE if simple and not d.history else short
    return Choice(whole > limit, f"{told}, limit {limit}")


def multiply_adds(layout: Layout, tangent: Outputs) -> int:
    """Multiply-adds of B^T S B at one point, pair by pair of nodes."""
    parent = Parent(layout, tangent)
    total, found = 0, orders(parent.quantities)
    for n, e in enumerate(found):
        for f in found[n if parent.symmetric else 0 :]:
            pair = Pair(parent, (e, f), e == f and parent.symmetric)
            rows, columns = layout.shape(e).nodes, layout.shape(f).nodes
            pairs = rows * (rows + 1) // 2 if pair.half else rows * columns
            met = sum(
                parent.number(q, o) is not None
                for i in pair.components(0)
                for q in parent.of(i)
                for j in pair.components(1)
                for o in parent.of(j)
            )
            spread = sum(len(parent.of(i)) for i, _ in pair.entries)
            total += columns * met + pairs * spread
    return total
