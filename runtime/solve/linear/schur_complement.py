"""Condensations of a matrix onto a few unknowns, from factors that a direct solver makes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.solve.linear.elimination_ordering import EliminationOrder, PermutedFactors
from softehl.runtime.solve.linear.linear_solver import (
    Factors,
    SingularMatrix,
    SparseMatrix,
    checked_row_sums,
)

_RIGHT_SIDES = 64  # at a time; all at once would need much memory
_LAST = 1e-12  # factor on the rows of the boundary, so that none is a pivot of the interior

SparseFactors: TypeAlias = Any
"""Result of scipy's splu: solve, L, U, perm_r, perm_c."""


@dataclass(frozen=True, eq=False)
class SchurBySolves:
    """A condensation by solves with many right sides; satisfies `SchurComplement`.

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
        """See `SchurComplement`."""
        y = np.zeros(len(r))
        y[self.interior] = self.factors.solve(r[self.interior])
        return np.asarray(r[self.boundary] - self.couplings[0] @ y[self.interior]), y

    def extend(self, reduced: Array, x: Array) -> Array:
        """See `SchurComplement`."""
        full = reduced.copy()
        full[self.interior] -= self.factors.solve(np.asarray(self.couplings[1] @ x))
        full[self.boundary] = x
        return full


@dataclass(frozen=True, eq=False)
class SchurByFactors:
    """A condensation by one factorisation in which the boundary comes last; see `SchurComplement`.

    What is factorised is K with a stiffness added at the boundary, so that it is regular whatever
    holds the body. stiffened: (m, m) its Schur complement. factors: of it, with the rows of the
    boundary scaled.
    """

    boundary: Integers
    schur: Array
    stiffened: Array
    factors: Factors

    @classmethod
    def of(
        cls,
        K: SparseMatrix,
        order: EliminationOrder,
        factors_of: Callable[[SparseMatrix], SparseFactors],
        max_entries: int,
    ) -> SchurByFactors:
        """Of K, (n, n), arranged with the boundary last; factors_of: without another order.

        max_entries: largest number of entries of factors that are copied for a while. Raises
        SingularMatrix, also if there are more or a row of the boundary is a pivot of the interior.
        """
        arranged, first = order.arranged(K), K.shape[0] - len(order.boundary)
        added = _stiffen(arranged, first)
        arranged.data[arranged.indices >= first] *= _LAST
        factors = factors_of(arranged)
        rows, columns = factors.perm_r[first:] - first, factors.perm_c[first:] - first
        if min(rows.min(initial=0), columns.min(initial=0)) < 0:
            raise SingularMatrix("a row of the boundary is a pivot of the interior")
        if factors.nnz > max_entries:
            raise SingularMatrix(f"factors of {factors.nnz} entries are not copied")
        lower, upper = (part[first:, first:].toarray() for part in (factors.L, factors.U))
        stiffened = (lower @ upper)[rows][:, columns] / _LAST
        schur = stiffened - np.diag(added)
        return cls(order.boundary, schur, stiffened, PermutedFactors(order, factors))

    def reduce(self, r: Array) -> tuple[Array, Array]:
        """See `SchurComplement`."""
        y = self._solve(r, r[self.boundary])
        return np.asarray(self.stiffened @ y[self.boundary]), y

    def extend(self, reduced: Array, x: Array) -> Array:
        """See `SchurComplement`."""
        load = self.stiffened @ (x - reduced[self.boundary])
        full = reduced + self._solve(np.zeros(len(reduced)), load)
        full[self.boundary] = x
        return full

    def _solve(self, b: Array, at_boundary: Array) -> Array:
        """Of the stiffened matrix for b, (n,), with other values (m,) at the boundary."""
        scaled = b.copy()
        scaled[self.boundary] = _LAST * at_boundary
        return self.factors.solve(scaled)


def _stiffen(arranged: SparseMatrix, first: int) -> Array:
    """Add (m,) to the diagonal from `first` on: as much as its rows have, and of its sign.

    A multiplier has none on its diagonal, and a negative one once the rest is eliminated.
    """
    start = arranged.indptr[first]
    rows, data = arranged.indices[start:], arranged.data[start:]
    columns = np.repeat(np.arange(first, arranged.shape[0]), np.diff(arranged.indptr[first:]))
    size = np.zeros(len(arranged.indptr) - 1 - first)
    np.maximum.at(size, columns - first, np.abs(data))
    size[size == 0.0] = 1.0
    diagonal = np.flatnonzero(rows == columns)
    added = np.where(data[diagonal] > 0.0, size, -size)
    data[diagonal] += added
    return added
