"""Default quadrature rules of the models, exact until they are printed."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import product
from typing import Any

import sympy as sp

from softehl.codegen.graph.prime_field import close_rational

_DIGITS = 100
"""Of the points that have no short exact form."""


@dataclass(frozen=True)
class QuadratureRule:
    """Points and weights of a reference cell, exact.

    Attributes
    ----------
    dimension : int
        Dimension of the cell.
    points : tuple of tuple of Expr
        Coordinates of each point.
    weights : tuple of Expr
        Weight of each point.
    """

    dimension: int
    points: tuple[tuple[sp.Expr, ...], ...]
    weights: tuple[sp.Expr, ...]

    def __repr__(self) -> str:
        """Summary in one line."""
        return f"<QuadratureRule: {len(self.weights)} points in {self.dimension}-D>"

    def rows(self) -> list[list[Fraction]]:
        """Return the rule in rational numbers.

        Returns
        -------
        list of list of Fraction
            (coordinates, weight) of each point, to 60 digits or more.
        """
        pairs = zip(self.points, self.weights, strict=True)
        return [[close_rational(x) for x in (*p, w)] for p, w in pairs]


def point_rule() -> QuadratureRule:
    """Return the rule of a model without an integral: one point, no coordinates, weight one.

    Returns
    -------
    QuadratureRule
        The rule.
    """
    return QuadratureRule(0, ((),), (sp.Integer(1),))


def gauss(order: int, dimension: int) -> QuadratureRule:
    """Return the product rule of Gauss and Legendre on [-1, 1] in each direction.

    Parameters
    ----------
    order : int
        Number of points in each direction; they are exact up to 3, rational to 100 digits above.
    dimension : int
        Number of directions.

    Returns
    -------
    QuadratureRule
        The rule.

    Raises
    ------
    ValueError
        A number is below 1.
    """
    _require("gauss", "order", order)
    if dimension not in (1, 2, 3):
        raise ValueError(f"gauss({order}, {dimension}): the dimension is 1, 2 or 3")
    grid = list(product(_line(order), repeat=dimension))
    points = tuple(tuple(x for x, _ in entry) for entry in grid)
    return QuadratureRule(dimension, points, tuple(sp.prod([w for _, w in e]) for e in grid))


@cache
def lobatto(order: int) -> tuple[Any, ...]:
    """Return the inner points of Gauss and Lobatto in (-1, 1), rising.

    Parameters
    ----------
    order : int
        Order of a line, 1 to 6, whose nodes are both ends and these points.

    Returns
    -------
    tuple of Expr
        Coordinates, rational to 100 digits where they are no rational numbers.
    """
    root = sp.sqrt
    squares = {  # of the positive ones, roots of the derivative of Legendre's polynomial
        1: [],
        2: [],
        3: [sp.Rational(1, 5)],
        4: [sp.Rational(3, 7)],
        5: [(7 - 2 * root(7)) / 21, (7 + 2 * root(7)) / 21],
        6: [(15 - 2 * root(15)) / 33, (15 + 2 * root(15)) / 33],
    }
    if order not in squares:
        raise ValueError(f"lobatto: order = {order!r}; allowed is 1 to 6")
    right = [_rounded(sp.N(root(s), _DIGITS + 20)) for s in squares[order]]
    middle = [] if order % 2 else [sp.Integer(0)]
    return (*(-x for x in reversed(right)), *middle, *right)


def triangle(degree: int) -> QuadratureRule:
    """Return a rule on the unit triangle.

    Parameters
    ----------
    degree : int
        Degree of polynomials that it integrates exactly.

    Returns
    -------
    QuadratureRule
        Symmetric, of 1 and 3 points, up to degree 2; Gauss and Jacobi with collapsed sides above.

    Raises
    ------
    ValueError
        The degree is below 1.
    """
    _require("triangle", "degree", degree)
    third, sixth = sp.Rational(1, 3), sp.Rational(1, 6)
    if degree == 1:
        return QuadratureRule(2, ((third, third),), (sp.Rational(1, 2),))
    if degree == 2:
        high = sp.Rational(2, 3)
        return QuadratureRule(2, ((sixth, sixth), (high, sixth), (sixth, high)), (sixth,) * 3)
    return _collapsed(2, degree)


def tetrahedron(degree: int) -> QuadratureRule:
    """Return a rule on the unit tetrahedron.

    Parameters
    ----------
    degree : int
        Degree of polynomials that it integrates exactly.

    Returns
    -------
    QuadratureRule
        Symmetric, of 1 and 4 points, up to degree 2; Gauss and Jacobi with collapsed sides above.

    Raises
    ------
    ValueError
        The degree is below 1.
    """
    _require("tetrahedron", "degree", degree)
    if degree == 1:
        return QuadratureRule(3, ((sp.Rational(1, 4),) * 3,), (sp.Rational(1, 6),))
    if degree == 2:
        low, high = (5 - sp.sqrt(5)) / 20, (5 + 3 * sp.sqrt(5)) / 20
        points = ((low,) * 3, (high, low, low), (low, high, low), (low, low, high))
        return QuadratureRule(3, points, (sp.Rational(1, 24),) * 4)
    return _collapsed(3, degree)


def wedge(degree: int) -> QuadratureRule:
    """Return a rule on the unit triangle times [-1, 1].

    Parameters
    ----------
    degree : int
        Degree of polynomials in each that it integrates exactly.

    Returns
    -------
    QuadratureRule
        Product of a triangle's and a line's rule.

    Raises
    ------
    ValueError
        The degree is below 1.
    """
    flat, line = triangle(degree), _line(degree // 2 + 1)
    pairs = list(zip(flat.points, flat.weights, strict=True))
    points = tuple((*p, x) for p, _ in pairs for x, _ in line)
    return QuadratureRule(3, points, tuple(w * v for _, w in pairs for _, v in line))


def _require(rule: str, what: str, value: object) -> None:
    if type(value) is not int or value < 1:
        raise ValueError(f"{rule}: {what} = {value!r}, must be a whole number of at least 1")


def _line(order: int) -> tuple[tuple[Any, Any], ...]:
    """Points and weights of Gauss and Legendre on [-1, 1]."""
    if order == 1:
        return ((sp.Integer(0), sp.Integer(2)),)
    if order == 2:
        return tuple((s / sp.sqrt(3), sp.Integer(1)) for s in (-1, 1))
    if order == 3:
        high, middle, side = sp.sqrt(sp.Rational(3, 5)), sp.Rational(8, 9), sp.Rational(5, 9)
        return ((-high, side), (sp.Integer(0), middle), (high, side))
    return _jacobi(order, 0)


@cache
def _jacobi(order: int, power: int) -> tuple[tuple[Any, Any], ...]:
    """Points and weights for the weight (1 - x)^power on [-1, 1], as rational numbers."""
    x = sp.Symbol("x")
    polynomial = sp.Poly(sp.jacobi(order, power, 0, x), x)
    slope = polynomial.diff(x)
    pairs = []
    for root in sorted(sp.nroots(polynomial, n=_DIGITS + 20, maxsteps=500)):
        abscissa = sp.Rational(str(root))
        weight = 2 ** (power + 1) / ((1 - abscissa**2) * slope.eval(abscissa) ** 2)
        pairs.append((abscissa, _rounded(weight)))
    return tuple((_rounded(abscissa), weight) for abscissa, weight in pairs)


def _rounded(value: Any) -> Any:
    return sp.Rational(round(value * 10**_DIGITS), 10**_DIGITS)


def _collapsed(dimension: int, degree: int) -> QuadratureRule:
    """A cube's rule of Gauss and Jacobi, collapsed to the unit simplex."""
    order = degree // 2 + 1
    factors = [
        [((1 + x) / 2, w / 2 ** (power + 1)) for x, w in _jacobi(order, power)]
        for power in range(dimension)
    ]
    points, weights = [], []
    for entry in product(*factors):
        point = [x for x, _ in entry]
        shrunk = [x * sp.prod([1 - y for y in point[d + 1 :]]) for d, x in enumerate(point)]
        points.append(tuple(shrunk))
        weights.append(sp.prod([w for _, w in entry]))
    return QuadratureRule(dimension, tuple(points), tuple(weights))


def pyramid(degree: int) -> QuadratureRule:
    """Return a rule on the pyramid over [-1, 1]^2 with the apex (0, 0, 1).

    Gauss and Jacobi with a collapsed face; products of the rational shape functions of pyramids
    count as polynomials.

    Parameters
    ----------
    degree : int
        Degree of polynomials that are integrated exactly.

    Returns
    -------
    QuadratureRule
        The rule.

    Raises
    ------
    ValueError
        The degree is not a whole number of at least 1.
    """
    _require("pyramid", "degree", degree)
    order = degree // 2 + 1
    line = _line(order)
    height = [((1 + x) / 2, w / 8) for x, w in _jacobi(order, 2)]
    entries = list(product(line, line, height))
    points = tuple((x * (1 - z), y * (1 - z), z) for (x, _), (y, _), (z, _) in entries)
    return QuadratureRule(3, points, tuple(u * v * w for (_, u), (_, v), (_, w) in entries))
