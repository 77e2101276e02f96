"""Every pass alone: the same value, the exact operation count, and what is lost without it."""

from __future__ import annotations

from fractions import Fraction

from softehl.codegen.emit.code_motion import schedule
from softehl.codegen.graph.evaluation import evaluate
from softehl.codegen.graph.graph import Graph, Node, Op
from softehl.codegen.graph.traversal import operations, reachable
from softehl.codegen.graph.verifier import check
from softehl.codegen.optimise import passes
from softehl.codegen.optimise.common_sums import common_sums
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


def test_common_factors_are_taken_out() -> None:
    g = Graph()
    x, y, z, w = unknowns(g, 4)
    root = g.sub(g.add(g.mul(x, y), g.mul(x, z)), g.mul(w, x))
    # three products, two sums; then x (y + z - w)
    assert costs(g, "common factors", root) == (5, 3, 3, 5)


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


# --------------------------------------------------------------------------------- all of them


def test_a_wrong_pass_is_seen() -> None:
    """The check that all tests above rest on refuses a pass that changes the value a little."""
    g = Graph()
    (x,) = unknowns(g, 1)
    root = g.power(x, 3)
    wrong = g.add(g.mul(x, g.mul(x, x)), g.const(Fraction(1, 10**30)))
    assert same_value(g.mul(x, g.mul(x, x)), root, AT)
    assert not same_value(wrong, root, AT)
    assert operations([wrong]) != operations([root])
