"""Every rule of the graph's specification is violated once, and the message shows the node."""

from __future__ import annotations

from fractions import Fraction

import pytest

from softehl.codegen.graph.graph import Graph, Node, Op
from softehl.codegen.graph.verifier import ARITY, IllegalGraphError, check


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
