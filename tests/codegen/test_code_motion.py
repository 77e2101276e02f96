"""Where values are computed: out of the loop, in stages, inside the branch that needs them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from softehl.codegen.emit.code_motion import If, Loop, Statement, schedule
from softehl.codegen.graph.graph import Graph, Node, Op
from tests.codegen.workshop import unknowns


def ifs(statements: Sequence[Statement]) -> list[If]:
    return [s for s in statements if isinstance(s, If)]


def nodes_of(statements: Sequence[Statement]) -> Iterator[Node]:
    """Every value of a block, those inside branches too."""
    for s in statements:
        if isinstance(s, Node):
            yield s
        elif isinstance(s, If):
            yield from s.merged
            yield from nodes_of(s.then)
            yield from nodes_of(s.otherwise)


def assert_operands_first(statements: Sequence[Statement], known: set[Node]) -> set[Node]:
    """Every operand that is computed at all is computed before it is read."""
    everything = set(nodes_of(statements)) | known
    done = set(known)
    for s in statements:
        if isinstance(s, Node):
            assert not [a for a in s.args if a in everything and a not in done], s
            done.add(s)
            continue
        assert isinstance(s, If)
        assert s.condition in done or s.condition not in everything
        for k, side in ((1, s.then), (2, s.otherwise)):
            inside = assert_operands_first(side, done)
            for n in s.merged:
                assert n.args[k] in inside or n.args[k] not in everything, n
        done.update(s.merged)
    return done


def block(*roots: Node) -> list[Statement]:
    """The only block of a graph without a loop, checked for order and completeness."""
    plan = schedule(roots)
    assert len(plan.stages) == 1
    assert plan.stages[0].loop is None
    statements = plan.stages[0].preamble
    found = list(nodes_of(statements))
    assert len(found) == len(set(found)) == plan.operations_once
    assert_operands_first(statements, set())
    return statements


def loop_of(plan_loop: Loop | None) -> Loop:
    assert plan_loop is not None
    return plan_loop


# ------------------------------------------------------------------------------------------- loops


def test_a_sum_that_feeds_a_sum_takes_two_loops() -> None:
    g = Graph()
    (x,) = unknowns(g, 1)
    xi = g.input("rule", 0, varying=True)
    mean = g.sum(g.mul(x, xi))
    scaled = g.call(Op.EXP, mean)
    deviation = g.sub(xi, scaled)
    total = g.sum(g.mul(deviation, deviation))
    root = g.mul(total, x)
    plan = schedule([root])
    first, second, last = plan.stages
    assert first.preamble == []
    assert loop_of(first.loop).sums == (mean,)
    assert second.preamble == [scaled]
    assert loop_of(second.loop).sums == (total,)
    assert set(nodes_of(loop_of(second.loop).body)) == {deviation, total.args[0]}
    assert last.preamble == [root]
    assert last.loop is None
    assert (plan.operations_once, plan.operations_per_point) == (2, 2 + 3)


# ---------------------------------------------------------------------------------------- branches


def test_groups_that_wait_for_each_other_are_separated() -> None:
    """a and d share a condition, b and c another; a -> b and c -> d: no order of two ifs works."""
    g = Graph()
    x, y, z = unknowns(g, 3)
    p, q = g.compare(Op.LT, x, y), g.compare(Op.LT, y, z)
    a = g.branch(p, x, y)
    c = g.branch(q, y, z)
    b = g.branch(q, g.call(Op.SIN, a), z)
    d = g.branch(p, g.call(Op.COS, c), x)
    merged = [s.merged for s in ifs(block(a, b, c, d))]
    assert sorted(n.id for group in merged for n in group) == sorted(n.id for n in (a, b, c, d))
    order = [n for group in merged for n in group]
    assert order.index(a) < order.index(b)
    assert order.index(c) < order.index(d)


def test_the_order_check_sees_a_wrong_order() -> None:
    g = Graph()
    (x,) = unknowns(g, 1)
    sine = g.call(Op.SIN, x)
    root = g.call(Op.EXP, sine)
    assert_operands_first([sine, root], set())
    try:
        assert_operands_first([root, sine], set())
    except AssertionError:
        return
    raise RuntimeError("a value read before it is computed went unnoticed")
