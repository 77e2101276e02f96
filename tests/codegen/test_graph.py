"""The graph: interning, exact numbers, identities, order, variation with the point."""

from __future__ import annotations

from fractions import Fraction

import pytest

from softehl.codegen.graph.graph import Graph, Op
from tests.codegen.workshop import unknowns


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
