"""Correctors in order of cost, as one corrector: each takes over where the one before it fails."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.solve.newton import Corrector, Informed, norm_at
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

    def solve(self, problem: Any, x0: Array) -> Solution:
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
        start, factorisations, iterations, words = x0, 0, 0, list[str]()
        for number, corrector in enumerate(self.rungs):
            found = replace(corrector.solve(problem, start), rung=number)
            factorisations += found.factorisations
            iterations += found.iterations
            if found.converged:
                break
            words.append(found.message)
            start = _warmer(problem, found, start)
        message = found.message if found.converged else "; then: ".join(words)
        if found.converged:
            self._tell(problem, found.x, found.rung)
        return replace(found, message=message, factorisations=factorisations, iterations=iterations)

    def _tell(self, problem: Any, x: Array, finder: int) -> None:
        for number, corrector in enumerate(self.rungs):
            if number != finder and isinstance(corrector, Informed):
                corrector.take_up(problem, x)


def _warmer(problem: Any, failed: Solution, start: Array) -> Array:
    """The iterate from which the next corrector begins, (n,)."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        nearer = norm_at(problem, failed.nearest) < norm_at(problem, start)
    return failed.nearest if nearer else start
