"""A sparse matrix whose unknowns are in another order, by its entries, which come again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import bsr_array, csr_array

from softehl.runtime.arrays import Integers
from softehl.runtime.solve.linear import SparseMatrix

_UNSYMMETRIC = 1e-9  # of the largest entry


@dataclass(frozen=True, eq=False)
class Entries:
    """Numbers of the entries of a matrix whose unknowns are in another order.

    indices, indptr: of the matrix, by columns. place: numbers of its entries, (n, n), by blocks of
    rows, in the order; -1 where a block has more than the matrix.
    """

    indices: Any
    indptr: Any
    place: bsr_array

    @classmethod
    def of(cls, K: SparseMatrix, order: Integers, block: int = 1) -> Entries:
        """Of the pattern of K, (n, n), with blocks of so many rows and columns."""
        numbers = csr_array((np.arange(1, K.nnz + 1), K.indices, K.indptr), shape=K.shape)
        place = csr_array(numbers[order][:, order].T)  # of columns that are taken for rows
        place.sort_indices()
        blocks = bsr_array(place.tobsr((block, block)))
        blocks.data -= 1
        return cls(K.indices, K.indptr, blocks)

    def fit(self, K: SparseMatrix) -> bool:
        """True if K has the pattern."""
        return np.array_equal(K.indptr, self.indptr) and np.array_equal(K.indices, self.indices)

    def taken(self, K: SparseMatrix) -> tuple[Any, bool]:
        """K in the order, by blocks, and whether it is symmetric."""
        place = self.place
        data = np.append(K.data, 0.0)[place.data]
        found = bsr_array((data, place.indices, place.indptr), shape=place.shape)
        u, v = np.random.default_rng(0).uniform(-1.0, 1.0, (2, place.shape[0]))
        uneven = abs(float(u @ (found @ v) - v @ (found @ u)))
        return found, uneven <= _UNSYMMETRIC * float(
            max(data.max(initial=0.0), -data.min(initial=0.0))
        )
