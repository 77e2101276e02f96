"""Eigenvectors and exponentials of matrices of any numbers: floats, decimals, those of mpmath."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

Number = Any
SWEEPS = 60
"""Of Jacobi's rotations; ten are enough for 90 digits."""


def eigenvectors(
    entries: Sequence[Number], root: Callable[[Number], Number]
) -> tuple[list[Number], list[list[Number]]]:
    """Eigenvalues, and vectors as columns, of the symmetric part of a matrix given row by row."""
    n = math.isqrt(len(entries))
    A = [[(entries[n * i + j] + entries[n * j + i]) / 2 for j in range(n)] for i in range(n)]
    one = root(entries[0] * 0 + 1)
    Q = [[one * int(i == j) for j in range(n)] for i in range(n)]
    for _ in range(SWEEPS):
        turned = False
        for i in range(n):
            for j in range(i + 1, n):
                if A[i][j] == 0 or abs(A[i][j]) + abs(A[i][i]) + abs(A[j][j]) == abs(A[i][i]) + abs(
                    A[j][j]
                ):
                    continue
                turned = True
                half = (A[j][j] - A[i][i]) / (2 * A[i][j])
                t = 1 / (abs(half) + root(half * half + 1))
                t = -t if half < 0 else t
                c = 1 / root(t * t + 1)
                _turn(A, Q, i, j, c, t * c)
        if not turned:
            break
    return [A[k][k] for k in range(n)], Q


def _turn(A: list[Any], Q: list[Any], i: int, j: int, c: Number, s: Number) -> None:
    for row in (*A, *Q):
        row[i], row[j] = c * row[i] - s * row[j], s * row[i] + c * row[j]
    first, second = list(A[i]), list(A[j])
    A[i] = [c * a - s * b for a, b in zip(first, second, strict=True)]
    A[j] = [s * a + c * b for a, b in zip(first, second, strict=True)]


def exponential(entries: Sequence[Number]) -> list[Number]:
    """Exponential of a matrix given row by row, by its series after enough halvings."""
    n = math.isqrt(len(entries))
    A = [list(entries[n * i : n * i + n]) for i in range(n)]
    halvings = 0
    while any(abs(a) > 1 for row in A for a in row):
        A, halvings = [[a / 2 for a in row] for row in A], halvings + 1
    total = [[a * 0 + int(i == j) for j, a in enumerate(row)] for i, row in enumerate(A)]
    term = total
    for k in range(1, 10**4):
        term = [[a / k for a in row] for row in _product(term, A)]
        grown = [
            [a + b for a, b in zip(*rows, strict=True)] for rows in zip(total, term, strict=True)
        ]
        if grown == total:
            break
        total = grown
    for _ in range(halvings):
        total = _product(total, total)
    return [a for row in total for a in row]


def _product(A: list[list[Number]], B: list[list[Number]]) -> list[list[Number]]:
    return [
        [sum(a * b for a, b in zip(row, c, strict=True)) for c in zip(*B, strict=True)] for row in A
    ]
