"""Arbitrary-precision numbers and central differences: the only calculus of the references.

No symbolic or automatic differentiation is used here, so nothing can go wrong in the same way as in
the generator.  With 110 working digits and a step of 1e-25 the truncation error is about 1e-50 and
the rounding error of a nested (second) difference about 1e-60.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from mpmath import MPContext

mp = MPContext()  # private context: the precision of other users of mpmath is left alone
mp.dps = 110
mpf = mp.mpf
STEP = mpf("1e-25")
PI = +mp.pi

Number = Any  # mpmath ships no types
Vector = list[Any]
Matrix = list[list[Any]]
Potential = Callable[[Vector], Number]
"""Energy of an element by its unknowns."""


@dataclass(frozen=True)
class Arguments:
    """Exact arguments of an element beside its unknowns; kind, count: the rule of a film."""

    X: Vector
    parameters: Vector
    data: Vector
    kind: str = ""
    count: int = 0


def numbers(values: Iterable[float]) -> Vector:
    """Exact conversion of doubles (or of numbers that already are exact)."""
    return [value if isinstance(value, mpf) else mpf(float(value)) for value in values]


def _shifted(point: Sequence[Number], *shifts: tuple[int, Number]) -> Vector:
    moved = list(point)
    for index, step in shifts:
        moved[index] += step
    return moved


def gradient(function: Callable[[Vector], Number], point: Sequence[Number]) -> Vector:
    """First derivatives of a scalar function by central differences."""
    return [
        (function(_shifted(point, (i, STEP))) - function(_shifted(point, (i, -STEP)))) / (2 * STEP)
        for i in range(len(point))
    ]


def jacobian(function: Callable[[Vector], Vector], point: Sequence[Number]) -> Matrix:
    """Matrix ``d function[i] / d point[j]`` by central differences."""
    columns = []
    for j in range(len(point)):
        ahead = function(_shifted(point, (j, STEP)))
        behind = function(_shifted(point, (j, -STEP)))
        columns.append([(a - b) / (2 * STEP) for a, b in zip(ahead, behind, strict=True)])
    return [list(row) for row in zip(*columns, strict=True)]


def hessian(function: Callable[[Vector], Number], point: Sequence[Number]) -> Matrix:
    """Second derivatives of a scalar function: differences of differences, each pair once."""
    count = len(point)
    result = [[mpf(0)] * count for _ in range(count)]
    for i in range(count):
        for j in range(i + 1):
            corner = {
                (s, t): function(_shifted(point, (i, s * STEP), (j, t * STEP)))
                for s in (1, -1)
                for t in (1, -1)
            }
            value = corner[1, 1] - corner[1, -1] - corner[-1, 1] + corner[-1, -1]
            result[i][j] = result[j][i] = value / (4 * STEP**2)
    return result
