"""Sparsity pattern of assembled matrices, and the position of every element entry in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array

from softehl.runtime.arrays import Array, Integers

Small = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Pattern:
    """Sparsity of a matrix that element blocks share, compressed by columns.

    indptr (size + 1,), indices (nnz,): csc structure, every diagonal entry included, symmetric.
    diagonal: (size,) positions of the diagonal in the data. scatter: for each block the position
    (n * ndof * ndof,) of every element entry in the data.
    """

    size: int
    indptr: Small
    indices: Small
    diagonal: Integers
    scatter: tuple[Integers, ...]

    @property
    def nnz(self) -> int:
        """Number of stored entries."""
        return len(self.indices)

    def matrix(self, data: Array) -> csc_array[np.float64]:
        """The csc matrix with these data (nnz,); the structure is shared, not copied."""
        structure = (data, self.indices, self.indptr)
        return csc_array(structure, shape=(self.size, self.size), copy=False)


@dataclass(frozen=True, eq=False)
class Structure:
    """Dof maps, (n, ndof) each, of element blocks over `size` unknowns; ValueError if one points
    outside. Their pattern is built when it is first asked for: it is the largest thing of all,
    and whoever keeps the matrix elsewhere never asks.
    """

    size: int
    dof_maps: tuple[Integers, ...]

    def __post_init__(self) -> None:
        for dofs in self.dof_maps:
            if dofs.size and (dofs.min() < 0 or dofs.max() >= self.size):
                raise ValueError(f"a dof map points outside the {self.size} unknowns")

    @cached_property
    def pattern(self) -> Pattern:
        """See `build_pattern`."""
        return build_pattern(self.size, self.dof_maps)


def build_pattern(size: int, dof_maps: Sequence[Integers]) -> Pattern:
    """Pattern of the matrix of order `size` to which elements with these dofs contribute.

    Entries get into the order of their columns and rows by two conversions of a sparse matrix,
    which take time in proportion to their number; what a map shares with an earlier one is not
    looked up again.
    """
    parts = [_NewEntries(np.arange(size)[:, None])]  # so that every diagonal entry is there
    for dofs in dof_maps:
        parts.append(_NewEntries.of(dofs, parts[1:]))
    order, rows, starts = _sorted_entries(size, parts)
    fresh = np.empty(len(rows), dtype=bool)
    fresh[1:] = rows[1:] != rows[:-1]
    fresh[starts[:-1]] = True
    count = np.cumsum(fresh)
    where = np.empty(len(rows), dtype=np.int64)
    where[order] = count - 1
    scatter: list[Integers] = []
    for part, entries in zip(parts, _split(where, [part.count for part in parts]), strict=True):
        scatter.append(part.positions(entries, scatter[1:]))
    indptr = np.concatenate([[0], count])[starts].astype(np.int32)
    return Pattern(size, indptr, rows[fresh], scatter[0], tuple(scatter[1:]))


@dataclass(frozen=True, eq=False)
class _NewEntries:
    """Entries of the elements of a dof map, (n, k), that are not those of an earlier one.

    source: number of an earlier map that this one begins with; shared: its number of columns.
    """

    dofs: Integers
    source: int = 0
    shared: int = 0

    @classmethod
    def of(cls, dofs: Integers, earlier: Sequence[_NewEntries]) -> _NewEntries:
        """The entries of a map that none of the earlier ones has, as far as that is easily seen."""
        for number, other in enumerate(earlier):
            if np.array_equal(dofs[:, : other.dofs.shape[1]], other.dofs):
                return cls(dofs, number, other.dofs.shape[1])
        return cls(dofs)

    @property
    def local(self) -> tuple[Integers, Integers]:
        """Local rows and columns of these entries."""
        new = np.ones((self.dofs.shape[1],) * 2, dtype=bool)
        new[: self.shared, : self.shared] = False
        rows, columns = np.nonzero(new)
        return rows, columns

    @property
    def count(self) -> int:
        """Number of these entries."""
        n, k = self.dofs.shape
        return int(n * (k**2 - self.shared**2))

    def positions(self, own_entries: Integers, earlier: Sequence[Integers]) -> Integers:
        """Positions of all entries of the map from those of these, and of earlier maps."""
        if not self.shared:
            return own_entries
        n, k = self.dofs.shape
        previous = earlier[self.source]
        if k == self.shared:
            return previous
        result = np.empty((n, k, k), dtype=np.int64)
        result[:, : self.shared, : self.shared] = previous.reshape(n, self.shared, self.shared)
        rows, columns = self.local
        result[:, rows, columns] = own_entries.reshape(n, -1)
        return result.ravel()


def _sorted_entries(size: int, parts: Sequence[_NewEntries]) -> tuple[Small, Small, Small]:
    """Entries (m,) by column, then row: their numbers (m,), rows (m,), starts of columns."""
    rows, columns = (
        np.concatenate(
            [part.dofs.astype(np.int32).take(part.local[k], 1).ravel() for part in parts]
        )
        for k in (0, 1)
    )
    numbers = np.arange(len(rows), dtype=np.int32)
    entries = coo_array((numbers, (rows, columns)), shape=(size, size))
    entries.has_canonical_format = True  # else entries at one place would be added up
    ordered = entries.tocsr().tocsc()
    return ordered.data, ordered.indices, ordered.indptr


def _split(values: Integers, counts: Sequence[int]) -> list[Integers]:
    bounds = np.cumsum([0, *counts])
    return [values[first:last] for first, last in pairwise(bounds)]
