"""One process with a problem that is too large for factors, as `Share`."""

from __future__ import annotations

from dataclasses import dataclass

from scipy.sparse import csc_array

from softehl.runtime.arrays import Array
from softehl.runtime.fem.problem import Problem
from softehl.runtime.fem.reduction import symmetric
from softehl.runtime.share import Share
from softehl.runtime.solve.amg import Modes
from softehl.runtime.solve.amg_modes import lowest


@dataclass(eq=False)
class Large(Share):
    """All on one process, modes by multigrid. near: what it should know of."""

    near: Modes

    def lowest(
        self, problem: Problem, K: csc_array, M: csc_array, count: int
    ) -> tuple[Array, Array]:
        """See `Share`."""
        return lowest(symmetric(problem.eliminated(K)), symmetric(M), self.near, count)
