"""Natural modes about a state, and linear buckling: the equations of a study as eigenproblems."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array, count_of
from softehl.runtime.fem.problem import Problem
from softehl.runtime.fem.reduction import Reduction, is_symmetric, symmetric
from softehl.runtime.mass import Masses, mass_matrix
from softehl.runtime.solve.eigen import NoModes, lowest, smallest_factors
from softehl.runtime.solve.linear import SingularMatrix
from softehl.runtime.solve.superlu import SuperLU
from softehl.runtime.statement.records import StudyError
from softehl.runtime.system import System

_LENGTH = 1e-4
"""Of the size of the mesh: how far the difference of tangents of `buckling` goes. Its error is
about the square of that."""


@dataclass(frozen=True, eq=False)
class Tangent:
    """The tangent (n, n) of a problem at a state before supports are eliminated."""

    problem: Problem
    K: csc_array

    @classmethod
    def at(cls, problem: Problem, x: Array, words: str) -> Tangent:
        """Raises StudyError where it is spread over processes, not finite or not symmetric."""
        if not isinstance(problem, Problem):
            raise StudyError(f'{words}: in one process only, engine = "serial"')
        with np.errstate(all="ignore"):
            K = problem.assembler.linearise(x, problem.parameters)[1]
        if not np.isfinite(K.data).all():
            raise StudyError(f"{words}: the tangent is not finite")
        if not is_symmetric(K):
            raise StudyError(
                f"{words}: the tangent is not symmetric (friction, pressure that follows an open "
                "side, or a page without a potential), and frequencies are those of a potential"
            )
        return cls(problem, K)


def natural(
    system: System, problem: Problem, x: Array, count: int, mass: Masses | None
) -> tuple[Array, Array]:
    """Squares of angular frequencies (k,) and modes (k, n) about a state x, the lowest first."""
    words = f"modes({count})"
    _require_count(words, count)
    K = Tangent.at(problem, x, words).K
    M = mass_matrix(system, problem, x, mass)
    free = Reduction.of(problem)
    try:
        squares, found = lowest(
            symmetric(free.matrix(K)), symmetric(free.matrix(M)), count, int(free.saddle(K).sum())
        )
    except (NoModes, SingularMatrix) as error:
        raise StudyError(f"{words}: {error}") from None
    return squares, np.asarray((free.map @ found.T).T)


def buckled(
    system: System, problem_at: Callable[[float], Problem], t: float, x: Array, count: int
) -> tuple[Array, Array]:
    """Load factors (k,) and modes (k, n) of linear buckling from a state x at load factor t.

    The tangent K changes by K' along the linear response to a load that grows by 1:
    (K + (f - t) K') mode = 0.
    """
    words = f"buckling({count})"
    _require_count(words, count)
    here = Tangent.at(problem_at(t), x, words)
    response = _response(problem_at(t + 1.0), x, here, words)
    size = float(np.ptp(system.mesh.points, axis=0).max())
    h = _LENGTH * size / (float(np.abs(response).max()) or 1.0)
    ahead = Tangent.at(problem_at(t + h), x + h * response, words).K
    behind = Tangent.at(problem_at(t - h), x - h * response, words).K
    free = Reduction.of(here.problem)
    K, change = (symmetric(free.matrix(A)) for A in (here.K, (ahead - behind) / (2.0 * h)))
    try:
        factors, found = smallest_factors(K, change, count)
    except (NoModes, SingularMatrix) as error:
        raise StudyError(f"{words}: {error}") from None
    return t + factors, np.asarray((free.map @ found.T).T)


def _response(loaded: Problem, x: Array, here: Tangent, words: str) -> Array:
    """Change of the unknowns (n,) by the linear response to a load that grows by 1."""
    r, K = loaded.linearise(x)
    try:
        found = -SuperLU().factorise(K).solve(r)
    except SingularMatrix as error:
        raise StudyError(f"{words}: {error}") from None
    if not np.abs(found).max(initial=0.0) > 0.0:
        raise StudyError(f"{words}: nothing changes with the load factor; give loads or fix(...)")
    return np.asarray(found)


def _require_count(words: str, count: int) -> None:
    if count_of(count) is None:
        raise StudyError(f"{words}: a whole number of at least 1 is needed")
