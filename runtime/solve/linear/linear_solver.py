"""Interfaces of sparse linear algebra, and the check of every solution.

The backends are `superlu`, `pardiso` and `mumps`; `direct` chooses one by name.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Protocol, TypeAlias, runtime_checkable

import numpy as np
from scipy.sparse import csc_array, csc_matrix

from softehl.errors import SoftehlError
from softehl.runtime.arrays import Array, Integers

SparseMatrix: TypeAlias = "csc_array[np.float64] | csc_matrix[np.float64]"


_UNLIKE = 1e-2
"""Of the largest entries of the rows that it joins: where no entry of a row is so large, pivots are
compared in units that have nothing to do with each other. It is SuperLU's threshold of a pivot."""


class SingularMatrix(SoftehlError, ArithmeticError):  # noqa: N818 (named after what it is)
    """The matrix has no usable factors; Newton turns it into Status.SINGULAR.

    row: a row of zeros, if there is one.
    """

    def __init__(self, message: str, row: int | None = None) -> None:
        super().__init__(message)
        self.row = row


class Factors(Protocol):
    """A factorised matrix A."""

    def solve(self, b: Array) -> Array:
        """x of A x = b, shapes (n,)."""
        ...


class LinearSolver(Protocol):
    """Anything that factorises a sparse matrix; raises SingularMatrix if it cannot."""

    @property
    def name(self) -> str:
        """Name of the backend in records."""
        ...

    def factorise(self, K: SparseMatrix) -> Factors:
        """Factors of K, shape (n, n)."""
        ...


class SchurComplement(Protocol):
    """K = [[K_II, K_IB], [K_BI, K_BB]] with the interior unknowns I eliminated; see `Condenser`.

    boundary: (m,) numbers of the unknowns B. schur: (m, m) S = K_BB - K_BI K_II^-1 K_IB.
    """

    @property
    def boundary(self) -> Integers:
        """See the class."""
        ...

    @property
    def schur(self) -> Array:
        """See the class."""
        ...

    def reduce(self, r: Array) -> tuple[Array, Array]:
        """r_B - K_BI K_II^-1 r_I, (m,), for r (n,), and the argument of `extend`, (n,)."""
        ...

    def extend(self, reduced: Array, x: Array) -> Array:
        """(n,): x (m,) on the boundary and K_II^-1 (r_I - K_IB x) in the interior."""
        ...


@runtime_checkable
class Condenser(LinearSolver, Protocol):
    """A linear solver that can also eliminate all unknowns but a few."""

    def condense(self, K: SparseMatrix, boundary: Integers) -> SchurComplement:
        """Condensation of K, (n, n), onto unknowns (m,) in rising order; raises SingularMatrix."""
        ...


@dataclass(frozen=True, eq=False)
class Factorisation:
    """Factors of `matrix`, with iterative refinement and a check of each solution.

    factors: anything with `solve`, exact or of a matrix near by. row_sums: (n,) sums of |matrix|
    along rows, the scale of each row's rounding error. accuracy: largest row-wise backward error
    of a solution. settled: largest size of the last correction, relative to the solution; where
    pivots were perturbed it does not shrink if the matrix is singular. units: of rows and columns,
    (n,), if `matrix` is a balanced one; solutions are those of the one that was given.
    """

    matrix: SparseMatrix
    factors: Any
    row_sums: Array
    refinement: int
    accuracy: float
    settled: float = math.inf
    units: tuple[Array, Array] | None = None

    def solve(self, b: Array) -> Array:
        """x of matrix x = b, shapes (n,); raises SingularMatrix if x is not finite or not a
        solution to `accuracy`, as weak pivots may cause.
        """
        if self.units is None:
            return self._solved(b)
        rows, columns = self.units
        return columns * self._solved(rows * b)

    def solve_columns(self, b: Array) -> Array:
        """x of matrix x = b, shapes (n, k); at once where the factors can.  Raises SingularMatrix
        as `solve`.
        """
        if not getattr(self.factors, "takes_columns", False):
            return np.stack([self.solve(column) for column in b.T], axis=1)
        if self.units is None:
            return self._solved(b)
        rows, columns = self.units
        return np.asarray(columns[:, None] * self._solved(rows[:, None] * b))

    def _solved(self, b: Array) -> Array:
        x: Array = self.factors.solve(b)
        correction = 0.0
        for _ in range(self.refinement):
            dx = self.factors.solve(b - self.matrix @ x)
            x = x + dx
            correction = float(np.abs(dx).max(initial=0.0))
        if not np.isfinite(x).all():
            raise SingularMatrix("the linear solution is not finite: a pivot vanished")
        if correction > self.settled * float(np.abs(x).max(initial=0.0)):
            raise SingularMatrix("the linear solution does not settle: the matrix is singular")
        pairs = [(x, b)] if b.ndim == 1 else zip(x.T, b.T, strict=True)
        error = max(self._backward_error(column, right) for column, right in pairs)
        if error > self.accuracy:
            raise SingularMatrix(
                f"the linear solution has a backward error of {error:.1e} (allowed "
                f"{self.accuracy:.1e}): the pivots were too weak"
            )
        return x

    def transposed(self) -> Factorisation | None:
        """Factors of the transpose by these; None where they cannot be used so."""
        method = getattr(self.factors, "transposed", None)
        factors = None if method is None else method()
        if factors is None:
            return None
        K = csc_array(self.matrix.T)
        row_sums: Array = np.asarray(abs(K).sum(axis=1)).ravel()
        units = None if self.units is None else self.units[::-1]
        return replace(self, matrix=K, factors=factors, row_sums=row_sums, units=units)

    def pivots(self) -> Array | None:
        """Pivots (n,) where they are all on the diagonal, as in L D L'; None where not known."""
        method = getattr(self.factors, "pivots", None)
        return None if method is None else method()

    def sign(self) -> float | None:
        """Sign of the determinant; None where it is not known."""
        method = getattr(self.factors, "sign", None)
        return None if method is None else method()

    def _backward_error(self, x: Array, b: Array) -> float:
        """Largest |b - A x|_i / (|A|_i |x|_max + |b|_i); each row has its own units."""
        size = float(np.abs(x).max(initial=0.0))
        scale = self.row_sums * size + np.abs(b)
        defect = np.abs(b - self.matrix @ x)
        ratio = np.divide(defect, scale, out=np.zeros_like(defect), where=scale > 0.0)
        return float(ratio.max(initial=0.0))


