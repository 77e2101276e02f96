"""Direct solution of the sparse linear systems of Newton's method."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias

import numpy as np
from scipy.sparse import csc_array, csc_matrix
from scipy.sparse import linalg as sparse_linalg

from runtime.solution import Vector

SparseMatrix: TypeAlias = "csc_array[np.float64] | csc_matrix[np.float64]"
Ordering: TypeAlias = Literal["NATURAL", "MMD_ATA", "MMD_AT_PLUS_A", "COLAMD"]


class SingularMatrix(ArithmeticError):  # noqa: N818 (named after what it is)
    """The matrix has no usable factors; Newton turns it into Status.SINGULAR."""


class Factors(Protocol):
    """A factorised matrix A."""

    def solve(self, b: Vector) -> Vector:
        """x of A x = b, shapes (n,)."""
        ...


class LinearSolver(Protocol):
    """Anything that factorises a sparse matrix; raises SingularMatrix if it cannot."""

    def factorise(self, K: SparseMatrix) -> Factors:
        """Factors of K, shape (n, n)."""
        ...


@dataclass(frozen=True, eq=False)
class Factorisation:
    """Factors of `matrix`, with iterative refinement and a check of each solution.

    row_sums: (n,) sums of |matrix| along rows, the scale of each row's rounding error.
    """

    matrix: SparseMatrix
    factors: sparse_linalg.SuperLU
    row_sums: Vector
    refinement: int
    accuracy: float

    def solve(self, b: Vector) -> Vector:
        """x of matrix x = b, shapes (n,); raises SingularMatrix if x is not finite or not a
        solution to `accuracy` (row-wise backward error), as weak pivots may cause.
        """
        x: Vector = self.factors.solve(b)
        for _ in range(self.refinement):
            x = x + self.factors.solve(b - self.matrix @ x)
        if not np.isfinite(x).all():
            raise SingularMatrix("the linear solution is not finite: a pivot vanished")
        error = self._backward_error(x, b)
        if error > self.accuracy:
            raise SingularMatrix(
                f"the linear solution has a backward error of {error:.1e} (allowed "
                f"{self.accuracy:.1e}): the pivots were too weak"
            )
        return x

    def _backward_error(self, x: Vector, b: Vector) -> float:
        """Largest |b - A x|_i / (|A|_i |x|_max + |b|_i); each row has its own units."""
        size = float(np.abs(x).max(initial=0.0))
        scale = self.row_sums * size + np.abs(b)
        defect = np.abs(b - self.matrix @ x)
        ratio = np.divide(defect, scale, out=np.zeros_like(defect), where=scale > 0.0)
        return float(ratio.max(initial=0.0))


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

    def factorise(self, K: SparseMatrix) -> Factorisation:
        """Factors of K, square, shape (n, n), csc; raises SingularMatrix."""
        if not np.isfinite(K.data).all():
            raise SingularMatrix("the matrix has entries that are not finite")
        row_sums = np.asarray(abs(K) @ np.ones(K.shape[1]), dtype=np.float64)
        if not row_sums.all():
            row = int(np.flatnonzero(row_sums == 0.0)[0])
            raise SingularMatrix(f"row {row} of the matrix is zero")
        return Factorisation(K, self._factors(K), row_sums, self.refinement, self.accuracy)

    def _factors(self, K: SparseMatrix) -> sparse_linalg.SuperLU:
        try:
            return sparse_linalg.splu(
                K,
                permc_spec=self.ordering,
                diag_pivot_thresh=self.pivot_threshold,
                options={"SymmetricMode": self.symmetric_mode},
            )
        except RuntimeError as error:  # SuperLU's word for an exactly singular matrix
            raise SingularMatrix(f"no LU factors: {error}") from error
