"""Where values are computed: out of the loop, in stages, inside the branch that needs them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from softehl.codegen.emit.code_motion import If, Loop, Statement, schedule
from softehl.codegen.graph.graph import Graph, Node, Op
from tests.codegen.workshop import unknowns


def plain(statements: Sequence[Statement]) -> list[Node]:
    """Values computed unconditionally."""
    return [s for s in statements if isinstance(s, Node)]


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
    statements = plan.stages[0].before
    found = list(nodes_of(statements))
    assert len(found) == len(set(found)) == plan.operations_once
    assert_operands_first(statements, set())
    return statements


def loop_of(plan_loop: Loop | None) -> Loop:
    assert plan_loop is not None
    return plan_loop


# ------------------------------------------------------------------------------------------- loops


def test_what_does_not_vary_is_computed_before_the_loop() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    xi = g.input("rule", 0, varying=True)
    fixed = g.mul(g.call(Op.LOG, x), y)
    body = g.mul(fixed, g.call(Op.SIN, xi))
    root = g.sum(body)
    plan = schedule([root])
    first, last = plan.stages
    assert first.before == [fixed.args[0] if fixed.args[0].op is Op.LOG else fixed.args[1], fixed]
    loop = loop_of(first.loop)
    assert set(nodes_of(loop.body)) == {body, *(a for a in body.args if a.op is Op.SIN)}
    assert loop.sums == (root,)
    assert loop.outputs == ()
    assert (last.before, last.loop) == ([], None)
    # log and product once; sin, product and the addition to the sum at every point
    assert (plan.operations_once, plan.operations_per_point) == (2, 3)


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
    assert first.before == []
    assert loop_of(first.loop).sums == (mean,)
    assert second.before == [scaled]
    assert loop_of(second.loop).sums == (total,)
    assert set(nodes_of(loop_of(second.loop).body)) == {deviation, total.args[0]}
    assert last.before == [root]
    assert last.loop is None
    assert (plan.operations_once, plan.operations_per_point) == (2, 2 + 3)


def test_sums_of_one_stage_share_a_loop() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    xi = g.input("rule", 0, varying=True)
    sine = g.call(Op.SIN, xi)
    a, b = g.sum(g.mul(x, sine)), g.sum(g.mul(y, sine))
    plan = schedule([a, b])
    assert [s.loop is None for s in plan.stages] == [False, True]
    loop = loop_of(plan.stages[0].loop)
    assert loop.sums == (a, b)
    assert list(nodes_of(loop.body)).count(sine) == 1
    assert (plan.operations_once, plan.operations_per_point) == (0, 5)


def test_values_needed_again_in_a_later_loop_are_computed_again() -> None:
    g = Graph()
    xi = g.input("rule", 0, varying=True)
    sine = g.call(Op.SIN, xi)
    first = g.sum(sine)
    second = g.sum(g.mul(first, sine))
    plan = schedule([second])
    assert [list(nodes_of(loop_of(s.loop).body)) for s in plan.stages[:2]] == [
        [sine],
        [sine, second.args[0]],
    ]
    assert plan.operations_per_point == 2 + 3


def test_values_after_the_loop_wait_for_the_sum() -> None:
    g = Graph()
    (x,) = unknowns(g, 1)
    xi = g.input("rule", 0, varying=True)
    total = g.sum(xi)
    root = g.mul(g.call(Op.LOG, total), g.call(Op.LOG, x))
    plan = schedule([root])
    assert plan.stages[0].before == [g.call(Op.LOG, x)]
    assert plan.stages[1].before == [g.call(Op.LOG, total), root]


def test_varying_roots_are_outputs_of_the_loop() -> None:
    g = Graph()
    (x,) = unknowns(g, 1)
    xi = g.input("rule", 0, varying=True)
    total = g.sum(xi)
    now, later = g.mul(x, xi), g.mul(total, xi)
    plan = schedule([now, later, now, x])
    assert [loop_of(s.loop).outputs for s in plan.stages] == [(now,), (later,)]
    assert loop_of(plan.stages[0].loop).sums == (total,)
    assert plan.operations_per_point == 1 + 1 + 1


def test_nothing_to_compute() -> None:
    g = Graph()
    (x,) = unknowns(g, 1)
    plan = schedule([x, g.zero, g.pi()])
    assert (plan.operations_once, plan.operations_per_point) == (0, 0)
    assert schedule([]).operations_once == 0


# ---------------------------------------------------------------------------------------- branches


def test_what_one_side_needs_is_inside_it_and_what_is_shared_is_outside() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    condition = g.compare(Op.LT, x, y)
    shared = g.call(Op.EXP, x)
    left, right = g.call(Op.LOG, x), g.call(Op.SQRT, y)
    then, otherwise = g.mul(left, shared), g.mul(right, shared)
    root = g.branch(condition, then, otherwise)
    statements = block(root)
    (chosen,) = ifs(statements)
    assert set(plain(statements)) == {condition, shared}
    assert chosen.condition is condition
    assert chosen.merged == [root]
    assert set(plain(chosen.then)) == {left, then}
    assert set(plain(chosen.otherwise)) == {right, otherwise}


def test_what_something_else_uses_is_outside() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    logarithm = g.call(Op.LOG, x)
    root = g.branch(g.compare(Op.LT, x, y), logarithm, y)
    assert logarithm in plain(block(root, logarithm))
    assert logarithm in plain(block(g.add(root, logarithm)))
    assert logarithm not in plain(block(root))
    assert logarithm in plain(block(g.branch(g.compare(Op.LT, logarithm, y), logarithm, y)))


def test_a_value_only_in_the_loop_is_not_hidden_in_a_branch_before_it() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    xi = g.input("rule", 0, varying=True)
    logarithm = g.call(Op.LOG, x)
    chosen = g.branch(g.compare(Op.LT, x, y), logarithm, y)
    plan = schedule([g.sum(g.mul(g.mul(chosen, logarithm), xi))])
    assert logarithm in plain(plan.stages[0].before)
    assert_operands_first(plan.stages[0].before, set())


def test_branches_on_one_condition_share_an_if() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    condition = g.compare(Op.LT, x, y)
    logarithm = g.call(Op.LOG, x)
    first = g.branch(condition, logarithm, y)
    second = g.branch(condition, g.mul(y, logarithm), g.zero)
    statements = block(first, second)
    (chosen,) = ifs(statements)
    assert chosen.merged == [first, second]
    assert set(plain(chosen.then)) == {logarithm, second.args[1]}, "shared by the same side"


def test_a_branch_that_needs_another_on_the_same_condition_comes_after_it() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    condition = g.compare(Op.LT, x, y)
    first = g.branch(condition, g.call(Op.LOG, x), y)
    outside = g.call(Op.EXP, first)
    second = g.branch(condition, g.call(Op.SIN, outside), outside)
    statements = block(second)
    assert [c.merged for c in ifs(statements)] == [[first], [second]]
    assert plain(statements) == [condition, outside]


def test_branches_on_other_conditions_have_their_own_if() -> None:
    g = Graph()
    x, y, z = unknowns(g, 3)
    conditions = [g.compare(Op.LT, x, y), g.compare(Op.LT, y, z)]
    roots = [g.branch(c, g.call(Op.SIN, z), x) for c in conditions]
    statements = block(*roots)
    assert [c.merged for c in ifs(statements)] == [[r] for r in roots]
    assert g.call(Op.SIN, z) in plain(statements)


def test_nested_branches_nest() -> None:
    g = Graph()
    x, y, z = unknowns(g, 3)
    inner_condition = g.compare(Op.LT, y, z)
    deep = g.call(Op.LOG, y)
    inner = g.branch(inner_condition, deep, z)
    middle = g.mul(inner, z)
    outer_condition = g.compare(Op.LT, x, g.zero)
    root = g.branch(outer_condition, middle, x)
    statements = block(root)
    assert plain(statements) == [outer_condition]
    (outer,) = ifs(statements)
    assert plain(outer.then) == [inner_condition, middle]
    (nested,) = ifs(outer.then)
    assert nested.merged == [inner]
    assert plain(nested.then) == [deep]
    assert outer.otherwise == []


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


def test_branches_in_the_loop() -> None:
    g = Graph()
    (x,) = unknowns(g, 1)
    xi = g.input("rule", 0, varying=True)
    condition = g.compare(Op.LT, xi, x)
    logarithm = g.call(Op.LOG, g.add(xi, g.const(2)))
    root = g.sum(g.branch(condition, logarithm, g.mul(x, xi)))
    plan = schedule([root])
    body = loop_of(plan.stages[0].loop).body
    (chosen,) = ifs(body)
    assert plain(body) == [condition]
    assert plain(chosen.then) == [logarithm.args[0], logarithm]
    assert plain(chosen.otherwise) == [root.args[0].args[2]]
    # <, +, log, product, the choice itself and the addition to the sum
    assert plan.operations_per_point == 6


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
