"""Conjugate gradients with algebraic multigrid (pyamg): for problems too large for factors."""

from __future__ import annotations

import importlib.util
import warnings
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from scipy.sparse import csr_array, diags_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.solve.linear import (
    Factors,
    LinearSolver,
    SingularMatrix,
    SparseMatrix,
    checked_row_sums,
)

_UNSYMMETRIC = 1e-9  # of the largest entry
_ROUNDING = 1e-10  # of the largest eigenvalue of the coarsest grid
_COARSEST = 100  # unknowns that are solved by a pseudo-inverse, in milliseconds


Smoother: TypeAlias = tuple[str, dict[str, Any]]
GAUSS_SEIDEL: Smoother = ("block_gauss_seidel", {"sweep": "symmetric"})
CHEBYSHEV: Smoother = ("chebyshev", {"degree": 3})
"""Half of the time of Gauss and Seidel's, in as many iterations: blocks, beams, plates, graded
meshes, stiff and soft parts of 1 to 1000. Without scaling these take ten times as many."""


def available() -> bool:
    """True if pyamg is installed."""
    return importlib.util.find_spec("pyamg") is not None


@dataclass(frozen=True, eq=False)
class Modes:
    """Motions that cost no energy where nothing is prescribed: multigrid must keep them.

    order: (n,) unknowns node by node, `block` at each. near: (n, k) the motions, in that order.
    """

    order: Integers
    block: int
    near: Array


@dataclass(frozen=True, eq=False)
class Multigrid:
    """Smoothed aggregation around conjugate gradients; GMRES where a matrix is not symmetric.

    Rows and columns are scaled to a diagonal of 1: polynomials smooth stiff and soft parts alike.
    tolerance: of the residual, relative to the right side; Newton's method corrects the rest.
    most: iterations of one solution.
    """

    modes: Modes
    tolerance: float = 1e-6
    most: int = 150
    name: str = "multigrid"

    def factorise(self, K: SparseMatrix) -> Preconditioned:
        """The hierarchy of K, (n, n); raises SingularMatrix."""
        sums = checked_row_sums(K)
        order, block = self.modes.order, self.modes.block
        diagonal = np.abs(K.diagonal())[order]
        scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        by = diags_array(scale)
        A = csr_array(by @ csr_array(K)[order][:, order] @ by)
        alone = (sums == np.abs(K.diagonal()))[order]  # prescribed: nothing else in the row
        near = np.where(alone[:, None], 0.0, self.modes.near / scale[:, None])
        largest = float(np.abs(A.data).max(initial=0.0))
        symmetric = bool(abs(A - A.T).max() <= _UNSYMMETRIC * largest)
        levels = hierarchy(A, near, block, CHEBYSHEV if symmetric else GAUSS_SEIDEL)
        return Preconditioned(levels, order, scale, symmetric, self.tolerance, self.most)


def hierarchy(
    A: csr_array[np.float64], near: Array, block: int, smoother: Smoother = GAUSS_SEIDEL
) -> Any:
    """Smoothed aggregation of A, (n, n), as pyamg has it: a symmetric cycle.

    near: (n, k) motions that A hardly resists. block: unknowns of a node, which are neighbours.
    """
    import pyamg

    with np.errstate(all="ignore"):
        return pyamg.smoothed_aggregation_solver(
            A.tobsr((block, block)),
            B=near,
            strength=("symmetric", {"theta": 0.0}),
            smooth="jacobi",
            improve_candidates=None,
            presmoother=smoother,
            postsmoother=smoother,
            max_coarse=_COARSEST,
        )


@dataclass(frozen=True, eq=False)
class Preconditioned:
    """A hierarchy of grids of a matrix, as `Factors`."""

    levels: Any
    order: Integers
    scale: Array
    symmetric: bool
    tolerance: float
    most: int

    def solve(self, b: Array) -> Array:
        """x of A x = b, (n,), to the tolerance; raises SingularMatrix where it is not met."""
        if not b.any():
            return np.zeros(len(b))
        right = self.scale * b[self.order]
        found, left = self._cycles("cg", right) if self.symmetric else (right, np.inf)
        if not left <= 10.0 * self.tolerance:  # far from balance tangents are indefinite
            found, left = self._cycles("gmres", right)
        if not left <= 10.0 * self.tolerance:
            raise SingularMatrix(
                f"multigrid left {left:.1e} of the right side after {self.most} steps; allowed are "
                f'{self.tolerance:.0e}. Use linear = "direct"'
            )
        x = np.empty(len(b))
        x[self.order] = self.scale * found
        return x

    def _cycles(self, method: str, b: Array) -> tuple[Array, float]:
        """Solution of a Krylov method, and what it leaves of b, relative to it."""
        x = self._solved(method, b)[0]
        left = np.linalg.norm(b - self.levels.levels[0].A @ x) / np.linalg.norm(b)
        return x, float(left)

    def _solved(self, method: str, b: Array) -> tuple[Array, int]:
        """Solution of a Krylov method, and -1 where the matrix is found to be indefinite.

        Warnings of that are caught: pyamg lets none of them be ignored.
        """
        with warnings.catch_warnings(record=True):
            given = {"tol": self.tolerance, "maxiter": self.most, "accel": method}
            x, info = self.levels.solve(b, return_info=True, **given)
        return x, int(info)

    def loosest(self) -> None:
        """See `solve.held.Judging`: iterations that converged show that the matrix is regular."""

    def indefinite(self) -> bool | None:
        """True where the matrix has a negative eigenvalue; None where it is not symmetric.

        One of the coarsest grid is one of the matrix. Otherwise conjugate gradients tell: on a
        random right side, in which each mode has its share, they meet what they must divide by.
        """
        if not self.symmetric:
            return None
        coarse = self.levels.levels[-1].A.toarray()
        values = np.linalg.eigvalsh((coarse + coarse.T) / 2.0)
        if values[0] < -_ROUNDING * np.abs(values).max():
            return True
        b = np.random.default_rng(0).uniform(-1.0, 1.0, len(self.order))
        return self._solved("cg", b)[1] < 0


@dataclass(eq=False)
class OrFactors:
    """Multigrid that goes over to factors for good where it fails.

    second: None where they would be too large. taken: whether it has.
    """

    first: Multigrid
    second: LinearSolver | None
    taken: bool = field(default=False, init=False)

    @property
    def name(self) -> str:
        """Of the solver that is used."""
        over = self._over
        return f"{over.name} after multigrid failed" if over else self.first.name

    @property
    def _over(self) -> LinearSolver | None:
        return self.second if self.taken else None

    def factorise(self, K: SparseMatrix) -> Factors:
        """Factors of K, (n, n); raises SingularMatrix."""
        if self._over is not None:
            return self._over.factorise(K)
        return _Either(self, K, self.first.factorise(K))


@dataclass(eq=False)
class _Either:
    choice: OrFactors
    K: SparseMatrix
    factors: Factors

    def solve(self, b: Array) -> Array:
        try:
            return self.factors.solve(b)
        except SingularMatrix:
            second = self.choice.second
            if second is None or self.choice.taken:
                raise
            self.choice.taken = True
            self.factors = second.factorise(self.K)
            return self.factors.solve(b)

    def loosest(self) -> None:
        """See `Preconditioned`."""

    def indefinite(self) -> bool | None:
        """See `Preconditioned`; None where factors stand in."""
        return self.factors.indefinite() if isinstance(self.factors, Preconditioned) else None

    def pivots(self) -> Array | None:
        """Of the factors that stand in, if they know them."""
        known = getattr(self.factors, "pivots", None)
        return None if known is None else known()
