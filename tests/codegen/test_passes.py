"""Every pass alone: the same value, the exact operation count, and what is lost without it."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import pytest

from softehl.codegen.abi import Task
from softehl.codegen.derive import task_outputs
from softehl.codegen.emit.code_motion import schedule
from softehl.codegen.graph.evaluation import evaluate
from softehl.codegen.graph.graph import Graph, Node, Op
from softehl.codegen.graph.traversal import operations, reachable
from softehl.codegen.graph.verifier import check
from softehl.codegen.models import ALL
from softehl.codegen.optimise import passes
from softehl.codegen.optimise.common_sums import common_sums
from softehl.codegen.optimise.factoring import factor
from softehl.codegen.optimise.passes import STANDARD, Pass
from tests.codegen.workshop import close, inputs, same_value, unknowns

AT = inputs("1.3", "0.7", "2.9", "0.41")


def applied(g: Graph, name: str, roots: list[Node]) -> list[Node]:
    return next(p for p in STANDARD if p.name == name).apply(g, roots)


def without(name: str) -> list[Pass]:
    """The compiler's passes less one (both rounds of common factors count as one)."""
    return [p for p in STANDARD if not p.name.startswith(name)]


def costs(g: Graph, name: str, root: Node) -> tuple[int, int, int, int]:
    """Operations before, after the pass alone, after all passes, after all the others."""
    (alone,) = applied(g, name, [root])
    (full,), _ = passes.run(g, [root], STANDARD)
    (rest,), _ = passes.run(g, [root], without(name))
    for new in (alone, full, rest):
        assert same_value(new, root, AT)
        check([new])
    return operations([root]), operations([alone]), operations([full]), operations([rest])


# ------------------------------------------------------------------------------ one pass, one graph


def test_an_inverse_next_to_its_root_is_a_power_of_it() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    volume = g.add(g.mul(x, x), g.mul(y, y))
    root = g.add(g.call(Op.RCBRT, volume), g.recip(volume))
    alone = g.recip(g.add(x, y))
    new = passes.inverses(g, [root, alone])
    assert same_value(new[0], root, AT)
    assert new[1] is alone
    check(new)
    # x x, y y, their sum, its root, its inverse or two products, the sum of both
    assert (operations([root]), operations([new[0]])) == (6, 7)
    divisions = [sum(n.op is Op.RECIP for n in reachable([r])) for r in (root, new[0])]
    assert divisions == [1, 0]
    straight = passes.straight_line([[Fraction(0), Fraction(2)]], (0, 0))
    rest = [p for p in straight if p.name != "inverses of roots"]
    kept = [passes.run(g, [root], p)[0] for p in (straight, rest)]
    assert [sum(n.op is Op.RECIP for n in reachable(r)) for r in kept] == [0, 1]


def test_fold_drops_names_and_what_they_hid() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    zero = g.name("zero", g.sub(g.one, g.one))
    two = g.name("two", g.const(2))
    hidden = g.add(g.mul(zero, g.call(Op.SIN, y)), g.mul(g.mul(two, two), x))
    (folded,) = passes.fold(g, [hidden])
    assert folded is g.mul(g.const(4), x)
    check([folded], names=False)
    assert same_value(folded, hidden, AT)
    # sin y, zero times it, two times two, times x, their sum; then 4 x
    assert (operations([hidden]), operations([folded])) == (5, 1)
    (rest,), _ = passes.run(g, [hidden], [p for p in without("fold") if p.name != "literals"])
    assert operations([rest]) == 5


def test_assume_drops_branches_that_are_decided() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    c = g.compare(Op.LT, x, y)
    inner = g.branch(c, g.call(Op.SIN, x), g.call(Op.COS, y))
    other = g.branch(c, g.call(Op.EXP, y), inner)
    root = g.branch(c, g.mul(inner, x), g.mul(other, y))
    # <, sin, cos, exp, two products, three branches; then <, sin, cos, two products, one branch
    assert costs(g, "assume", root) == (9, 6, 6, 9)
    assert same_value(passes.assume(g, [root])[0], root, inputs("0.7", "1.3"))


def test_assume_keeps_branches_on_other_conditions() -> None:
    g = Graph()
    x, y, z = unknowns(g, 3)
    inner = g.branch(g.compare(Op.LT, y, z), x, y)
    root = g.branch(g.compare(Op.LT, x, z), inner, g.mul(inner, z))
    assert passes.assume(g, [root]) == [root]
    assert passes.assume(g, [g.mul(x, y)]) == [g.mul(x, y)]


