"""Correctors in order of cost, as one corrector: each takes over where the one before it fails."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.solve.newton import Corrector, NonlinearProblem, WarmStartable, norm_at
from softehl.runtime.solve.solution import Solution


@dataclass(frozen=True)
class Ladder:
    """Solvers in order of cost; each continues where the previous one fails.

    Parameters
    ----------
    rungs : tuple of solvers
        Such as `Newton`, the cheapest first. A solver starts from the best iterate of the previous
        one if its residual is smaller than at the start.

    Raises
    ------
    ValueError
        There is no solver.
    """

    rungs: tuple[Corrector, ...]

    def __post_init__(self) -> None:
        """Raise ValueError if there is no rung."""
        if not self.rungs:
            raise ValueError("a ladder needs at least one corrector")

    def solve(self, problem: NonlinearProblem, x0: Array) -> Solution:
        """Solve R(x) = 0.

        Parameters
        ----------
        problem : Problem
            The equations.
        x0 : array (n,)
            Initial guess.

        Returns
        -------
        Solution
            With the number of the solver as `rung`, and iterations of all of them.
        """
        start, factorisations, iterations, messages = x0, 0, 0, list[str]()
        for number, corrector in enumerate(self.rungs):
            solution = replace(corrector.solve(problem, start), rung=number)
            factorisations += solution.factorisations
            iterations += solution.iterations
            if solution.converged:
                break
            messages.append(solution.message)
            start = _next_start(problem, solution, start)
        message = solution.message if solution.converged else "; then: ".join(messages)
        if solution.converged:
            self._warm_start_others(problem, solution.x, solution.rung)
        return replace(
            solution, message=message, factorisations=factorisations, iterations=iterations
        )

    def _warm_start_others(self, problem: Any, x: Array, finder: int) -> None:
        for number, corrector in enumerate(self.rungs):
            if number != finder and isinstance(corrector, WarmStartable):
                corrector.warm_start(problem, x)


def _next_start(problem: Any, failed: Solution, start: Array) -> Array:
    """The iterate from which the next corrector begins, (n,)."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        nearer = norm_at(problem, failed.nearest) < norm_at(problem, start)
    return failed.nearest if nearer else start
