"""A layer's tangent, cut between the unknowns that it shares and its own.

The places of the entries are found once for a pattern. Its own unknowns are numbered along the
layer and known to few others, so that they are eliminated piece by piece.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.elimination import Elimination

Small = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Cut:
    """Of a csc pattern with m shared unknowns, first, and k own ones.

    inside: places of its entries in the data of a larger pattern. rows, columns: of each.
    """

    m: int
    k: int
    inside: Integers
    rows: Integers
    columns: Integers

    @classmethod
    def of(cls, indptr: Small, indices: Small, m: int, size: int) -> Cut:
        """Of a csc pattern whose first `size` = m + k rows and columns count."""
        columns = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))
        rows = indices.astype(np.int64)
        inside = np.flatnonzero((rows < size) & (columns < size))
        return cls(m, size - m, inside, rows[inside], columns[inside])

    @cached_property
    def elimination(self) -> Elimination:
        """Of the own unknowns."""
        return Elimination.of(self.rows, self.columns, self.m, self.m + self.k)

    def parts(self, data: Array) -> Parts:
        """The tangent with these data of the larger pattern."""
        return Parts(self, data[self.inside])

    def placed(self, rows: Integers, columns: Integers, values: Array) -> Array:
        """Data of a tangent with these entries alone. Raises ValueError where it has none there."""
        size = self.m + self.k
        order = np.lexsort((self.rows, self.columns))
        keys, wanted = self.columns[order] * size + self.rows[order], columns * size + rows
        at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        if not np.array_equal(keys[at], wanted):
            lost = np.flatnonzero(keys[at] != wanted)[0]
            raise ValueError(
                f"the layer's tangent has no entry in row {rows[lost]}, column {columns[lost]}; "
                "add an element that knows both unknowns to the layer"
            )
        return np.asarray(np.bincount(order[at], values, len(keys)), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Parts:
    """data: of the entries of the cut pattern."""

    cut: Cut
    data: Array

    @classmethod
    def of(cls, L: csc_array[np.float64], m: int) -> Parts:
        """Cut L (m + k, m + k), csc without entries that are given twice."""
        return Cut.of(L.indptr, L.indices, m, L.shape[0]).parts(L.data)

    @property
    def matrix(self) -> csc_array[np.float64]:
        """The tangent (m + k, m + k)."""
        cut, size = self.cut, self.cut.m + self.cut.k
        return csc_array((self.data, (cut.rows, cut.columns)), shape=(size, size))

    @property
    def shared(self) -> csc_array[np.float64]:
        """The first columns (m + k, m)."""
        return self.matrix[:, : self.cut.m]
