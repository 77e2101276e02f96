"""Lengths, and derivatives through them at zero: where f'(0) = 0, those of f(|x|) have limits.

A length is `root of q where q > 0, else 0`, q a sum of squares.  The derivative of f(n) by q is
f'(n) / (2 n), whose limit at zero is f''(0) / 2 if f'(0) = 0: the second derivative of f(|x|) is
then f''(0) I.  Where f'(0) is not zero there is a kink, and all derivatives at it are zero.
"""

from __future__ import annotations

from fractions import Fraction

from softehl.codegen.graph.graph import Graph, Node, Op

_SMALL = Fraction(1, 2**400)
"""Squares of lengths below which f' / n is its limit f'': the next term of f' is far below
rounding there, and the powers of 1 / n in third derivatives overflow."""
_ROUNDED = 1 + Fraction(1, 2**40)


def square_of(n: Node) -> Node | None:
    """The sum of squares of which a value is the length; None for other values."""
    if n.op is not Op.BRANCH:
        return None
    c, root, zero = n.args
    compared = c.op is Op.LT and _is_zero(c.args[0]) and _is_zero(zero)
    rooted = root.op is Op.SQRT or (root.op is Op.POW and root.payload == Fraction(1, 2))
    return c.args[1] if compared and rooted and root.args[0] is c.args[1] else None


def length(g: Graph, square: Node) -> Node:
    """The length of which `square` is the square."""
    positive = g.compare(Op.LT, g.zero, square)
    return g.branch(positive, g.power(square, Fraction(1, 2)), g.zero)


def slope(g: Graph, n: Node) -> Node:
    """Derivative of a length by its square; zero at zero."""
    return g.branch(n.args[0], g.mul(g.const(Fraction(1, 2)), g.recip(n.args[1])), g.zero)


def by_square(g: Graph, n: Node, slope: Node, curvature: Node, weighted: Node) -> Node:
    """Derivative of f(n) by the square of the length n.

    slope, curvature: f' and f''. weighted: f' / (2 n), a number where n > 0 only.
    """
    square, half = n.args[0].args[1], Fraction(1, 2)
    # f' = f'' n up to higher powers of n; with 1 < p < 2, f = n^p has no second derivative at 0
    bound = g.mul(g.const(_ROUNDED), g.mul(g.mul(curvature, curvature), square))
    smooth = g.compare(Op.LE, g.mul(slope, slope), bound)
    kinked = g.branch(n.args[0], weighted, g.zero)
    limit = g.branch(smooth, g.mul(g.const(half), curvature), kinked)
    return g.branch(g.compare(Op.LT, square, g.const(_SMALL)), limit, weighted)


def _is_zero(n: Node) -> bool:
    return n.op is Op.CONST and n.value == 0
