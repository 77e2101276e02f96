"""A sparse matrix whose unknowns are in another order, by its entries, which come again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from softehl.runtime.arrays import Integers
from softehl.runtime.solve.linear import SparseMatrix

_UNSYMMETRIC = 1e-9  # of the largest entry


@dataclass(frozen=True, eq=False)
class Entries:
    """Numbers of the entries of a matrix whose unknowns are in another order.

    indices, indptr: of the matrix, by columns. place: numbers of its entries, (n, n), by rows, in
    the order. turned: those of the transpose, in the same pattern; None where it has another.
    """

    indices: Any
    indptr: Any
    place: csr_array[np.int64]
    turned: Integers | None

    @classmethod
    def of(cls, K: SparseMatrix, order: Integers) -> Entries:
        """Of the pattern of K, (n, n)."""
        numbers = csr_array((np.arange(K.nnz), K.indices, K.indptr), shape=K.shape)
        turned = numbers[order][:, order]  # of columns that are taken for rows
        place = csr_array(turned.T)
        for found in (turned, place):
            found.sort_indices()
        alike = all(
            np.array_equal(getattr(turned, name), getattr(place, name))
            for name in ("indptr", "indices")
        )
        return cls(K.indices, K.indptr, place, turned.data if alike else None)

    def fit(self, K: SparseMatrix) -> bool:
        """True if K has the pattern."""
        return np.array_equal(K.indptr, self.indptr) and np.array_equal(K.indices, self.indices)

    def taken(self, K: SparseMatrix) -> tuple[csr_array[np.float64], bool]:
        """K in the order, and whether it is symmetric."""
        place, data = self.place, K.data[self.place.data]
        found = csr_array((data, place.indices, place.indptr), shape=place.shape)
        if self.turned is None:
            return found, False
        uneven = float(np.abs(data - K.data[self.turned]).max(initial=0.0))
        return found, uneven <= _UNSYMMETRIC * float(np.abs(data).max(initial=0.0))
