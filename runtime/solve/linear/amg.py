"""Conjugate gradients with algebraic multigrid (pyamg): for problems too large for factors."""

from __future__ import annotations

import importlib.util
import warnings
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from scipy.sparse import bsr_array, csr_array

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.solve.linear.linear_solver import (
    Factors,
    LinearSolver,
    SingularMatrix,
    SparseMatrix,
    checked_row_sums,
)

_UNSYMMETRIC = 1e-9  # of the largest entry


@dataclass(frozen=True, eq=False)
class PermutedEntries:
    """Positions of the entries of a matrix in a permuted one.

    indices, indptr: of the matrix, by columns. positions: of its entries, (n, n), by blocks of
    rows, in the order; -1 where a block has more than the matrix.
    """

    indices: Any
    indptr: Any
    positions: bsr_array

    @classmethod
    def of(cls, K: SparseMatrix, order: Integers, block: int = 1) -> PermutedEntries:
        """Of the pattern of K, (n, n), with blocks of so many rows and columns."""
        numbers = csr_array((np.arange(1, K.nnz + 1), K.indices, K.indptr), shape=K.shape)
        positions = csr_array(numbers[order][:, order].T)  # of columns that are taken for rows
        positions.sort_indices()
        blocks = bsr_array(positions.tobsr((block, block)))
        blocks.data -= 1
        return cls(K.indices, K.indptr, blocks)

    def fit(self, K: SparseMatrix) -> bool:
        """True if K has the pattern."""
        return np.array_equal(K.indptr, self.indptr) and np.array_equal(K.indices, self.indices)

    def permuted(self, K: SparseMatrix) -> tuple[Any, bool]:
        """K in the order, by blocks, and whether it is symmetric."""
        positions = self.positions
        data = np.append(K.data, 0.0)[positions.data]
        permuted = bsr_array((data, positions.indices, positions.indptr), shape=positions.shape)
        u, v = np.random.default_rng(0).uniform(-1.0, 1.0, (2, positions.shape[0]))
        uneven = abs(float(u @ (permuted @ v) - v @ (permuted @ u)))
        return permuted, uneven <= _UNSYMMETRIC * float(
            max(data.max(initial=0.0), -data.min(initial=0.0))
        )


_STALE_RATIO, _STALE_OFFSET = 1.5, 4
"""The hierarchy is rebuilt if iterations exceed so many times those of the first solve, plus these:
a hierarchy takes about as long as twelve of them."""
_ROUNDING = 1e-10  # of the largest eigenvalue of the coarsest grid
_COARSEST = 100  # unknowns that are solved by a pseudo-inverse, in milliseconds


Smoother: TypeAlias = tuple[str, dict[str, Any]]
GAUSS_SEIDEL: Smoother = ("block_gauss_seidel", {"sweep": "symmetric"})
FORWARD: Smoother = ("block_gauss_seidel", {"sweep": "forward"})
BACKWARD: Smoother = ("block_gauss_seidel", {"sweep": "backward"})
CHEBYSHEV: Smoother = ("chebyshev", {"degree": 3})
"""Half of the time of Gauss and Seidel's, in as many iterations: blocks, beams, plates, graded
meshes, stiff and soft parts of 1 to 1000. Without scaling these take ten times as many."""


def available() -> bool:
    """True if pyamg is installed."""
    return importlib.util.find_spec("pyamg") is not None


@dataclass(frozen=True, eq=False)
class NearNullspace:
    """Near null space: modes without energy where nothing is prescribed, which multigrid must keep.

    order: (n,) unknowns node by node, `block` at each. modes: (n, k) the motions, in that order.
    """

    order: Integers
    block: int
    modes: Array


