"""A layered problem that a linear term of its layer holds near a state; a path lets it go."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csc_array, csr_array

from softehl.cases.seal.correctors.layer_split import Layered, Parts
from softehl.runtime.arrays import Array


@dataclass(frozen=True, eq=False)
class Relaxed(Layered):
    """R(x) + rate C (x - state); satisfies `LayeredProblem`.

    hold: C, (n, n): what unknowns that the layer shares do to its equations. state: (n,). Rows of
    prescribed unknowns are left as they are.
    """

    hold: csc_array[np.float64] = field(kw_only=True)
    state: Array = field(kw_only=True)
    rate: float = field(kw_only=True)

    def residual(self, x: Array) -> Array:
        """See `LayeredProblem`."""
        return np.asarray(super().residual(x) + self._free @ (x - self.state))

    def linearise(self, x: Array) -> tuple[Array, csc_array[np.float64]]:
        """See `LayeredProblem`."""
        r, K = super().linearise(x)
        return r + self._free @ (x - self.state), csc_array(K + self._free)

    def layer_residual(self, x: Array) -> Array:
        """See `LayeredProblem`."""
        return np.asarray(super().layer_residual(x) + self._small @ self._away(x))

    def layer_linearise(self, x: Array) -> tuple[Array, Parts]:
        """See `LayeredProblem`."""
        r, parts = super().layer_linearise(x)
        return r + self._small @ self._away(x), replace(parts, data=parts.data + self._entries)

    @property
    def term(self) -> csc_array[np.float64]:
        """rate C, (n, n), without rows of prescribed unknowns."""
        return self._free

    def _away(self, x: Array) -> Array:
        return np.asarray((x - self.state)[self.shared])

    @cached_property
    def _free(self) -> csc_array[np.float64]:
        """The term (n, n) without rows of prescribed unknowns."""
        C = self.hold.copy()
        free = np.ones(C.shape[0])
        free[self.problem.fixed] = 0.0
        C.data *= self.rate * free[C.indices]
        return C

    @cached_property
    def _small(self) -> csr_array[np.float64]:
        """The term (m + k, m) of the layer."""
        numbers = self.layer.numbers[: self.layer.size]
        return csr_array(self._free.tocsr()[numbers].tocsc()[:, self.shared])

    @cached_property
    def _entries(self) -> Array:
        """Entries of the term in the data of the layer's tangent."""
        term = self._small.tocoo()
        rows, columns = (number.astype(np.int64) for number in (term.row, term.col))
        return self.layer.cut.placed(rows, columns, term.data)


@dataclass(frozen=True, eq=False)
class Anchored:
    """R(x) + term (x - state) of any problem; satisfies the solvers' EvolvingProblem."""

    problem: Any
    term: csc_array[np.float64]
    state: Array

    def residual(self, x: Array) -> Array:
        """See `NonlinearProblem`."""
        return np.asarray(self.problem.residual(x) + self.term @ (x - self.state))

    def linearise(self, x: Array) -> tuple[Array, csc_array[np.float64]]:
        """See `NonlinearProblem`."""
        r, K = self.problem.linearise(x)
        return r + self.term @ (x - self.state), csc_array(K + self.term)

    def norm(self, r: Array) -> float:
        """See `NonlinearProblem`."""
        return float(self.problem.norm(r))

    def step_limit(self, x: Array, dx: Array) -> float:
        """See `NonlinearProblem`."""
        return float(self.problem.step_limit(x, dx))

    def after(self, previous: Array, x: Array) -> Anchored:
        """See `EvolvingProblem`."""
        return replace(self, problem=self.problem.after(previous, x))
