"""Lengths, and derivatives through them at zero: where f'(0) = 0, those of f(|x|) have limits.

A length is `root of q where q > 0, else 0`, q a sum of squares.  The derivative of f(n) by q is
f'(n) / (2 n), whose limit at zero is f''(0) / 2 if f'(0) = 0: the second derivative of f(|x|) is
then f''(0) I.  Where f'(0) is not zero there is a kink, and all derivatives at it are zero.  Where
f'' at zero is of the form inf * 0, as that of (n^2)^(3/2), its limit is taken near zero.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from fractions import Fraction

from softehl.codegen.graph.graph import Graph, Node, Op
from softehl.codegen.graph.traversal import reachable

_SMALL = Fraction(1, 2**400)
"""Squares of lengths below which f' / n is its limit f'': the next term of f' is far below
rounding there, and the powers of 1 / n in third derivatives overflow."""
_NEAR = Fraction(1, 2**100)
"""A length at which f'' is that at zero up to rounding, and powers of powers do not overflow."""
_ROUNDED = 1 + Fraction(1, 2**40)
_NEARLY = 1 + Fraction(1, 2**20)
"""(f' / (f'' n))^2 at `_NEAR`, at most: n^(1/4) is 2^-25 there, so f may be n^2 - n^(9/4)."""


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


def by_square(
    g: Graph,
    n: Node,
    derivatives: tuple[Node, Node],
    weighted: Node,
    *,
    exists: bool,
    fixed: Collection[Node] = (),
) -> Node:
    """Derivative of f(n) by the square of the length n.

    derivatives: f' and f''. weighted: f' / (2 n), a number where n > 0 only. exists: whether
    f'' is one for all finite arguments. fixed: values in f' that do not change with the length.
    """
    square, half = n.args[0].args[1], g.const(Fraction(1, 2))
    kinked = g.branch(n.args[0], weighted, g.zero)
    if exists:
        slope, curvature = derivatives
        smooth = _is_smooth(g, slope, curvature, square, _ROUNDED)
        limit = g.branch(smooth, g.mul(half, curvature), kinked)
    else:
        limit = _limit(g, n, derivatives, kinked, weighted, fixed)
    return g.branch(g.compare(Op.LT, square, g.const(_SMALL)), limit, weighted)


def _is_smooth(g: Graph, slope: Node, curvature: Node, square: Node, is_zero: Fraction) -> Node:
    """True if f' = f'' n up to higher powers of n: f = n^p with 1 < p < 2 has no f''(0)."""
    bound = g.mul(g.const(is_zero), g.mul(g.mul(curvature, curvature), square))
    return g.compare(Op.LE, g.mul(slope, slope), bound)


def _limit(
    g: Graph,
    n: Node,
    derivatives: Sequence[Node],
    kinked: Node,
    weighted: Node,
    fixed: Collection[Node],
) -> Node:
    """f''(0) / 2 where f'' may be of the form inf * 0 at zero: then that near zero."""
    square, half = n.args[0].args[1], g.const(Fraction(1, 2))
    is_zero = g.compare(Op.LE, square, g.const(_SMALL))

    def at(size: Fraction | int) -> list[Node]:
        # a branch: a constant zero would be folded, and inf * 0 with it
        return _moved(g, derivatives, n, g.branch(is_zero, g.const(size), n), fixed)

    first, second = at(0)
    smooth = g.node(Op.AND, (g.compare(Op.EQ, first, g.zero), _is_finite(g, second)))
    slope_near, bent = at(_NEAR)
    nearly = _is_smooth(g, slope_near, bent, g.const(_NEAR**2), _NEARLY)
    number = g.node(Op.AND, (_is_finite(g, slope_near), _is_finite(g, bent)))
    edge = g.branch(number, kinked, weighted)  # without a number there is none at all
    return g.branch(smooth, g.mul(half, second), g.branch(nearly, g.mul(half, bent), edge))


def _is_finite(g: Graph, a: Node) -> Node:
    largest = g.const(2**1000)
    below = g.compare(Op.LT, a, largest)
    return g.node(Op.AND, (g.compare(Op.LT, g.neg(largest), a), below))


def _moved(
    g: Graph, roots: Sequence[Node], n: Node, other: Node, fixed: Collection[Node]
) -> list[Node]:
    """Values with a length replaced by another value, without the names that this changes."""
    new = {n: other}
    for m in reachable(roots, stop=lambda m: m is n or m in fixed):
        if m in new:
            continue
        args = m.args if m in fixed else tuple(new[a] for a in m.args)
        if args == m.args:
            new[m] = m
        else:
            new[m] = args[0] if m.op is Op.NAME else g.rebuild(m.op, args, m.payload)
    return [new[r] for r in roots]


def _is_zero(n: Node) -> bool:
    return n.op is Op.CONST and n.value == 0
