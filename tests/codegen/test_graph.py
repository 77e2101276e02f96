"""The graph: constants, identities, value numbering, what the verifier refuses, code motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Any

import mpmath
import pytest
import sympy as sp
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from softehl.codegen.emit.code_motion import If, Loop, Statement, schedule
from softehl.codegen.graph.evaluation import evaluate
from softehl.codegen.graph.graph import Graph, Node, Op
from softehl.codegen.graph.prime_field import PRIME, close_rational
from softehl.codegen.graph.traversal import operations
from softehl.codegen.graph.verifier import ARITY, IllegalGraphError, check
from softehl.codegen.language.sympy_lowering import Lowering
from softehl.codegen.optimise.passes import powers
from softehl.codegen.optimise.value_numbering import merge_equal_values
from tests.codegen.random_models import UNKNOWNS, Digits, K, Meaning, OutsideError, Recipe
from tests.codegen.random_models import expressions as random_expressions
from tests.codegen.workshop import inputs, same_value, unknowns

# --- The graph: interning, exact numbers, identities, order, variation with the point -------------


def test_constants_are_exact() -> None:
    g = Graph()
    third = g.const(Fraction(1, 3))
    total = g.add(g.add(third, third), third)
    assert total is g.one
    assert g.mul(third, g.const(3)) is g.one
    assert g.recip(third).value == 3
    assert g.sub(third, g.const(Fraction(1, 7))).value == Fraction(4, 21)
    assert g.power(third, -4).value == 81
    assert g.const(10**30 + 1) is not g.const(10**30)
    assert g.const(Fraction(2, 4)) is g.const(Fraction(1, 2))


def test_division_by_exact_zero_is_an_error() -> None:
    g = Graph()
    with pytest.raises(ZeroDivisionError, match="exact zero"):
        g.recip(g.zero)
    with pytest.raises(ZeroDivisionError):
        g.div(g.one, g.zero)


def test_identities() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    two = g.const(2)
    assert g.add(x, g.zero) is g.add(g.zero, x) is x
    assert g.sub(x, g.zero) is x
    assert g.sub(x, x) is g.zero
    assert g.add(x, x) is g.mul(two, x)
    assert g.mul(x, g.one) is g.mul(g.one, x) is x
    assert g.mul(x, g.zero) is g.mul(g.zero, x) is g.zero
    assert g.mul(two, g.mul(g.const(3), x)) is g.mul(g.const(6), x)
    assert g.mul(g.const(Fraction(1, 2)), g.mul(two, x)) is x
    assert g.mul(x, g.recip(x)) is g.mul(g.recip(x), x) is g.one
    assert g.recip(g.recip(x)) is x
    assert g.power(x, 0) is g.one
    assert g.power(x, 1) is x
    assert g.power(x, -1) is g.recip(x)
    assert g.power(g.power(x, Fraction(1, 3)), 3) is x
    assert g.call(Op.LOG, g.one) is g.zero
    assert g.call(Op.EXP, g.zero) is g.one
    assert g.call(Op.SQRT, g.zero) is g.call(Op.CBRT, g.zero) is g.zero
    assert g.call(Op.SQRT, g.one) is g.call(Op.CBRT, g.one) is g.call(Op.RCBRT, g.one) is g.one
    assert g.sum(g.zero) is g.zero
    condition = g.compare(Op.LT, x, y)
    assert g.branch(condition, x, x) is x
    assert g.branch(g.node(Op.NOT, (condition,)), x, y) is g.branch(condition, y, x)


def test_even_root_of_an_even_power_is_not_the_base() -> None:
    """(x^2)^(1/2) is |x|: only integer outer exponents may be merged."""
    g = Graph()
    (x,) = unknowns(g, 1)
    square = g.power(x, 2)
    root = g.power(square, Fraction(1, 2))
    assert root.op is Op.POW
    assert root.args == (square,)


# --- Merging of equal values: never two different ones, always two that algebra proves equal ------


x, y, z = UNKNOWNS
TINY = sp.Rational(1, 10**25)
STATES = (("1.3", "0.7", "0.9"), ("-1.3", "0.7", "-0.9"), ("0.2", "-2.1", "1.6"))


def lowered(*expressions: Any) -> tuple[Graph, list[Node]]:
    g = Graph()
    bound = {s: g.input("dofs", k) for k, s in enumerate((*UNKNOWNS, K))}
    lower = Lowering(g, bound)
    return g, [lower(e) for e in expressions]


def merged(*expressions: Any) -> tuple[list[Node], list[Node]]:
    """Roots before and after."""
    g, roots = lowered(*expressions)
    return roots, merge_equal_values(g, roots)


def same_everywhere(before: list[Node], after: list[Node]) -> bool:
    return all(
        same_value(a, b, inputs(*s)) for s in STATES for a, b in zip(after, before, strict=True)
    )


UNEQUAL = {
    "absolute value and itself": (sp.Abs(x), x),
    "root of a product square": (sp.Pow(x**2 * y**2, sp.Rational(1, 2), evaluate=False), x * y),
    "root of a square": (sp.Pow(x**2, sp.Rational(1, 2), evaluate=False), x),
    "logarithm of a square": (sp.log(x**2), 2 * sp.log(x)),
    "root of a product": (sp.sqrt(x * y), sp.sqrt(x) * sp.sqrt(y)),
    "equal on one side": (sp.Piecewise((x * y, x > 0), (x * z, True)), x * y),
    "equal on the other side": (sp.Piecewise((x * z, x < 0), (x * y, True)), x * y),
    "branches swapped": (
        sp.Piecewise((sp.sin(x), x < y), (sp.cos(x), True)),
        sp.Piecewise((sp.cos(x), x < y), (sp.sin(x), True)),
    ),
    "maximum and the larger": (sp.Max(x, -2), x),
    "25 digits": (x * y + sp.sin(x), (x * y + sp.sin(x)) * (1 + TINY)),
    "25 digits in an argument": (sp.exp(x * y), sp.exp(x * y + TINY)),
    "up to a constant": (x * y, x * y + TINY),
    "twice": (x * y, 2 * x * y),
    "reciprocals": (1 / (x * y), x * y),
    # equal, or equal to 30 digits, near the undeformed state and with parameters about 1
    "saturated logistic function": (1 + 9 / (1 + sp.exp((1000 - x) / 10)), 1 + 0 * x + TINY),
    "logistic functions far apart": (x / (1 + sp.exp(1000 - x)), x / (1 + sp.exp(2000 - x))),
    "saturated tangents": (x * sp.tanh(500 * (y + 2)), x * sp.tanh(600 * (y + 2))),
    "arc of a sine": (sp.asin(sp.sin(x)), x),
    "arc tangent of two": (sp.atan2(sp.sin(x), sp.cos(x)), x),
    "root of a square far away": (sp.sqrt(x**2 - 10 * x + 25), 5 - x),
    "sign far away": (x * sp.sign(y + 50), x * sp.sign(y + 51)),
}

EQUAL = {
    "expanded square": ((x + y) ** 2, x**2 + 2 * x * y + y**2),
    "order of a product": (x * (y * z), sp.Mul(sp.Mul(x, y, evaluate=False), z, evaluate=False)),
    "up to sign": ((x - y) * z, (y - x) * z),
    "difference of squares": ((x + y) * (x - y), x**2 - y**2),
    "arguments of a function": (sp.sin((x + y) ** 2), sp.sin(x**2 + 2 * x * y + y**2)),
    "odd functions": (sp.tanh((x - y) * z), sp.tanh((y - x) * z)),
    "fractions": (1 / x + 1 / y, (x + y) / (x * y)),
    "powers of one root": (
        (2 + x**2) ** sp.Rational(9, 7),
        (2 + x**2) * (2 + x**2) ** sp.Rational(2, 7),
    ),
    "conditions": (
        sp.Piecewise((x, (x + y) ** 2 < z), (y, True)),
        sp.Piecewise((x, x**2 + 2 * x * y + y**2 < z), (y, True)),
    ),
    "cube roots": ((1 + x**2) ** sp.Rational(2, 3), ((1 + x**2) ** sp.Rational(1, 3)) ** 2),
}


@pytest.mark.parametrize("name", UNEQUAL)
def test_different_values_stay_different(name: str) -> None:
    before, after = merged(*UNEQUAL[name])
    check(after)
    assert same_everywhere(before, after)
    assert len({n.id for n in after}) == len(after)


@pytest.mark.parametrize("name", EQUAL)
def test_equal_values_are_computed_once(name: str) -> None:
    before, after = merged(*EQUAL[name])
    check(after)
    assert same_everywhere(before, after)
    first, second = (n.args[0] if n.op is Op.NEG else n for n in after)
    assert first is second
    assert operations(after) < operations(before) or before[0] is before[1]


def test_equality_with_a_branch_inside_is_found_outside_of_it() -> None:
    """What is made of one branch in two ways is equal; the branch stands for itself."""
    side = sp.Piecewise((sp.log(x), x > 0), (y, True))
    before, after = merged((side + y) * z, side * z + y * z)
    assert same_everywhere(before, after)
    assert after[0] is after[1]


def test_a_value_that_varies_is_not_one_that_does_not() -> None:
    g = Graph()
    xi, u = g.input("rule", 0, varying=True), g.input("dofs", 0)
    roots = [g.mul(g.mul(u, u), g.call(Op.EXP, u)), g.mul(xi, g.mul(u, g.call(Op.EXP, u)))]
    assert merge_equal_values(g, roots) == roots


def test_a_false_merge_would_be_seen() -> None:
    """What the tests above rest on refuses 25 equal digits."""
    _, (a, b) = lowered(*UNEQUAL["25 digits"])
    assert not same_everywhere([a], [b])
    assert same_everywhere([a], [a])


def value(e: Any, state: dict[Any, float]) -> Any:
    """A SymPy expression in 50 digits, without the compiler."""
    recipe = Recipe((), (), sp.Integer(0), e, "", e, False)
    return Digits(Meaning(recipe), state)(e)[0]


@settings(
    derandomize=True,
    max_examples=25,
    database=None,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)
@given(st.lists(random_expressions((*UNKNOWNS, K), 4), min_size=2, max_size=4))
def test_merging_keeps_random_values_as_they_were_written(expressions: list[Any]) -> None:
    """Together with near copies: each times 1 + 1e-25, squared and rooted, and expanded."""
    near = [e * (1 + TINY) for e in expressions]
    again = [(e + x) ** 2 - e**2 - 2 * e * x for e in expressions]
    written = [*expressions, *near, *again]
    g, roots = lowered(*written)
    after = merge_equal_values(g, roots)
    check(after)
    for numbers in ((0.7, -0.4, 1.3, 0.9), (-1.1, 0.6, 0.35, -0.8)):
        state = dict(zip((*UNKNOWNS, K), numbers, strict=True))
        at = {("dofs", k): v for k, v in enumerate(numbers)}
        for e, n in zip(written, after, strict=True):
            try:
                expected = value(e, state)
            except OutsideError:
                continue
            with mpmath.workdps(50):
                assert abs(evaluate(n, at) - expected) <= mpmath.mpf(10) ** -38 * (
                    1 + abs(expected)
                )


def test_a_value_is_not_replaced_by_one_with_a_smaller_domain() -> None:
    """u v w / v has no value at v = 0, u w has one: the second stands for the first only."""
    g = Graph()
    u, v, w = (g.input("dofs", k) for k in range(3))
    hidden = g.mul(g.mul(g.mul(u, v), w), g.recip(v))
    plain = g.mul(u, w)
    later = g.mul(g.mul(g.mul(g.recip(v), w), u), v)
    assert merge_equal_values(g, [hidden, plain]) == [hidden, plain]
    assert merge_equal_values(g, [plain, later]) == [plain, plain]


def test_points_of_gauss_rules_multiply_exactly() -> None:
    """3 r^2 = 1 for the r that stands for 1 / sqrt(3), though r is a rational number."""
    for number in (1 / sp.sqrt(3), -sp.sqrt(sp.Rational(3, 5)), (5 + 3 * sp.sqrt(5)) / 20):
        r = close_rational(number)
        assert abs(sp.N(sp.Rational(r.numerator, r.denominator) - number, 100)) < 1e-60
    g = Graph()
    u = g.input("dofs", 0)
    r = close_rational(1 / sp.sqrt(3))
    roots = [g.mul(g.const(Fraction(1, 3)), g.call(Op.EXP, u)), g.call(Op.EXP, u)]
    roots[1] = g.mul(g.const(r * r), roots[1])
    after = merge_equal_values(g, roots)
    assert after[0] is after[1]


def test_the_prime_has_the_roots_that_the_proof_asks_for() -> None:
    assert sp.isprime(PRIME)
    assert sp.isprime((PRIME - 1) // 2)
    assert all(pow(n, (PRIME - 1) // 2, PRIME) == 1 for n in (2, 3, 5, 7, 11, 13))


def test_a_third_power_has_its_value_at_zero() -> None:
    """x^(4/3) is made of x^(-1/3), which has none."""
    g, roots = lowered(x ** sp.Rational(4, 3))
    (cheap,) = powers(g, roots)
    assert evaluate(cheap, {("dofs", 0): 0}) == 0
    assert same_value(cheap, roots[0], inputs("1.3"))


# --- Every rule of the graph's specification is violated once, and the message shows the node -----


def test_a_legal_graph_passes() -> None:
    g = Graph()
    x, xi = g.input("dofs", 0), g.input("rule", 0, varying=True)
    condition = g.node(Op.NOT, (g.compare(Op.EQ, x, g.zero),))
    both = g.node(Op.AND, (condition, g.compare(Op.LT, x, g.pi())))
    inner = g.node(Op.BRANCH, (both, g.recip(x), g.power(x, Fraction(1, 5))))
    check([g.name("total", g.sum(g.mul(xi, inner)))])


def test_number_of_operands() -> None:
    g = Graph()
    x = g.input("dofs", 0)
    for op, args in ((Op.ADD, (x,)), (Op.LOG, (x, x)), (Op.BRANCH, (x, x)), (Op.PI, (x,))):
        with pytest.raises(IllegalGraphError, match=f"{op} takes {ARITY[op]} operands"):
            check([g.node(op, args)])


def test_payload() -> None:
    g = Graph()
    x = g.input("dofs", 0)
    wrong = [
        g.node(Op.CONST, (), "three"),
        g.node(Op.INPUT, (), Fraction(1)),
        g.node(Op.NAME, (x,)),
        g.node(Op.POW, (x,)),
        g.node(Op.MUL, (x, x), Fraction(2)),
    ]
    for n in wrong:
        with pytest.raises(IllegalGraphError, match=f"#{n.id} .*payload of a wrong kind"):
            check([n])


def test_operands_are_older() -> None:
    g = Graph()
    x = g.input("dofs", 0)
    young = g.call(Op.SIN, x)
    early = Node(young.id, Op.NEG, (young,), None, False)
    with pytest.raises(IllegalGraphError, match="younger"):
        check([Node(young.id + 1, Op.NEG, (early,), None, False), early])


def test_names_do_not_survive_the_passes() -> None:
    g = Graph()
    root = g.neg(g.name("h", g.input("dofs", 0)))
    check([root])
    with pytest.raises(IllegalGraphError, match="a name survived"):
        check([root], names=False)


def test_a_sum_does_not_vary() -> None:
    g = Graph()
    xi = g.input("rule", 0, varying=True)
    check([g.sum(xi)])
    with pytest.raises(IllegalGraphError, match="cannot vary"):
        check([Node(len(g), Op.SUM, (xi,), None, True)])


def test_conditions_belong_to_branches_and_logic_only() -> None:
    g = Graph()
    x = g.input("dofs", 0)
    condition = g.compare(Op.LT, x, g.one)
    for op, args in (
        (Op.BRANCH, (x, x, g.one)),
        (Op.AND, (condition, x)),
        (Op.OR, (x, condition)),
        (Op.NOT, (x,)),
    ):
        with pytest.raises(IllegalGraphError, match=f"operand {args.index(x)} is no condition"):
            check([g.node(op, args)])
    for op, args in (
        (Op.ADD, (x, condition)),
        (Op.BRANCH, (condition, x, condition)),
        (Op.LT, (condition, x)),
        (Op.SUM, (condition,)),
    ):
        place = len(args) - 1 - args[::-1].index(condition)
        with pytest.raises(IllegalGraphError, match=f"operand {place} is a condition"):
            check([g.node(op, args)])


# --- Where values are computed: out of the loop, in stages, inside the branch that needs them -----


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
