"""Predictors of continuation: where the next solution of a path may lie."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Literal, TypeAlias

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.solve.newton import NonlinearProblem
from softehl.runtime.solve.solution import Point

Predictor: TypeAlias = Literal["secant", "parabola", "previous"]
POINTS: dict[Predictor, int] = {"previous": 1, "secant": 2, "parabola": 3}
"""Number of known points that a predictor uses."""

Guess: TypeAlias = Callable[[Point, float], Array]
"""Change (n,) from a known point to a parameter, by whoever knows better than its neighbours."""

_LONGEST_EXTRAPOLATION = 10.0  # a secant prolonged further mostly amplifies its own error
_PARABOLA = 2.5  # the same for a parabola, in lengths of the shorter chord


def through(times: Sequence[float], states: Iterable[Array], t: float) -> Array:
    """Value (n,) at t of the polynomial through the states (n,) at different times (Lagrange)."""
    parts = [
        math.prod((t - b) / (a - b) for b in times if b != a) * state
        for a, state in zip(times, states, strict=True)
    ]
    return np.asarray(np.sum(parts, axis=0))


def extrapolated(known: Sequence[Point], parameter: float) -> Array:
    """Change (n,) from the first of the points to `parameter`, on the polynomial through them all;
    on that of fewer points where it goes further beyond them than they are apart.
    """
    here, others = known[0], known[1:]
    t = parameter - here.parameter
    distances = [point.parameter - here.parameter for point in others]
    if len(set(distances)) < len(distances) or 0.0 in distances:
        return np.zeros_like(here.solution.x)
    if len(others) == 2 and abs(t) > _PARABOLA * min(abs(d) for d in distances):
        return extrapolated(known[:2], parameter)
    if len(others) == 1:
        t = math.copysign(min(abs(t), _LONGEST_EXTRAPOLATION * abs(distances[0])), t)
    changes = [point.solution.x - here.solution.x for point in known]
    return through([0.0, *distances], changes, t)


def predicted(predictor: Predictor | Guess, known: Sequence[Point], parameter: float) -> Array:
    """Change (n,) from the first of the known points to `parameter`."""
    if callable(predictor):
        return predictor(known[0], parameter)
    return extrapolated(known[: POINTS[predictor]], parameter)


def admissible_fraction(problem: NonlinearProblem, x: Array, dx: Array) -> float:
    """Fraction of a predictor that the problem admits; 0 if it admits none."""
    fraction = problem.step_limit(x, dx)
    return min(1.0, fraction) if fraction > 0.0 else 0.0
