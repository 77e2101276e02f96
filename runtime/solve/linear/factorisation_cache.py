"""Cache of the last factorisation: a linear problem is factorised once."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from softehl.runtime.solve.linear.amg import AlgebraicMultigrid, AmgOrDirect
from softehl.runtime.solve.linear.linear_solver import Factors, LinearSolver, SparseMatrix
from softehl.runtime.solve.linear.static_condensation import CondensingSolver


@dataclass(eq=False)
class FactorisationCache:
    """A linear solver that returns the last factors for the same matrix, to the last bit."""

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
    """True if all entries of two matrices are the same."""
    parts = ((getattr(K, name) for K in (A, B)) for name in ("data", "indices", "indptr"))
    return all(a is b or np.array_equal(a, b) for a, b in parts)


def iterative_part(solver: LinearSolver) -> LinearSolver | None:
    """The solver without its cache if it is iterative, else None."""
    plain = solver.solver if isinstance(solver, FactorisationCache) else solver
    inner = plain.solver if isinstance(plain, CondensingSolver) else plain
    iterates = isinstance(inner, AlgebraicMultigrid) or (
        isinstance(inner, AmgOrDirect) and not inner.uses_second
    )
    return plain if iterates else None