def test_assume_takes_time_in_proportion_to_branches_that_do_not_decide_each_other() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    for _ in range(40):
        x = g.branch(g.compare(Op.LT, x, y), g.call(Op.SIN, x), g.call(Op.COS, x))
    before = g.call(Op.EXP, x).id
    assert passes.assume(g, [x]) == [x]
    assert g.call(Op.LOG, x).id == before + 1  # nothing was built on the way


def test_powers_share_squares_and_one_reciprocal() -> None:
    g = Graph()
    (x,) = unknowns(g, 1)
    terms = [g.power(x, e) for e in (2, 4, -2, Fraction(1, 2), Fraction(-3, 2), Fraction(2, 3))]
    root = terms[0]
    for t in terms[1:]:
        root = g.add(root, t)
    # six powers, five sums; then x^2, x^4, 1/x, (1/x)^2, sqrt, sqrt(1/x), its square and cube,
    # r = x^(-1/3), r^2, x r^2, its square, five sums: no call of pow is left
    assert costs(g, "powers", root)[:2] == (11, 17)
    (cheap,) = passes.powers(g, [root])
    assert Op.POW in {n.op for n in reachable([root])}
    assert Op.POW not in {n.op for n in reachable([cheap])}
    (rest,), _ = passes.run(g, [root], without("powers"))
    assert sum(n.op is Op.POW for n in reachable([rest])) == 6


def test_powers_find_products_that_are_there_already() -> None:
    g = Graph()
    (x,) = unknowns(g, 1)
    square = g.mul(x, x)
    root = g.add(g.power(x, 2), g.mul(square, g.call(Op.SIN, square)))
    assert costs(g, "powers", root) == (5, 4, 4, 5)


@pytest.mark.parametrize(
    ("exponent", "count"),
    [(2, 1), (3, 2), (4, 2), (5, 3), (7, 4), (8, 3), (15, 6), (-3, 3), (Fraction(-2, 3), 2)],
)
def test_a_power_costs_as_many_products_as_its_binary_digits(
    exponent: Fraction | int, count: int
) -> None:
    g = Graph()
    (x,) = unknowns(g, 1)
    root = g.power(x, exponent)
    (cheap,) = passes.powers(g, [root])
    assert operations([cheap]) == count
    assert same_value(cheap, root, AT)


def test_other_exponents_stay_powers() -> None:
    g = Graph()
    (x,) = unknowns(g, 1)
    root = g.power(x, Fraction(7, 5))
    assert passes.powers(g, [root]) == [root]


def test_invariants_first_moves_products_out_of_the_loop() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    xi = g.input("rule", 0, varying=True)
    body = g.mul(g.mul(g.mul(g.call(Op.SIN, xi), x), g.mul(g.const(3), y)), g.call(Op.EXP, xi))
    (moved,) = passes.invariants_first(g, [g.sum(body)])
    at = {**AT, ("rule", 0): "0.3"}
    assert same_value(moved, g.sum(body), at)
    assert operations([g.sum(body)]) == operations([moved]) == 6
    before, after = schedule([g.sum(body)]), schedule([moved])
    # sin, exp, three products in the loop and its addition; then sin, exp, two products
    assert (before.operations_once, before.operations_per_point) == (1, 6)
    assert (after.operations_once, after.operations_per_point) == (2, 5)
    full, rest = (
        schedule(passes.run(g, [g.sum(body)], p)[0]) for p in (STANDARD, without("invariants"))
    )
    assert full.operations_per_point < rest.operations_per_point


def test_invariants_first_keeps_shared_products() -> None:
    g = Graph()
    x, y, z = unknowns(g, 3)
    shared = g.mul(x, y)
    roots = [g.mul(shared, z), g.call(Op.SIN, shared)]
    assert passes.invariants_first(g, roots) == roots


def test_common_factors_are_taken_out() -> None:
    g = Graph()
    x, y, z, w = unknowns(g, 4)
    root = g.sub(g.add(g.mul(x, y), g.mul(x, z)), g.mul(w, x))
    # three products, two sums; then x (y + z - w)
    assert costs(g, "common factors", root) == (5, 3, 3, 5)