@dataclass(eq=False)
class AlgebraicMultigrid:
    """Smoothed aggregation around conjugate gradients; GMRES where a matrix is not symmetric.

    Rows and columns are scaled to a diagonal of 1: polynomials smooth stiff and soft parts alike.
    The grids of a symmetric matrix serve the next ones, too, until these take many more iterations.
    tolerance: of the residual, relative to the right side; Newton's method corrects the rest.
    max_iterations: iterations of one solution.
    """

    modes: NearNullspace
    tolerance: float = 1e-6
    max_iterations: int = 150
    name: str = "multigrid"
    _grids: GridHierarchy | None = field(default=None, init=False, repr=False)
    _entries: PermutedEntries | None = field(default=None, init=False, repr=False)

    def factorise(self, K: SparseMatrix) -> AmgFactors:
        """The hierarchy of K, (n, n); raises SingularMatrix."""
        from pyamg.util.utils import scale_columns, scale_rows

        sums = checked_row_sums(K)
        order, diagonal = self.modes.order, np.abs(K.diagonal())
        if len(order) != K.shape[0]:
            raise SingularMatrix(
                f"multigrid knows {len(order)} unknowns, the matrix has {K.shape[0]}: paths by arc "
                'length and the like need linear = "direct"'
            )
        prescribed = (sums == diagonal)[order]  # prescribed: nothing else in the row
        if self._entries is None or not self._entries.fit(K):
            self._entries = PermutedEntries.of(K, order, self.modes.block)
        A, symmetric = self._entries.permuted(K)
        grids = self._grids
        if grids is None or not (symmetric and grids.fits(prescribed)):
            diagonal = diagonal[order]
            scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
            nullspace = np.where(prescribed[:, None], 0.0, self.modes.modes / scale[:, None])
            smoother = CHEBYSHEV if symmetric else GAUSS_SEIDEL
            grids = GridHierarchy(scale, nullspace, prescribed, self.modes.block, smoother)
            self._grids = grids if symmetric else None
        for scaled in (scale_rows, scale_columns):
            scaled(A, grids.scale, copy=False)
        return AmgFactors(A, grids, order, symmetric, self.tolerance, self.max_iterations)


@dataclass(eq=False)
class GridHierarchy:
    """A hierarchy of grids for similar matrices, built from the first of them.

    scale: (n,) of rows and columns. nullspace: (n, k) near null space. prescribed: (n,) unknowns.
    block: unknowns of a node, which are neighbours.
    """

    scale: Array
    nullspace: Array
    prescribed: Flags
    block: int
    smoother: Smoother
    stale: bool = field(default=False, init=False)
    _levels: Any = field(default=None, init=False)
    _of: Any = field(default=None, init=False)
    _first_iterations: int = field(default=0, init=False)

    def fits(self, prescribed: Flags) -> bool:
        """True if a matrix with these unknowns prescribed may use them."""
        return not self.stale and np.array_equal(prescribed, self.prescribed)

    def of(self, A: Any) -> Any:
        """The hierarchy, made of A if there is none."""
        return self.rebuild(A) if self._levels is None else self._levels

    def rebuild(self, A: Any) -> Any:
        """The hierarchy of A itself."""
        self._levels = None  # never two at a time: they are what memory goes into
        self._levels, self._first_iterations = (
            hierarchy(A, self.nullspace, self.block, self.smoother),
            0,
        )
        self._of, self.stale = A, False
        return self._levels

    def is_made_of(self, A: Any) -> bool:
        """True if the hierarchy was built from A."""
        return self._of is A

    def note_iterations(self, steps: int) -> None:
        """Learn how many iterations a solution took."""
        self._first_iterations = self._first_iterations or steps
        self.stale = self.stale or steps > _STALE_RATIO * self._first_iterations + _STALE_OFFSET


def hierarchy(
    A: Any, nullspace: Array, block: int, smoother: Smoother = GAUSS_SEIDEL, *, light: bool = False
) -> Any:
    """Smoothed aggregation of A, (n, n), sparse, as pyamg has it: a symmetric cycle.

    nullspace: (n, k) near null space. block: unknowns of a node, which are neighbours.
    light: half the sweeps of Gauss and Seidel, and an interpolation that costs more to make.
    """
    import pyamg

    presmoother, postsmoother = (FORWARD, BACKWARD) if light else (smoother, smoother)
    with np.errstate(all="ignore"):
        return pyamg.smoothed_aggregation_solver(
            A.tobsr((block, block)),
            B=nullspace,
            strength=("symmetric", {"theta": 0.0}),
            smooth=("energy", {"krylov": "cg"}) if light else "jacobi",
            improve_candidates=None,
            presmoother=presmoother,
            postsmoother=postsmoother,
            max_coarse=_COARSEST,
        )


