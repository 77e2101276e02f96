"""Quadrature rules on [-1, 1] and Lagrange shape functions, to full working precision."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import pairwise

from tests.reference.differentiate import Number, Vector, mp, mpf


def legendre(order: int, x: Number) -> tuple[Number, Number]:
    """Legendre polynomial P_n(x) and P_{n-1}(x) by the three-term recurrence."""
    before, value = mpf(0), mpf(1)
    for k in range(order):
        before, value = value, ((2 * k + 1) * x * value - k * before) / (k + 1)
    return value, before


def legendre_slope(order: int, x: Number) -> Number:
    """P_n'(x) for |x| < 1."""
    value, before = legendre(order, x)
    return order * (x * value - before) / (x * x - 1)


def _bisected(function: Callable[[Number], Number], left: Number, right: Number) -> Number:
    """Root in a bracket: a few bisections, then secant steps to full precision."""
    sign = mp.sign(function(left))
    for _ in range(30):
        middle = (left + right) / 2
        if mp.sign(function(middle)) == sign:
            left = middle
        else:
            right = middle
    return mp.findroot(function, (left, right), solver="secant", tol=mpf(10) ** (-2 * mp.dps + 20))


def _roots(function: Callable[[Number], Number], count: int) -> Vector:
    """All roots of a polynomial in (-1, 1), in rising order."""
    samples = 64 * count + 1  # odd: the symmetric root 0 never falls on a sample
    grid = [mpf(2 * k - samples) / (samples + 1) for k in range(samples + 1)]
    roots = [_bisected(function, a, b) for a, b in pairwise(grid) if function(a) * function(b) < 0]
    if len(roots) != count:
        raise ValueError(f"{len(roots)} roots found, {count} expected")
    return roots


@lru_cache
def gauss(count: int) -> tuple[tuple[Number, ...], tuple[Number, ...]]:
    """Points and weights of the Gauss-Legendre rule."""
    points = _roots(lambda x: legendre(count, x)[0], count)
    weights = [2 / ((1 - x * x) * legendre_slope(count, x) ** 2) for x in points]
    return tuple(points), tuple(weights)


@lru_cache
def lobatto(count: int) -> tuple[tuple[Number, ...], tuple[Number, ...]]:
    """Points and weights of the Gauss-Lobatto-Legendre rule (both ends included)."""
    order = count - 1
    inner = _roots(lambda x: legendre_slope(order, x), count - 2) if count > 2 else []
    points = [mpf(-1), *inner, mpf(1)]
    weights = [2 / (count * order * legendre(order, x)[0] ** 2) for x in points]
    return tuple(points), tuple(weights)


def rule(kind: str, count: int) -> tuple[tuple[Number, ...], tuple[Number, ...]]:
    """Points and weights of the rule of that name."""
    return {"gauss": gauss, "lobatto": lobatto}[kind](count)


def lagrange(nodes: Sequence[Number], x: Number) -> tuple[Vector, Vector]:
    """Lagrange polynomials of the nodes and their derivatives at x, by the product formula."""
    values, slopes = [], []
    for i, node in enumerate(nodes):
        others = [other for j, other in enumerate(nodes) if j != i]
        scale = mp.fprod(node - other for other in others)
        values.append(mp.fprod(x - other for other in others) / scale)
        slopes.append(
            mp.fsum(
                mp.fprod(x - other for k, other in enumerate(others) if k != skipped)
                for skipped in range(len(others))
            )
            / scale
        )
    return values, slopes
