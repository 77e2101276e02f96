"""Conjugate gradients with algebraic multigrid (pyamg): for problems too large for factors."""

from __future__ import annotations

import importlib.util
import warnings
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.solve.linear import (
    Factors,
    LinearSolver,
    SingularMatrix,
    SparseMatrix,
    checked_row_sums,
)

_UNSYMMETRIC = 1e-9  # of the largest entry
_COARSEST = 100  # unknowns that are solved by a pseudo-inverse, in milliseconds


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
        A = csr_array(K)[order][:, order]
        alone = (sums == np.abs(K.diagonal()))[order]  # prescribed: nothing else in the row
        near = np.where(alone[:, None], 0.0, self.modes.near)
        largest = float(np.abs(A.data).max(initial=0.0))
        symmetric = bool(abs(A - A.T).max() <= _UNSYMMETRIC * largest)
        levels = hierarchy(A, near, block)
        return Preconditioned(levels, order, symmetric, self.tolerance, self.most)


def hierarchy(A: csr_array[np.float64], near: Array, block: int, *, light: bool = False) -> Any:
    """Smoothed aggregation of A, (n, n), as pyamg has it: a symmetric cycle.

    near: (n, k) motions that A hardly resists. block: unknowns of a node, which are neighbours.
    light: half the sweeps, and an interpolation that costs more to make.
    """
    import pyamg

    sweeps = ("forward", "backward") if light else ("symmetric", "symmetric")
    before, after = (("block_gauss_seidel", {"sweep": sweep}) for sweep in sweeps)
    with np.errstate(all="ignore"):
        return pyamg.smoothed_aggregation_solver(
            A.tobsr((block, block)),
            B=near,
            strength=("symmetric", {"theta": 0.0}),
            smooth=("energy", {"krylov": "cg"}) if light else "jacobi",
            improve_candidates=None,
            presmoother=before,
            postsmoother=after,
            max_coarse=_COARSEST,
        )


@dataclass(frozen=True, eq=False)
class Preconditioned:
    """A hierarchy of grids of a matrix, as `Factors`."""

    levels: Any
    order: Integers
    symmetric: bool
    tolerance: float
    most: int

    def solve(self, b: Array) -> Array:
        """x of A x = b, (n,), to the tolerance; raises SingularMatrix where it is not met."""
        if not b.any():
            return np.zeros(len(b))
        right = b[self.order]
        found, left = self._cycles("cg", right) if self.symmetric else (right, np.inf)
        if not left <= 10.0 * self.tolerance:  # far from balance tangents are indefinite
            found, left = self._cycles("gmres", right)
        if not left <= 10.0 * self.tolerance:
            raise SingularMatrix(
                f"multigrid left {left:.1e} of the right side after {self.most} steps; allowed are "
                f'{self.tolerance:.0e}. Use linear = "direct"'
            )
        x = np.empty(len(b))
        x[self.order] = found
        return x

    def _cycles(self, method: str, b: Array) -> tuple[Array, float]:
        """Solution of a Krylov method, and what it leaves of b, relative to it."""
        given = {"tol": self.tolerance, "maxiter": self.most, "accel": method}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a matrix that is indefinite: see `solve`
            x = self.levels.solve(b, **given)
        left = np.linalg.norm(b - self.levels.levels[0].A @ x) / np.linalg.norm(b)
        return x, float(left)

    def loosest(self) -> None:
        """See `solve.held.Judging`: iterations that converged show that the matrix is regular."""


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
