"""Stability of a solved state: negative directions of its tangent, supports and ties respected."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import csc_array

from softehl.log import warn
from softehl.runtime.arrays import Array, Flags
from softehl.runtime.discretisation.loads import Tie
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.discretisation.reduced_tangent import (
    CondensedMap,
    concave,
    internal_negative,
    is_symmetric,
    is_symmetric_where_free,
    symmetric,
)
from softehl.runtime.solve.eigen import Pivots
from softehl.runtime.solve.linear.linear_solver import SingularMatrix


class UnstableState(RuntimeWarning):
    """A state solves the equations and is unstable."""


def negative_directions(problem: Any, x: Array) -> int | None:
    """Number of independent motions along which the energy about a state x, (n,), falls.

    By the signs of the pivots of the tangent, internal unknowns condensed, less those of
    multipliers, which are negative by nature. None where there is no such number: no symmetric
    tangent, one that is singular, or a problem that is spread over processes.
    """
    if not isinstance(problem, Problem):
        return None
    with np.errstate(all="ignore"):
        K = problem.assembler.linearise(x, problem.parameters)[1]
    if not np.isfinite(K.data).all() or not is_symmetric_where_free(problem, K):
        return None
    free = CondensedMap.of(problem, K)
    if not free.T.shape[1]:
        return 0
    saddle = free.saddle(K)
    try:
        pivots = Pivots.of(symmetric(free.matrix(K)), saddle)
    except SingularMatrix:
        return None
    return max(pivots.negative - int(saddle.sum()), 0)


def negative_by_factors(problem: Any, K: Any, factors: Any) -> int | None:
    """As `negative_directions`, by the factors of a tangent K near by, supports eliminated.

    None where they do not tell: pivots beside the diagonal, ties, an unsymmetric tangent.
    """
    pivots = getattr(factors, "pivots", None)
    if pivots is None or not isinstance(problem, Problem) or _hidden(problem):
        return None
    if not isinstance(K, csc_array) or not is_symmetric(K):
        return None
    values = pivots()
    if values is None:
        return None
    natural = int(concave(problem, K).sum())
    if len(values) == K.shape[0]:  # else internal unknowns are condensed
        natural += internal_negative(problem, K)
    return max(int((values < 0.0).sum()) - natural, 0)


def _hidden(problem: Problem) -> bool:
    """True if a tangent without the rows of supports does not show what multipliers join: ties, and
    fields that are wholly prescribed.
    """
    if any(isinstance(b.kernel, Tie) and len(b.dofs) for b in problem.assembler.blocks):
        return True
    fixed: Flags = np.zeros(problem.layout.total, dtype=bool)
    fixed[problem.fixed] = True
    return any(bool(fixed[part].all()) for part in problem.layout.fields)


def warn_unstable(problem: Any, x: Array, factors: tuple[Any, Any] | None, context: str) -> None:
    """Warn where a state x, (n,), is unstable.

    factors: a tangent near by and its factors, if they are at hand. context: of the state.
    """
    along = _falls_along(problem, x, factors)
    if along:
        warn(
            f"the state at {context} is unstable: its energy falls along {along} "
            '(result.modes shows them); study.follow(detect="bifurcation") finds other branches',
            UnstableState,
            stacklevel=4,
        )


def _falls_along(problem: Any, x: Array, factors: tuple[Any, Any] | None) -> str:
    """Along how many directions the energy falls, in words; empty where along none."""
    count = None
    if factors is not None:
        count = negative_by_factors(problem, K=factors[0], factors=factors[1])
        iterative = getattr(factors[1], "indefinite", None)
        falls = iterative() if count is None and iterative is not None else None
        if falls is not None:  # other factors would be too large
            return "one direction at least" if falls else ""
    if count is None and isinstance(problem, Problem):
        count = negative_directions(problem, x)
    if not count:
        return ""
    return f"{count} independent directions" if count > 1 else "one direction"
