"""Linear buckling of a study."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softehl.runtime.analyses.initial_state import Beginning
from softehl.runtime.arrays import Array, read_only
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.equations.eigenproblems import buckled
from softehl.runtime.equations.rigid_body_modes import require_held
from softehl.runtime.equations.system import System
from softehl.runtime.results.result import ModeShape, Result
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import NotConverged, Point
from softehl.runtime.suggestions import few


@dataclass(frozen=True, eq=False)
class Buckling:
    """Result of linear buckling.

    Attributes
    ----------
    factors : array (k,)
        Critical load factors, rising.
    shapes : tuple of ModeShape
        A Result for each, whose unknowns are the mode, 1 at its largest.
    """

    factors: Array
    shapes: tuple[ModeShape, ...]

    def __repr__(self) -> str:
        """Summary in one line."""
        return f"<Buckling: factors {few(f'{f:.6g}' for f in self.factors)}>"


def linear_buckling(system: System, start: Beginning, count: int, newton: Newton) -> Buckling:
    """Factors and modes of `Study.buckling`.  Raises StudyError, NotConverged."""
    t, x0, histories = start

    def problem_at(factor: float) -> Problem:
        return system.problem(system.still(factor, x0, histories))

    with np.errstate(all="ignore"):
        problem = problem_at(t)
        require_held(system, problem, x0)
        solution = newton.solve(problem, x0)
    if not solution.converged:
        raise NotConverged(solution)
    point = Point(t, solution)
    state = Result(system, problem, point, histories)
    factors, modes = buckled(system, problem_at, point, count, newton)
    return Buckling(read_only(factors), tuple(ModeShape.of(state, mode) for mode in modes))