def solved_columns(factors: Factors, b: Array) -> Array:
    """x of K x = b, shapes (n, k); at once where the factors can."""
    if isinstance(factors, Factorisation):
        return factors.solve_columns(b)
    return np.stack([factors.solve(column) for column in b.T], axis=1)


def equilibrate(K: SparseMatrix) -> tuple[SparseMatrix, Array, tuple[Array, Array] | None]:
    """D K E, its row sums (n,), D and E, (n,): no row or column has entries that are all small
    beside those of the columns or rows that it joins. K itself and None where that is so already.
    Raises SingularMatrix as `checked_row_sums`.

    Displacements in m beside pressures in Pa spoil the choice of pivots. D and E have powers of
    two; of a symmetric matrix they are the same.
    """
    sums = checked_row_sums(K)
    size: Array = np.abs(K.data)
    rows, columns = np.ones(K.shape[0]), np.ones(K.shape[1])
    while True:  # the method of Ruiz: each turn halves the exponents that are left
        row, column = (1.0 / np.sqrt(largest) for largest in _largest(size, K))
        _scale(size, row, column, K)
        if min(largest.min() for largest in _largest(size, K)) >= _UNLIKE:
            break
        rows *= row
        columns *= column
    if (rows == 1.0).all() and (columns == 1.0).all():
        return K, sums, None
    rows, columns = (np.asarray(2.0 ** np.round(np.log2(units))) for units in (rows, columns))
    scaled = K.data.copy()
    _scale(scaled, rows, columns, K)
    K = type(K)((scaled, K.indices, K.indptr), shape=K.shape)
    return K, checked_row_sums(K), (rows, columns)


def _scale(entries: Array, rows: Array, columns: Array, K: SparseMatrix) -> None:
    """Multiply entries (nnz,) of a matrix like K by the units (n,) of its rows and columns."""
    entries *= rows[K.indices]
    entries *= np.repeat(columns, np.diff(K.indptr))


def _largest(size: Array, K: SparseMatrix) -> tuple[Array, Array]:
    """Largest of the sizes (nnz,) in each row of K, and in each column, (n,); 1 in an empty one."""
    rows, columns = np.zeros(K.shape[0]), np.ones(K.shape[1])
    np.maximum.at(rows, K.indices, size)
    filled = np.flatnonzero(np.diff(K.indptr))
    columns[filled] = np.maximum.reduceat(size, K.indptr[filled])
    columns[columns == 0.0] = 1.0
    return rows, columns


def checked_row_sums(K: SparseMatrix) -> Array:
    """Sums (n,) of |K| along rows; raises SingularMatrix for a zero row or entries not finite."""
    if not np.isfinite(K.data).all():
        raise SingularMatrix("the matrix has entries that are not finite")
    sizes = csc_array((np.abs(K.data), K.indices, K.indptr), shape=K.shape)
    sums = sizes @ np.ones(K.shape[1])
    if not sums.all():
        row = int(np.flatnonzero(sums == 0.0)[0])
        raise SingularMatrix(f"row {row} of the matrix is zero", row)
    return np.asarray(sums, dtype=np.float64)
