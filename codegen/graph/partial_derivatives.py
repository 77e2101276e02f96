"""Local derivatives of a node with respect to its operands."""

from __future__ import annotations

from fractions import Fraction

from softehl.codegen.graph.graph import BOOLEAN, Graph, Node, Op, Routine
from softehl.codegen.graph.length_derivatives import slope, square_of
from softehl.errors import SoftehlError

Partials = list[tuple[Node, Node]]


class DifferentiationError(SoftehlError, ValueError):
    """The model asks for a derivative that has no meaning in a kernel."""


def partials(g: Graph, n: Node) -> Partials:
    """Local derivatives of `n` with respect to its operands (of no SUM, of lengths of BRANCH)."""
    if not n.args or n.op in BOOLEAN or n.op is Op.CALL:
        return []
    if n.op is Op.ITEM:
        routine = n.args[0].payload
        assert isinstance(routine, Routine)
        return routine.partials(g, n)
    square = square_of(n)
    if square is not None:
        return [(square, slope(g, n))]
    a = n.args[0]
    match n.op:
        case Op.NAME:
            return [(a, g.one)]
        case Op.ADD:
            return [(a, g.one), (n.args[1], g.one)]
        case Op.SUB:
            return [(a, g.one), (n.args[1], g.neg(g.one))]
        case Op.MUL:
            b = n.args[1]
            return [(a, g.mul(g.const(2), a))] if a is b else [(a, b), (b, a)]
        case Op.NEG:
            return [(a, g.neg(g.one))]
        case Op.ATAN2:
            x = n.args[1]
            scale = g.recip(g.add(g.mul(a, a), g.mul(x, x)))
            return [(a, g.mul(x, scale)), (x, g.neg(g.mul(a, scale)))]
        case Op.POWER:
            return _of_power(g, n, a, n.args[1])
        case _:
            return [(a, _derivative_of_call(g, n, a))]


def _of_power(g: Graph, n: Node, a: Node, e: Node) -> Partials:
    """Derivatives of a^e by both; at a = 0 that by e >= 0 is 0, and e a^(e-1) is 0 for e = 0."""
    zero, origin = g.zero, g.compare(Op.EQ, a, g.zero)
    ended = g.node(Op.AND, (origin, g.compare(Op.EQ, e, zero)))
    by_base = g.branch(ended, zero, g.mul(e, g.general_power(a, g.sub(e, g.one))))
    rooted = g.node(Op.AND, (origin, g.compare(Op.LE, zero, e)))
    return [(a, by_base), (e, g.branch(rooted, zero, g.mul(n, g.call(Op.LOG, a))))]


def _derivative_of_call(g: Graph, n: Node, a: Node) -> Node:
    match n.op:
        case Op.RECIP:
            return g.neg(g.mul(n, n))
        case Op.POW:
            assert isinstance(n.payload, Fraction)
            return g.mul(g.const(n.payload), g.power(a, n.payload - 1))
        case Op.SQRT:
            return g.mul(g.const(Fraction(1, 2)), g.recip(n))
        case Op.CBRT:
            return g.mul(g.const(Fraction(1, 3)), g.recip(g.mul(n, n)))
        case Op.RCBRT:
            return g.neg(g.mul(g.const(Fraction(1, 3)), g.mul(n, g.recip(a))))
        case Op.LOG:
            return g.recip(a)
        case Op.EXP:
            return n
        case Op.SIN:
            return g.call(Op.COS, a)
        case Op.COS:
            return g.neg(g.call(Op.SIN, a))
        case Op.TAN:
            return g.add(g.one, g.mul(n, n))
        case Op.ASIN:
            return g.recip(g.call(Op.SQRT, _one_minus_square(g, a)))
        case Op.ACOS:
            return g.neg(g.recip(g.call(Op.SQRT, _one_minus_square(g, a))))
        case Op.ATAN:
            return g.recip(g.add(g.one, g.mul(a, a)))
        case Op.SINH:
            return g.call(Op.COSH, a)
        case Op.COSH:
            return g.call(Op.SINH, a)
        case Op.TANH:
            return g.sub(g.one, g.mul(n, n))
        case Op.ASINH:
            return g.recip(g.call(Op.SQRT, g.add(g.one, g.mul(a, a))))
        case Op.ACOSH:
            return g.recip(g.call(Op.SQRT, g.neg(_one_minus_square(g, a))))
        case Op.ATANH:
            return g.recip(_one_minus_square(g, a))
        case Op.ERF:
            return _bell(g, a)
        case Op.ERFC:
            return g.neg(_bell(g, a))
        case _:
            raise DifferentiationError(f"no derivative rule for {n.op}")


def _one_minus_square(g: Graph, a: Node) -> Node:
    """(1 - a)(1 + a), which keeps its digits near a = 1."""
    return g.mul(g.sub(g.one, a), g.add(g.one, a))


def _bell(g: Graph, a: Node) -> Node:
    """2 / sqrt(pi) exp(-a^2), the derivative of the error function."""
    scale = g.mul(g.const(2), g.recip(g.call(Op.SQRT, g.pi())))
    return g.mul(scale, g.call(Op.EXP, g.neg(g.mul(a, a))))
