"""Long runs in pieces, and partial sums that go straight into the sum over the points."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from operator import add, mul, sub

from softehl.codegen.emit.basic_blocks import PART, arranged_plan
from softehl.codegen.emit.code_motion import Loop, Same, Schedule, schedule
from softehl.codegen.emit.simd_kernel import added_at_once
from softehl.codegen.graph.graph import FREE, Graph, Input, Node, Op
from softehl.codegen.graph.traversal import reachable
from tests.codegen.test_order import matrix_product, misplaced
from tests.codegen.workshop import unknowns

CALCULATED: dict[Op, Callable[..., Fraction]] = {Op.ADD: add, Op.SUB: sub, Op.MUL: mul}


def blocks(g: Graph, count: int, size: int) -> tuple[list[list[Node]], Schedule]:
    """Products V^T S V of matrices S of sums over the points; their entries in turn."""
    entries = []
    for k in range(count):
        S = [
            [
                g.sum(g.input("point data", i + size * (j + size * k), varying=True))
                for j in range(size)
            ]
            for i in range(size)
        ]
        half = [spread(g, row) for row in S]
        entries.append([n for c in zip(*half, strict=True) for n in spread(g, list(c))])
    mixed = [n for row in zip(*entries, strict=True) for n in row]
    return entries, schedule(mixed)


def spread(g: Graph, values: list[Node]) -> list[Node]:
    """Sums of some values with changing signs, one more than there are."""
    out = []
    for i in range(len(values) + 1):
        total = values[0]
        for k, v in enumerate(values[1:], 1):
            total = (g.sub if (i >> (k % 3)) & 1 else g.add)(total, g.mul(g.const(k + i + 2), v))
        out.append(total)
    return out


def number(n: Node) -> Fraction:
    """A value, where each sum over the points is some number of its own."""
    known: dict[Node, Fraction] = {}
    for m in reachable([n]):
        if m.op is Op.CONST:
            known[m] = Fraction(m.value)
        elif m.op is Op.SUM and isinstance(m.args[0].payload, Input):
            known[m] = Fraction(1, 7) + Fraction(m.args[0].payload.index) ** 3
        elif m.op in CALCULATED:
            known[m] = CALCULATED[m.op](*(known[a] for a in m.args))
    return known[n]


def order_after(plan: Schedule) -> list[Node]:
    return [s for s in plan.stages[-1].before if isinstance(s, Node)]


def below(order: list[Node], roots: list[Node]) -> set[int]:
    """Places of what some roots need."""
    wanted = set(reachable(roots))
    return {k for k, n in enumerate(order) if n in wanted}


def test_matrices_side_by_side_come_one_after_the_other() -> None:
    g = Graph()
    entries, plan = blocks(g, 3, 6)
    roots = [n for row in zip(*entries, strict=True) for n in row]
    new = arranged_plan(g, plan, roots)
    order = order_after(new)
    assert len(order) > 3 * PART
    renamed = {s.old: s.new for s in new.stages[-1].before if isinstance(s, Same)}
    places = [below(order, [renamed.get(n, n) for n in some]) for some in entries]
    ends = sorted((min(p), max(p)) for p in places)
    assert all(b < c for (_, b), (c, _) in pairwise(ends))
    inside = set(order)
    known = {n for n in reachable(order) if n not in inside}
    assert not [n for n in misplaced(order) if not set(n.args) & known]
    found, wanted = ([number(renamed.get(n, n)) for n in roots], [number(n) for n in roots])
    assert found == wanted  # exact fractions
    assert number(roots[0]) != number(roots[1])


def test_short_runs_stay_whole() -> None:
    g = Graph()
    entries, plan = blocks(g, 3, 2)
    roots = [n for row in zip(*entries, strict=True) for n in row]
    order = order_after(arranged_plan(g, plan, roots))
    assert len(order) < 3 * PART
    assert len(order) == len(set(order))


# --- sums over the points ------------------------------------------------------------------------


def loop_of(g: Graph, *summed: Node, outputs: tuple[Node, ...] = ()) -> tuple[Loop, list[Node]]:
    sums = [g.sum(n) for n in summed]
    body = [n for n in reachable([*summed, *outputs]) if n.op not in FREE]
    return Loop(list(body), tuple(sums), outputs), sums


def point_values(g: Graph, count: int) -> list[Node]:
    return [g.mul(g.input("rule", 0, varying=True), x) for x in unknowns(g, count)]


def test_terms_of_a_sum_go_straight_into_it() -> None:
    g = Graph()
    a, b, c, d = point_values(g, 4)
    first = g.sub(g.mul(a, b), g.mul(c, d))
    loop, (s,) = loop_of(g, first)
    assert added_at_once(loop) == {first: [(s, "+", g.mul(a, b)), (s, "-", g.mul(c, d))]}
    longer = g.add(first, g.mul(a, d))
    loop, (s,) = loop_of(g, longer)
    found = added_at_once(loop)
    assert found[longer] == [(s, "+", g.mul(a, d))]
    assert len(found[first]) == 2


def test_a_partial_sum_that_is_used_elsewhere_is_kept() -> None:
    g = Graph()
    a, b, c, d = point_values(g, 4)
    part = g.add(g.mul(a, b), g.mul(c, d))
    whole = g.sub(part, g.mul(a, c))
    loop, (s, _) = loop_of(g, whole, g.mul(part, d))
    assert added_at_once(loop) == {whole: [(s, "+", part), (s, "-", g.mul(a, c))]}
    loop, _ = loop_of(g, whole, outputs=(whole,))
    assert added_at_once(loop) == {}


def test_a_difference_keeps_its_sign() -> None:
    g = Graph()
    a, b, c = point_values(g, 3)
    inner = g.add(a, b)
    outer = g.sub(c, inner)
    loop, (s,) = loop_of(g, outer)
    assert added_at_once(loop)[outer] == [(s, "+", c), (s, "-", inner)]
    assert inner not in added_at_once(loop)


def test_a_sum_under_another_name() -> None:
    g = Graph()
    a, b, c = point_values(g, 3)
    old, new = g.add(g.add(a, b), c), g.add(g.add(b, c), a)
    loop, _ = loop_of(g, new)
    renamed = Loop([*loop.body, Same(old, new)], (g.sum(old),), ())
    assert added_at_once(renamed)[new] == [(g.sum(old), "+", a)]


def test_matrix_products_have_parts_that_are_whole() -> None:
    g = Graph()
    roots = matrix_product(g, 5)
    plan = schedule(roots)
    order = order_after(arranged_plan(g, plan, roots))
    assert not misplaced(order)