@dataclass(frozen=True, eq=False)
class AmgFactors:
    """A scaled matrix and a hierarchy of grids for it, as `Factors`."""

    matrix: Any
    grids: GridHierarchy
    order: Integers
    symmetric: bool
    tolerance: float
    max_iterations: int

    def solve(self, b: Array) -> Array:
        """x of the matrix, (n,), to the tolerance; raises SingularMatrix where it is not met."""
        if not b.any():
            return np.zeros(len(b))
        right = self.grids.scale * b[self.order]
        scaled, residual = self._cycles("cg", right) if self.symmetric else (right, np.inf)
        if not residual <= 10.0 * self.tolerance and not self.grids.is_made_of(self.matrix):
            self.grids.rebuild(self.matrix)
            scaled, residual = self._cycles("cg", right)
        if not residual <= 10.0 * self.tolerance:  # far from balance tangents are indefinite
            scaled, residual = self._cycles("gmres", right)
        if not residual <= 10.0 * self.tolerance:
            self.grids.stale = True
            raise SingularMatrix(
                f"multigrid left {residual:.1e} of the right side after {self.max_iterations} "
                f'steps; allowed are {self.tolerance:.0e}. Use linear = "direct"'
            )
        x = np.empty(len(b))
        x[self.order] = self.grids.scale * scaled
        return x

    def _cycles(self, method: str, b: Array) -> tuple[Array, float]:
        """Solution of a Krylov method, and its residual relative to b."""
        x, steps, _ = self._solved(method, b)
        self.grids.note_iterations(steps)
        residual = np.linalg.norm(b - self.matrix @ x) / np.linalg.norm(b)
        return x, float(residual)

    def _solved(self, method: str, b: Array) -> tuple[Array, int, bool]:
        """Solution of a Krylov method, iterations, and whether the matrix turned out indefinite.

        Warnings of that are caught: pyamg lets none of them be ignored.
        """
        from pyamg import krylov

        cycle = self.grids.of(self.matrix).aspreconditioner(cycle="V")
        norms = list[float]()
        with warnings.catch_warnings(record=True):
            options = {
                "tol": self.tolerance,
                "maxiter": self.max_iterations,
                "M": cycle,
                "residuals": norms,
            }
            x, info = getattr(krylov, method)(self.matrix, b, **options)
        return x, len(norms), info < 0

    def unconstrained_unknown(self) -> None:
        """See `JudgesSingularity`: iterations that converged show that the matrix is regular."""

    def indefinite(self) -> bool | None:
        """True where the matrix has a negative eigenvalue; None where it is not symmetric.

        Conjugate gradients tell: on a random right side, in which each mode has its share, they
        meet what they must divide by. A negative eigenvalue of the coarsest grid is one of the
        matrix that the grids were made of.
        """
        if not self.symmetric:
            return None
        b = np.random.default_rng(0).uniform(-1.0, 1.0, len(self.order))
        falls = self._solved("cg", b)[2]
        if not self.grids.is_made_of(self.matrix):
            if not falls:
                return False
            self.grids.rebuild(self.matrix)  # those of another matrix may be what is indefinite
            falls = self._solved("cg", b)[2]
        coarse = self.grids.of(self.matrix).levels[-1].A.toarray()
        values = np.linalg.eigvalsh((coarse + coarse.T) / 2.0)
        return falls or bool(values[0] < -_ROUNDING * np.abs(values).max())


@dataclass(eq=False)
class AmgOrDirect:
    """Multigrid, and after its first failure a direct solver for good.

    second: None where they would be too large. uses_second: whether it has.
    """

    first: AlgebraicMultigrid
    second: LinearSolver | None
    uses_second: bool = field(default=False, init=False)

    @property
    def name(self) -> str:
        """Of the solver that is used."""
        over = self._over
        return f"{over.name} after multigrid failed" if over else self.first.name

    @property
    def _over(self) -> LinearSolver | None:
        return self.second if self.uses_second else None

    def factorise(self, K: SparseMatrix) -> Factors:
        """Factors of K, (n, n); raises SingularMatrix."""
        if self._over is not None:
            return self._over.factorise(K)
        return _AmgOrDirectFactors(self, K, self.first.factorise(K))


@dataclass(eq=False)
class _AmgOrDirectFactors:
    choice: AmgOrDirect
    K: SparseMatrix
    factors: Factors

    def solve(self, b: Array) -> Array:
        try:
            return self.factors.solve(b)
        except SingularMatrix:
            second = self.choice.second
            if second is None or self.choice.uses_second:
                raise
            self.choice.uses_second = True
            self.factors = second.factorise(self.K)
            return self.factors.solve(b)

    def unconstrained_unknown(self) -> None:
        """See `AmgFactors`."""

    def indefinite(self) -> bool | None:
        """See `AmgFactors`; None where factors stand in."""
        return self.factors.indefinite() if isinstance(self.factors, AmgFactors) else None

    def pivots(self) -> Array | None:
        """Pivots of the direct factors in use, if known."""
        method = getattr(self.factors, "pivots", None)
        return None if method is None else method()
