"""SuperLU of SciPy."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np
from scipy.sparse import linalg as sparse_linalg

from softehl.runtime.arrays import Integers
from softehl.runtime.solve.linear.elimination_ordering import (
    MOST_COPIED,
    MOST_ENTRIES,
    EliminationOrder,
    OrderCache,
    PermutedFactors,
    without_zeros,
)
from softehl.runtime.solve.linear.linear_solver import (
    Factorisation,
    Factors,
    SchurComplement,
    SingularMatrix,
    SparseMatrix,
    checked_row_sums,
    equilibrate,
)
from softehl.runtime.solve.linear.schur_complement import SchurByFactors, SchurBySolves

Ordering: TypeAlias = Literal["NATURAL", "MMD_ATA", "MMD_AT_PLUS_A", "COLAMD"]


@dataclass(frozen=True)
class SuperLU:
    """Sparse LU by SuperLU (Li and Demmel), set for a structurally symmetric matrix.

    The tangents are unsymmetric in value but symmetric in pattern, so the minimum-degree ordering
    of A' + A with mostly diagonal pivots makes several times less fill than COLAMD. The weak
    pivoting (`pivot_threshold`) costs accuracy, which `refinement` steps give back; a solution
    whose row-wise backward error still exceeds `accuracy` is refused. All of these are settings;
    `orders` changes with every new pattern.
    """

    ordering: Ordering = "MMD_AT_PLUS_A"
    symmetric_mode: bool = True
    pivot_threshold: float = 0.01
    refinement: int = 1
    accuracy: float = 1e-6
    name: str = "superlu"
    orders: OrderCache = field(default_factory=OrderCache, compare=False, repr=False)

    def factorise(self, K: SparseMatrix) -> Factorisation:
        """Factors of K, square, shape (n, n), csc; raises SingularMatrix."""
        K, row_sums, units = equilibrate(K)
        return Factorisation(
            matrix=K,
            factors=self._ordered(K),
            row_sums=row_sums,
            refinement=self.refinement,
            accuracy=self.accuracy,
            units=units,
        )

    def condense(self, K: SparseMatrix, boundary: Integers) -> SchurComplement:
        """See `Condenser`: by one factorisation unless pivots or memory forbid it."""
        checked_row_sums(K)
        try:
            order = self.orders.find(K, boundary) or self.orders.add(self._last(K, boundary))
            return SchurByFactors.of(K, order, self._as_it_is, MOST_COPIED)
        except SingularMatrix:
            return SchurBySolves.of(K, boundary, self.factors)

    def factors(self, K: SparseMatrix) -> sparse_linalg.SuperLU:
        """Factors of K, unchecked, with many right sides; raises SingularMatrix."""
        return self._factors(K, self.ordering)

    def _ordered(self, K: SparseMatrix) -> Factors:
        """Factors of K, in an order that its pattern alone decides; a very large one is not kept.

        So they do not depend on what was factorised before: a path that is taken up again is the
        same to the last bit.
        """
        if K.nnz > MOST_ENTRIES:
            return self.factors(K)
        order = self._order(K)
        return PermutedFactors(order, self._as_it_is(order.arranged(K)))

    def _order(self, K: SparseMatrix) -> EliminationOrder:
        """The order of the pattern of K, (n, n)."""
        cached = self.orders.find(K)
        return cached or self.orders.add(EliminationOrder.of(K, self._column_order(K)))

    def _last(self, K: SparseMatrix, boundary: Integers) -> EliminationOrder:
        """The order of the pattern of K, (n, n), with the boundary (m,) last."""
        cached = self.orders.find(K)
        return EliminationOrder.of(
            K, cached.unknowns if cached else self._column_order(K), boundary
        )

    def _column_order(self, K: SparseMatrix) -> Integers:
        """All unknowns (n,) as they are eliminated: an incomplete factorisation costs least."""
        pattern = K.copy()
        pattern.data[:] = 0.0
        pattern.setdiag(1.0)
        incomplete = sparse_linalg.spilu(
            pattern,
            drop_tol=0.5,
            permc_spec=self.ordering,
            options={"SymmetricMode": self.symmetric_mode},
        )
        return np.argsort(incomplete.perm_c)

    def _as_it_is(self, K: SparseMatrix) -> sparse_linalg.SuperLU:
        return self._factors(without_zeros(K), "NATURAL")

    def _factors(self, K: SparseMatrix, ordering: Ordering) -> sparse_linalg.SuperLU:
        try:
            return sparse_linalg.splu(
                K,
                permc_spec=ordering,
                diag_pivot_thresh=self.pivot_threshold,
                options={"SymmetricMode": self.symmetric_mode},
            )
        except RuntimeError as error:  # SuperLU's word for an exactly singular matrix
            raise SingularMatrix(f"no LU factors: {error}") from error
