"""A layer's tangent, cut between the unknowns that it shares and its own.

The places of the entries are found once for a pattern. Its own unknowns are numbered along the
layer, so that their matrix is a band.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.band import Groups

Small = NDArray[np.int32]
Places = tuple[Integers, Integers]
"""Where entries are in the data of a matrix, and where they go."""


@dataclass(frozen=True, eq=False)
class Cut:
    """Of a pattern of m shared unknowns, first, and k own ones.

    shared: of its first m columns, to (m + k, m). right: of the first m rows of the others, csr
    with indices and indptr. own: of the rest, to the band (2 lower + upper + 1, k) of LAPACK.
    """

    m: int
    k: int
    shared: Places
    right: tuple[Integers, Integers, Integers]
    own: Places
    lower: int
    upper: int
    groups: Groups | None = None

    @classmethod
    def of(cls, indptr: Small, indices: Small, m: int, size: int) -> Cut:
        """Of a csc pattern whose first `size` = m + k rows and columns count."""
        k = size - m
        columns = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))
        rows, inside = indices.astype(np.int64), (indices < size) & (columns < size)
        first = np.flatnonzero(inside & (columns < m))
        right = np.flatnonzero(inside & (columns >= m) & (rows < m))
        right = right[np.lexsort((columns[right], rows[right]))]
        counts = np.bincount(rows[right], minlength=m)
        own = np.flatnonzero(inside & (columns >= m) & (rows >= m))
        i, j = rows[own] - m, columns[own] - m
        lower, upper = int((i - j).max(initial=0)), int((j - i).max(initial=0))
        return cls(
            m=m,
            k=k,
            shared=(first, rows[first] * m + columns[first]),
            right=(right, columns[right] - m, np.concatenate([[0], np.cumsum(counts)])),
            own=(own, (lower + upper + i - j) + j * (2 * lower + upper + 1)),
            lower=lower,
            upper=upper,
            groups=Groups.of(i, j, k, (lower, upper)),
        )

    def parts(self, data: Array) -> Parts:
        """The tangent with these data (nnz,) of the pattern."""
        shared, band = (np.zeros(shape) for shape in self._shapes)
        shared.ravel()[self.shared[1]] = data[self.shared[0]]
        band.ravel()[self.own[1]] = data[self.own[0]]
        place, indices, indptr = self.right
        entries = np.asarray(data[place], dtype=np.float64), indices, indptr
        right = csr_array(entries, shape=(self.m, self.k), dtype=np.float64, copy=False)
        return Parts(self, shared, right, band.T)

    @property
    def _shapes(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Of the shared part, and of the band column by column."""
        return (self.m + self.k, self.m), (self.k, 2 * self.lower + self.upper + 1)


@dataclass(frozen=True, eq=False)
class Parts:
    """shared: (m + k, m) the first columns. right: (m, k) the first rows of the others. own: the
    rest as a band (2 lower + upper + 1, k), with room for what LAPACK's factors need.
    """

    cut: Cut
    shared: Array
    right: csr_array[np.float64]
    own: NDArray[np.float64]

    @classmethod
    def of(cls, L: csc_array[np.float64], m: int) -> Parts:
        """Cut L (m + k, m + k), csc without entries that are given twice."""
        return Cut.of(L.indptr, L.indices, m, L.shape[0]).parts(L.data)
