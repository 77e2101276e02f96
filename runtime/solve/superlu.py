"""SuperLU, which comes with SciPy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array
from scipy.sparse import linalg as sparse_linalg

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.solve.linear import (
    Factorisation,
    Factors,
    SingularMatrix,
    SparseMatrix,
    checked_row_sums,
)

Ordering: TypeAlias = Literal["NATURAL", "MMD_ATA", "MMD_AT_PLUS_A", "COLAMD"]
_RIGHT_SIDES = 64  # at a time; all at once would need much memory


@dataclass(frozen=True)
class SuperLU:
    """Sparse LU by SuperLU (Li and Demmel), set for a structurally symmetric matrix.

    The tangents are unsymmetric in value but symmetric in pattern, so the minimum-degree ordering
    of A' + A with mostly diagonal pivots makes several times less fill than COLAMD. The weak
    pivoting (`pivot_threshold`) costs accuracy, which `refinement` steps give back; a solution
    whose row-wise backward error still exceeds `accuracy` is refused.
    """

    ordering: Ordering = "MMD_AT_PLUS_A"
    symmetric_mode: bool = True
    pivot_threshold: float = 0.01
    refinement: int = 1
    accuracy: float = 1e-6
    name: str = "superlu"

    def factorise(self, K: SparseMatrix) -> Factorisation:
        """Factors of K, square, shape (n, n), csc; raises SingularMatrix."""
        row_sums = checked_row_sums(K)
        return Factorisation(K, self.factors(K), row_sums, self.refinement, self.accuracy)

    def factors(self, K: SparseMatrix) -> sparse_linalg.SuperLU:
        """Factors of K, unchecked, with many right sides; raises SingularMatrix."""
        try:
            return sparse_linalg.splu(
                K,
                permc_spec=self.ordering,
                diag_pivot_thresh=self.pivot_threshold,
                options={"SymmetricMode": self.symmetric_mode},
            )
        except RuntimeError as error:  # SuperLU's word for an exactly singular matrix
            raise SingularMatrix(f"no LU factors: {error}") from error

    def condense(self, K: SparseMatrix, boundary: Integers) -> SchurBySolves:
        """See `Condenser`."""
        return SchurBySolves.of(K, boundary, self.factors)


@dataclass(frozen=True, eq=False)
class SchurBySolves:
    """A condensation by solves with many right sides; satisfies `Condensed`.

    interior: (n - m,) eliminated unknowns. couplings: K_BI and K_IB.
    """

    boundary: Integers
    schur: Array
    interior: NDArray[np.intp]
    factors: Factors
    couplings: tuple[SparseMatrix, SparseMatrix]

    @classmethod
    def of(
        cls, K: SparseMatrix, boundary: Integers, factors_of: Callable[[SparseMatrix], Factors]
    ) -> SchurBySolves:
        """Of K, (n, n); the Schur complement takes a solve for each boundary unknown.

        factors_of: of a matrix, with many right sides. Raises SingularMatrix.
        """
        checked_row_sums(K)
        inner: Flags = np.ones(K.shape[0], dtype=bool)
        inner[boundary] = False
        interior = np.flatnonzero(inner)
        rows = csc_array(K[boundary, :])
        columns = csc_array(K[interior, :][:, boundary])
        factors = factors_of(csc_array(K[interior, :][:, interior]))
        coupling = csc_array(rows[:, interior])
        schur = rows[:, boundary].toarray()
        for first in range(0, len(boundary), _RIGHT_SIDES):
            part = slice(first, first + _RIGHT_SIDES)
            schur[:, part] -= np.asarray(coupling @ factors.solve(columns[:, part].toarray()))
        return cls(boundary, schur, interior, factors, (coupling, columns))

    def reduce(self, r: Array) -> tuple[Array, Array]:
        """See `Condensed`."""
        y = np.zeros(len(r))
        y[self.interior] = self.factors.solve(r[self.interior])
        return np.asarray(r[self.boundary] - self.couplings[0] @ y[self.interior]), y

    def extend(self, reduced: Array, x: Array) -> Array:
        """See `Condensed`."""
        full = reduced.copy()
        full[self.interior] -= self.factors.solve(np.asarray(self.couplings[1] @ x))
        full[self.boundary] = x
        return full
