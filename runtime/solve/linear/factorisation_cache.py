"""Factors of a matrix that comes again: those of a linear problem are made once."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from softehl.runtime.solve.linear.amg import Multigrid, OrFactors
from softehl.runtime.solve.linear.linear_solver import Factors, LinearSolver, SparseMatrix
from softehl.runtime.solve.linear.static_condensation import Condensing


@dataclass(eq=False)
class Kept:
    """A linear solver that gives the same factors for the same matrix, to the last bit."""

    solver: LinearSolver
    _last: tuple[SparseMatrix, Factors] | None = field(default=None, init=False, repr=False)

    @property
    def name(self) -> str:
        """See `LinearSolver`."""
        return self.solver.name

    def factorise(self, K: SparseMatrix) -> Factors:
        """See `LinearSolver`."""
        if self._last is not None and _same(self._last[0], K):
            return self._last[1]
        self._last = None  # never two at a time: they are what memory goes into
        factors = self.solver.factorise(K)
        self._last = K, factors
        return factors


def _same(A: SparseMatrix, B: SparseMatrix) -> bool:
    """True if all entries of matrices, which nobody changes, are the same."""
    parts = ((getattr(K, name) for K in (A, B)) for name in ("data", "indices", "indptr"))
    return all(a is b or np.array_equal(a, b) for a, b in parts)


def iterating(solver: LinearSolver) -> LinearSolver | None:
    """The solver, without a matrix that it keeps, if it makes no factors; else None."""
    plain = solver.solver if isinstance(solver, Kept) else solver
    inner = plain.solver if isinstance(plain, Condensing) else plain
    iterates = isinstance(inner, Multigrid) or (isinstance(inner, OrFactors) and not inner.taken)
    return plain if iterates else None
