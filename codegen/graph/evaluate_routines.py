"""The slow oracle's values of routines: nothing here knows how they are differentiated or printed.

Local unknowns are found by Newton's method with differences for slopes; derivatives of functions
of stretches are differences of the function of the matrix.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import mpmath

from softehl.codegen.graph.graph import Node, Routine
from softehl.codegen.graph.routines import Inverse, Isotropic, Newton

Number = Any
Vector = list[Number]
Evaluate = Callable[[Sequence[Node], Vector, Vector], Vector]


def results(r: Routine, args: Vector, evaluate: Evaluate) -> Vector:
    """Results of a routine in the working precision of mpmath; not-a-number where it has none."""
    match r:
        case Newton():
            return _newton(r, args, evaluate)
        case Inverse():
            inverted = mpmath.matrix(r.size, r.size)
            for k, a in enumerate(args):
                inverted[k // r.size, k % r.size] = a
            inverted = inverted**-1
            return [inverted[i, j] for i in range(r.size) for j in range(r.size)]
        case Isotropic():
            return _isotropic(r, args, evaluate)
    raise TypeError(f"no value for {r}")


def _newton(r: Newton, args: Vector, evaluate: Evaluate) -> Vector:
    p, s = args[: r.inputs - r.outputs], args[r.inputs - r.outputs :]
    before, A = mpmath.inf, None
    for _ in range(200):
        A = A or _slopes(r, s, p, evaluate)
        try:
            step = mpmath.lu_solve(A, mpmath.matrix(evaluate(r.equations, s, p)))
        except ZeroDivisionError:
            break
        s = [v - step[i] for i, v in enumerate(s)]
        digits = mpmath.mpf(10) ** (8 - mpmath.mp.dps)
        changes = [abs(v) for v in step]
        near = all(c <= digits * abs(v) for c, v in zip(changes, s, strict=True))
        if near or digits * max(1, *map(abs, s)) >= max(changes) > before / 2:
            return s  # to its own digits, or to those that rounding leaves
        before = max(changes)
        if before > _CLOSE * max(map(abs, s)):  # else these slopes give eight digits a step
            A = None
    return [mpmath.nan] * len(s)


_CLOSE = 1e-8


def _slopes(r: Newton, s: Vector, p: Vector, evaluate: Evaluate) -> mpmath.matrix:
    """dg/ds by differences."""
    h = mpmath.mpf(10) ** (-mpmath.mp.dps // 3)
    A = mpmath.matrix(len(s), len(s))
    for j in range(len(s)):
        plus, minus = (
            evaluate(r.equations, [v + t * h * (i == j) for i, v in enumerate(s)], p)
            for t in (1, -1)
        )
        for i in range(len(s)):
            A[i, j] = (plus[i] - minus[i]) / (2 * h)
    return A


def _isotropic(r: Isotropic, args: Vector, evaluate: Evaluate) -> Vector:
    h = mpmath.mpf(10) ** (-mpmath.mp.dps // 4)

    def derivative(entries: Vector, path: tuple[int, ...]) -> Number:
        if not path:
            return _energy(r, [*entries, *args[6:]], evaluate)
        plus, minus = (
            derivative([v + t * h * (i == path[0]) for i, v in enumerate(entries)], path[1:])
            for t in (1, -1)
        )
        return (plus - minus) / (2 * h)

    paths: list[tuple[int, ...]] = [()]
    if r.order == 1:
        paths = [(i,) for i in range(6)]
    elif r.order == 2:
        paths = [(i, j) for i in range(6) for j in range(i, 6)]
    return [derivative(args[:6], path) for path in paths]


def _energy(r: Isotropic, args: Vector, evaluate: Evaluate) -> Number:
    a, b, c, d, e, f = args[:6]
    eigenvalues = mpmath.eigsy(mpmath.matrix([[a, d, e], [d, b, f], [e, f, c]]), eigvals_only=True)
    return evaluate([r.energy], list(eigenvalues), args[6:])[0]