def test_the_most_frequent_factor_is_taken_first() -> None:
    g = Graph()
    x, y, z, w = unknowns(g, 4)
    root = g.add(g.add(g.mul(y, g.mul(x, z)), g.mul(x, g.mul(y, w))), g.mul(y, g.call(Op.SIN, w)))
    # five products, two sums, a sine; then y (x (z + w) + sin w)
    assert costs(g, "common factors", root) == (8, 5, 5, 7)


def test_common_factors_leave_shared_products_and_plain_sums_alone() -> None:
    g = Graph()
    x, y, z = unknowns(g, 3)
    plain = g.add(g.mul(x, y), g.call(Op.SIN, z))
    assert factor(g, [plain]) == [plain]
    shared = g.mul(x, y)
    roots = [g.add(shared, g.mul(x, z)), g.call(Op.EXP, shared)]
    assert factor(g, roots) == roots, "x y is needed anyway"


def test_a_factor_alone_counts_as_times_one() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    root = g.add(x, g.mul(x, y))
    assert factor(g, [root]) == [g.mul(x, g.add(g.one, y))]
    assert costs(g, "common factors", root) == (2, 2, 2, 2)


def test_common_sums_are_added_once() -> None:
    g = Graph()
    x, y, z, w = unknowns(g, 4)
    roots = [g.add(g.add(x, z), y), g.sub(g.add(x, w), g.neg(y)), g.sub(g.sub(z, x), y)]
    # two sums in each; then x + y once, and one in each
    assert operations(roots) == 6
    shared = common_sums(g, roots)
    assert operations(shared) == 4
    assert all(same_value(a, b, AT) for a, b in zip(shared, roots, strict=True))
    full, _ = passes.run(g, roots, STANDARD)
    rest, _ = passes.run(g, roots, without("common sums"))
    assert (operations(full), operations(rest)) == (4, 6)


def test_common_sums_keep_every_constant() -> None:
    """2 (1 + 9/4 x) + (2 + y): twice one and the two are equal numbers and both count."""
    g = Graph()
    x, y = unknowns(g, 2)
    two = g.const(2)
    scaled = g.mul(two, g.add(g.one, g.mul(g.const(Fraction(9, 4)), x)))
    root = g.add(scaled, g.add(two, y))
    (shared,) = common_sums(g, [root])
    assert same_value(shared, root, AT)
    # 9/4 x, 1 + ., 2 ., 2 + y, their sum; then 9/2 x, + y, + 4
    assert (operations([root]), operations([shared])) == (5, 3)


def test_common_sums_leave_products_alone() -> None:
    g = Graph()
    x, y, z = unknowns(g, 3)
    roots = [g.add(g.mul(x, y), z), g.mul(g.sub(x, y), z)]
    assert common_sums(g, roots) == roots


def test_loops_are_written_out() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    xi, weight = (g.input("rule", k, varying=True) for k in (0, 1))
    body = g.mul(weight, g.mul(g.call(Op.EXP, g.mul(x, xi)), g.call(Op.LOG, y)))
    root = g.mul(g.sum(body), y)
    rule = (("-1/2", "1/3"), ("0", "2"), ("1", "1"))
    points = [[Fraction(t), Fraction(w)] for t, w in rule]
    (straight,) = passes.unrolled(points).apply(g, [root])
    terms = [g.mul(g.const(w), g.call(Op.EXP, g.mul(x, g.const(t)))) for t, w in points]
    expected = g.mul(g.mul(g.add(g.add(terms[0], terms[1]), terms[2]), g.call(Op.LOG, y)), y)
    assert same_value(straight, expected, AT)
    nodes = reachable([straight])
    assert Op.SUM not in {n.op for n in nodes}
    assert not any(n.varying for n in nodes)
    # log y; x/2, its sign, exp, two products; exp(0) = 1, one product; exp, one product; two sums;
    # the factor y (with the loop: three products, exp, log and the factor)
    assert operations([root]) == 6
    assert operations([straight]) == 12
    assert schedule([straight]).operations_per_point == 0
    moved, _ = passes.run(g, [root], passes.straight_line(points))
    assert operations(moved) < operations([straight])
    assert close(evaluate(moved[0], AT), evaluate(expected, AT), 1e-15)


