"""The graph: interning, exact numbers, identities, order, variation with the point."""

from __future__ import annotations

from fractions import Fraction

import pytest

from softehl.codegen.graph.graph import Graph, Op
from tests.codegen.workshop import unknowns


def test_equal_expressions_are_one_node() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    before = len(g)
    first = g.call(Op.LOG, g.add(g.mul(x, y), g.const(3)))
    size = len(g)
    second = g.call(Op.LOG, g.add(g.mul(x, y), g.const(3)))
    assert first is second
    assert len(g) == size == before + 4  # 3, x y, x y + 3, log


def test_what_differs_is_not_one_node() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    assert x is not y
    assert g.sub(x, y) is not g.sub(y, x)
    assert g.power(x, Fraction(1, 2)) is not g.power(x, Fraction(1, 3))
    assert g.name("a", x) is not g.name("b", x)
    assert g.name("a", x) is g.name("a", x)
    assert g.input("dofs", 0) is not g.input("data", 0)
    assert g.input("dofs", 0) is not g.input("dofs", 0, varying=True)
    assert g.compare(Op.LT, x, y) is not g.compare(Op.LE, x, y)


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


def test_signs_are_pulled_outwards() -> None:
    g = Graph()
    x, y = unknowns(g, 2)
    minus_x, minus_y = g.neg(x), g.neg(y)
    assert g.neg(minus_x) is x
    assert g.neg(g.sub(x, y)) is g.sub(y, x)
    assert g.add(x, minus_y) is g.add(minus_y, x) is g.sub(x, y)
    assert g.add(minus_x, minus_y) is g.neg(g.add(x, y))
    assert g.sub(x, minus_y) is g.add(x, y)
    assert g.sub(minus_x, y) is g.neg(g.add(x, y))
    assert g.sub(g.zero, x) is minus_x
    assert g.mul(minus_x, y) is g.mul(x, minus_y) is g.neg(g.mul(x, y))
    assert g.mul(minus_x, minus_y) is g.mul(x, y)
    assert g.mul(g.const(-2), x) is g.neg(g.mul(g.const(2), x))
    assert g.recip(minus_x) is g.neg(g.recip(x))
    assert g.sum(minus_x) is g.neg(g.sum(x))
    assert g.neg(g.const(5)).value == -5


def test_varying_follows_the_operands_up_to_a_sum() -> None:
    g = Graph()
    (x,) = unknowns(g, 1)
    xi = g.input("rule", 0, varying=True)
    inside = g.mul(x, g.call(Op.EXP, xi))
    assert not x.varying
    assert xi.varying
    assert inside.varying
    total = g.sum(inside)
    assert not total.varying
    assert not g.add(total, x).varying
    assert g.mul(total, xi).varying
    condition = g.compare(Op.LT, xi, x)
    assert condition.varying
    assert g.branch(condition, x, g.zero).varying
    assert g.name("n", inside).varying
