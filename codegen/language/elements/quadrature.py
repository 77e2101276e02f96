"""Default quadrature rules of the models, exact until they are printed."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import sympy as sp


@dataclass(frozen=True)
class QuadratureRule:
    """`points` (one tuple of parent coordinates each) and `weights`, exact SymPy numbers."""

    dimension: int
    points: tuple[tuple[sp.Expr, ...], ...]
    weights: tuple[sp.Expr, ...]


def point_rule() -> QuadratureRule:
    """The rule of a model without an integral: one point, no coordinates, weight one."""
    return QuadratureRule(0, ((),), (sp.Integer(1),))


def gauss(order: int, dimension: int) -> QuadratureRule:
    """Gauss-Legendre product rule with `order` (1, 2 or 3) points in each direction on [-1, 1]."""
    half = {
        1: ((sp.Integer(0), sp.Integer(2)),),
        2: ((-1 / sp.sqrt(3), sp.Integer(1)), (1 / sp.sqrt(3), sp.Integer(1))),
        3: (
            (-sp.sqrt(sp.Rational(3, 5)), sp.Rational(5, 9)),
            (sp.Integer(0), sp.Rational(8, 9)),
            (sp.sqrt(sp.Rational(3, 5)), sp.Rational(5, 9)),
        ),
    }[order]
    grid = list(product(half, repeat=dimension))
    points = tuple(tuple(x for x, _ in entry) for entry in grid)
    return QuadratureRule(dimension, points, tuple(sp.prod([w for _, w in e]) for e in grid))