def test_literals_are_computed_at_compile_time() -> None:
    g = Graph()
    (x,) = unknowns(g, 1)
    root3 = g.call(Op.SQRT, g.const(3))
    constant = g.div(g.mul(g.const(2), g.pi()), g.mul(root3, g.const(3)))
    root = g.mul(constant, x)
    before, alone, full, rest = costs_in_double(g, root)
    assert (before, alone, full) == (6, 1, 1)
    assert rest > full


def costs_in_double(g: Graph, root: Node) -> tuple[int, int, int, int]:
    """Like `costs`; literals are doubles, so that values agree to 16 digits only."""
    (alone,) = passes.literals(g, [root])
    (full,), _ = passes.run(g, [root], STANDARD)
    (rest,), _ = passes.run(g, [root], without("literals"))
    for new in (alone, full, rest):
        assert close(evaluate(new, AT), evaluate(root, AT), 2e-16)
    return operations([root]), operations([alone]), operations([full]), operations([rest])


def test_literals_are_rounded_once() -> None:
    g = Graph()
    (x,) = unknowns(g, 1)
    (root,) = passes.literals(g, [g.mul(g.mul(g.const(11), g.pi()), x)])
    (literal,) = [n for n in reachable([root]) if n.op is Op.CONST]
    with mpmath.workdps(50):
        assert float(literal.value) == float(11 * mpmath.pi)


def test_literals_keep_exact_constants_exact_and_conditions_logical() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    root = g.add(g.mul(g.const(Fraction(1, 3)), x), y)
    assert passes.literals(g, [root]) == [root]
    decided = g.branch(g.compare(Op.LT, g.pi(), g.const(3)), x, y)
    assert passes.literals(g, [decided]) == [y]
    open_ = g.branch(g.compare(Op.LT, g.pi(), x), x, y)
    (kept,) = passes.literals(g, [open_])
    check([kept])
    assert kept.op is Op.BRANCH


# --------------------------------------------------------------------------------- all of them


def test_trace_has_one_row_a_pass_and_the_input_first() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    root = g.add(g.mul(x, g.power(y, 2)), g.mul(x, g.name("n", y)))
    (result,), trace = passes.run(g, [root], STANDARD)
    assert [row.name for row in trace] == ["input", *(p.name for p in STANDARD)]
    assert trace[0].operations == operations([root]) == 4
    assert trace[0].nodes == len(reachable([root])) == 7
    assert trace[-1].operations == operations([result]) == 3  # x y (y + 1)
    assert trace[-1].nodes == len(reachable([result])) == 6
    by_name = {row.name: row.operations for row in trace}
    assert by_name["fold"] == 4
    assert by_name["common factors"] == 3


def test_no_passes_change_nothing() -> None:
    g = Graph()
    (x,) = unknowns(g, 1)
    roots, trace = passes.run(g, [g.neg(x)], [])
    assert roots == [g.neg(x)]
    assert [row.name for row in trace] == ["input"]


def test_a_wrong_pass_is_seen() -> None:
    """The check that all tests above rest on refuses a pass that changes the value a little."""
    g = Graph()
    (x,) = unknowns(g, 1)
    root = g.power(x, 3)
    wrong = g.add(g.mul(x, g.mul(x, x)), g.const(Fraction(1, 10**30)))
    assert same_value(g.mul(x, g.mul(x, x)), root, AT)
    assert not same_value(wrong, root, AT)
    assert operations([wrong]) != operations([root])


TRADES = ("assume", "powers")
"""Passes that may write more operations for cheaper ones: one side of a branch, roots of roots."""


SOME = ("solid_taylor_mean", "contact_corner", "film", "film_rough", "film_eyring", "axial_spring")


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (n not in SOME)) for n in ALL]
)
def test_graphs_of_shipped_models_stay_legal_and_get_cheaper(name: str) -> None:
    d = ALL[name]()
    for task in task_outputs.tasks(d):
        roots = [x.node for x in task_outputs.outputs(d, task)]
        check(roots)
        first = operations(roots)
        for p in STANDARD:
            varying = [r.varying for r in roots]
            roots = p.apply(d.graph, roots)
            check(roots, names=False)
            assert len(roots) == len(varying)
            if p.name in TRADES:
                first = max(first, operations(roots))
        assert operations(roots) <= first
        if task is Task.TANGENT:
            assert operations(roots) < first or name == "axial_spring"
