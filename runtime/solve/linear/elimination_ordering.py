"""Fill-reducing orderings, computed once for a pattern and reused by its later matrices."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import SuperLU

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.solve.linear.linear_solver import Factors, SparseMatrix

Small = NDArray[np.int32]

MOST_ENTRIES = 1 << 23
"""Of a pattern that is remembered: beyond, finding an order is a small part of the work."""

MOST_COPIED = 30_000_000
"""Entries of factors that are copied to look at a few of them."""

NOTHING: Integers = np.empty(0, dtype=np.int64)
"""No boundary."""


@dataclass(frozen=True, eq=False)
class EliminationOrder:
    """Order of rows and columns of a pattern before it is factorised.

    pattern: indptr and indices of the pattern, csc. boundary: (m,) unknowns that come last, in this
    order. unknowns: (n,) all of them as they come. indptr, indices: the arranged pattern, csc.
    positions: (nnz,) where its entries are among those that are given.
    """

    pattern: tuple[Small, Small]
    boundary: Integers
    unknowns: Integers
    indptr: Small
    indices: Small
    positions: Small

    @classmethod
    def of(
        cls, K: SparseMatrix, unknowns: Integers, boundary: Integers = NOTHING
    ) -> EliminationOrder:
        """Of the pattern of K, (n, n), in this order (n,), with the boundary put last."""
        n = K.shape[0]
        others: Flags = np.ones(n, dtype=bool)
        others[boundary] = False
        unknowns = np.concatenate([unknowns[others[unknowns]], boundary])
        count = csc_array((np.arange(1.0, K.nnz + 1.0), K.indices, K.indptr), shape=(n, n))
        arranged = csc_array(count[unknowns, :][:, unknowns])
        arranged.sort_indices()
        positions = arranged.data.astype(np.int32) - 1
        return cls(
            (K.indptr, K.indices), boundary, unknowns, arranged.indptr, arranged.indices, positions
        )

    def fits(self, K: SparseMatrix, boundary: Integers) -> bool:
        """True if K has this pattern, and the boundary is the same."""
        return (
            _same(self.pattern[0], K.indptr)
            and _same(self.pattern[1], K.indices)
            and np.array_equal(self.boundary, boundary)
        )

    def arranged(self, K: SparseMatrix) -> SparseMatrix:
        """K with its rows and columns in this order, csc; its data are its own."""
        structure = K.data[self.positions], self.indices, self.indptr
        return csc_array(structure, shape=K.shape, copy=False)


@dataclass
class OrderCache:
    """The latest orders, at most `max_orders` of them: changes with every new pattern."""

    max_orders: int = 4
    orders: list[EliminationOrder] = field(default_factory=list)

    def find(self, K: SparseMatrix, boundary: Integers = NOTHING) -> EliminationOrder | None:
        """Order of K, (n, n), with a boundary (m,); None if it is not known."""
        return next((order for order in self.orders if order.fits(K, boundary)), None)

    def add(self, order: EliminationOrder) -> EliminationOrder:
        """Remember an order, unless its pattern is very large; the oldest is forgotten."""
        if len(order.indices) <= MOST_ENTRIES:
            self.orders.append(order)
            del self.orders[: -self.max_orders]
        return order


@dataclass(frozen=True, eq=False)
class PermutedFactors:
    """Factors of a matrix by those of the arranged one, whatever made them; satisfies `Factors`."""

    order: EliminationOrder
    factors: Factors

    @property
    def takes_columns(self) -> bool:
        """True if `solve` takes b (n, k), too."""
        return isinstance(self.factors, SuperLU)

    def solve(self, b: Array) -> Array:
        """x of K x = b, shapes (n,)."""
        x = np.empty(b.shape)
        x[self.order.unknowns] = self.factors.solve(b[self.order.unknowns])
        return x

    def transposed(self) -> Factors | None:
        """Factors of the transpose, by those of SuperLU; None for others."""
        return TransposedFactors(self) if isinstance(self.factors, SuperLU) else None

    def pivots(self) -> Array | None:
        """Pivots of SuperLU, (n,), if they are all on the diagonal, else None."""
        made = self.factors
        if not isinstance(made, SuperLU) or made.nnz > MOST_COPIED:
            return None
        on_diagonal = np.array_equal(made.perm_r, made.perm_c)
        return np.asarray(made.U.diagonal()) if on_diagonal else None

    def sign(self) -> float | None:
        """Sign of the determinant, by SuperLU's pivots and exchanges of rows and columns."""
        made = self.factors
        if not isinstance(made, SuperLU) or made.nnz > MOST_COPIED:
            return None
        negative = int((made.U.diagonal() < 0.0).sum()) + sum(
            _exchanges(order) for order in (made.perm_r, made.perm_c)
        )
        return -1.0 if negative % 2 else 1.0


def _exchanges(order: Integers) -> int:
    """Number of exchanges that make a permutation: its length less the number of its cycles."""
    n = len(order)
    graph = csr_array((np.ones(n), (np.arange(n), order)), shape=(n, n))
    return n - int(connected_components(graph)[0])


@dataclass(frozen=True)
class TransposedFactors:
    """Factors of the transpose by those of SuperLU; satisfies `Factors`."""

    factors: PermutedFactors

    def solve(self, b: Array) -> Array:
        """x of K^T x = b, shapes (n,)."""
        order, made = self.factors.order, self.factors.factors
        assert isinstance(made, SuperLU)
        x = np.empty(len(b))
        right = b[order.unknowns]
        x[order.unknowns] = made.solve(right, trans="T")  # type: ignore[call-overload]
        return x


def without_zeros(K: SparseMatrix) -> SparseMatrix:
    """K without the entries that are stored and zero: what is switched off keeps its place in a
    pattern, and would fill the factors.
    """
    if K.data.all():
        return K
    K = K.copy()
    K.eliminate_zeros()
    return K


def _same(old: Small, new: Small) -> bool:
    return old is new or np.array_equal(old, new)
