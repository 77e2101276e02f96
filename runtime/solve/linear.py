"""Direct solution of the sparse linear systems of Newton's method.

`choose` names the backends: SuperLU comes with SciPy, PARDISO (`solve.pardiso`) is several times
faster and optional. Both check every solution they hand out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csc_matrix
from scipy.sparse import linalg as sparse_linalg

from softehl.runtime.arrays import Array, Flags, Integers

SparseMatrix: TypeAlias = "csc_array[np.float64] | csc_matrix[np.float64]"
Backend: TypeAlias = Literal["auto", "superlu", "pardiso"]
Ordering: TypeAlias = Literal["NATURAL", "MMD_ATA", "MMD_AT_PLUS_A", "COLAMD"]


_RIGHT_SIDES = 64  # at a time; all at once would need much memory


class SingularMatrix(ArithmeticError):  # noqa: N818 (named after what it is)
    """The matrix has no usable factors; Newton turns it into Status.SINGULAR."""


class Factors(Protocol):
    """A factorised matrix A."""

    def solve(self, b: Array) -> Array:
        """x of A x = b, shapes (n,)."""
        ...


class LinearSolver(Protocol):
    """Anything that factorises a sparse matrix; raises SingularMatrix if it cannot."""

    @property
    def name(self) -> str:
        """The backend, as it is written into records."""
        ...

    def factorise(self, K: SparseMatrix) -> Factors:
        """Factors of K, shape (n, n)."""
        ...


class Condensed(Protocol):
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
        """r_B - K_BI K_II^-1 r_I, (m,), for r (n,), and what `extend` wants to know of it, (n,)."""
        ...

    def extend(self, reduced: Array, x: Array) -> Array:
        """(n,): x (m,) on the boundary and K_II^-1 (r_I - K_IB x) in the interior."""
        ...


@runtime_checkable
class Condenser(LinearSolver, Protocol):
    """A linear solver that can also eliminate all unknowns but a few."""

    def condense(self, K: SparseMatrix, boundary: Integers) -> Condensed:
        """Condensation of K, (n, n), onto unknowns (m,) in rising order; raises SingularMatrix."""
        ...


class MissingBackend(ValueError):  # noqa: N818 (named after what it is)
    """The linear solver that was asked for is not installed; the message says what to do."""


@dataclass(frozen=True, eq=False)
class Factorisation:
    """Factors of `matrix`, with iterative refinement and a check of each solution.

    factors: anything with `solve`, exact or of a matrix near by. row_sums: (n,) sums of |matrix|
    along rows, the scale of each row's rounding error. accuracy: largest row-wise backward error
    of a solution. settled: largest size of the last correction, relative to the solution; where
    pivots were perturbed it does not shrink if the matrix is singular.
    """

    matrix: SparseMatrix
    factors: Any
    row_sums: Array
    refinement: int
    accuracy: float
    settled: float = math.inf

    def solve(self, b: Array) -> Array:
        """x of matrix x = b, shapes (n,); raises SingularMatrix if x is not finite or not a
        solution to `accuracy`, as weak pivots may cause.
        """
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
        error = self._backward_error(x, b)
        if error > self.accuracy:
            raise SingularMatrix(
                f"the linear solution has a backward error of {error:.1e} (allowed "
                f"{self.accuracy:.1e}): the pivots were too weak"
            )
        return x

    def _backward_error(self, x: Array, b: Array) -> float:
        """Largest |b - A x|_i / (|A|_i |x|_max + |b|_i); each row has its own units."""
        size = float(np.abs(x).max(initial=0.0))
        scale = self.row_sums * size + np.abs(b)
        defect = np.abs(b - self.matrix @ x)
        ratio = np.divide(defect, scale, out=np.zeros_like(defect), where=scale > 0.0)
        return float(ratio.max(initial=0.0))


def checked_row_sums(K: SparseMatrix) -> Array:
    """Sums (n,) of |K| along rows; raises SingularMatrix for a zero row or entries not finite."""
    if not np.isfinite(K.data).all():
        raise SingularMatrix("the matrix has entries that are not finite")
    sums = np.bincount(K.indices, weights=np.abs(K.data), minlength=K.shape[0])
    if not sums.all():
        row = int(np.flatnonzero(sums == 0.0)[0])
        raise SingularMatrix(f"row {row} of the matrix is zero")
    return np.asarray(sums, dtype=np.float64)


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
        """See `Condenser`; the Schur complement takes a solve for each boundary unknown."""
        checked_row_sums(K)
        inner: Flags = np.ones(K.shape[0], dtype=bool)
        inner[boundary] = False
        interior = np.flatnonzero(inner)
        rows = csc_array(K[boundary, :])
        columns = csc_array(K[interior, :][:, boundary])
        factors = self.factors(csc_array(K[interior, :][:, interior]))
        coupling = csc_array(rows[:, interior])
        schur = rows[:, boundary].toarray()
        for first in range(0, len(boundary), _RIGHT_SIDES):
            part = slice(first, first + _RIGHT_SIDES)
            schur[:, part] -= np.asarray(coupling @ factors.solve(columns[:, part].toarray()))
        return SchurBySolves(boundary, schur, interior, factors, (coupling, columns))


@dataclass(frozen=True, eq=False)
class SchurBySolves:
    """A condensation by SuperLU; satisfies `Condensed`.

    interior: (n - m,) eliminated unknowns. couplings: K_BI and K_IB.
    """

    boundary: Integers
    schur: Array
    interior: NDArray[np.intp]
    factors: sparse_linalg.SuperLU
    couplings: tuple[SparseMatrix, SparseMatrix]

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


def choose(backend: Backend) -> Condenser:
    """The solver of that name; "auto" is PARDISO where it is installed and SuperLU elsewhere.

    Raises MissingBackend if "pardiso" is asked for and not installed.
    """
    from softehl.runtime.solve import pardiso  # late: it loads a large library

    if backend == "superlu" or (backend == "auto" and not pardiso.available()):
        return SuperLU()
    if not pardiso.available():
        raise MissingBackend(
            'linear = "pardiso": it is not installed; allowed here: "auto" or "superlu", '
            "or install the extra `fast` (pip install 'softehl[fast]')"
        )
    return pardiso.Pardiso()
