"""Elimination of the unknowns along a chain, piece by piece, from a system of them and of others.

A chain falls into pieces that know nothing of each other, with few unknowns between them. All
pieces are eliminated at once, each from the few unknowns that it knows; what is left of the chain
falls into pieces again. The rest is a dense system.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack
from scipy.sparse import csr_array

from softehl.runtime.arrays import Array, Integers

_PIECE = 8, 4  # unknowns of a piece, at most: so many, or so many times those between two
_FEWEST = 6  # pieces that are worth it


@dataclass(frozen=True, eq=False)
class Level:
    """Pieces that are eliminated at once.

    inner: (G, g) unknowns of the pieces. boundary: (G, q) the others that a piece knows. Both have
    n, the number of all unknowns, where a piece has fewer. inside, out, back: places of the entries
    inner x inner, inner x known and known x inner. added: where entries known x known go.
    """

    inner: Integers
    boundary: Integers
    inside: Integers
    out: Integers
    back: Integers
    added: Integers

    def eliminate(self, entries: Array, r: Array) -> Array:
        """inside^-1 [out, r], (G, g, q + 1); what it leaves is taken off the entries and r."""
        right = np.concatenate([entries[self.out], r[self.inner][..., None]], axis=2)
        solved = np.linalg.solve(entries[self.inside], right)
        change = entries[self.back] @ solved
        np.subtract.at(entries, self.added.ravel(), change[..., :-1].ravel())
        np.subtract.at(r, self.boundary.ravel(), change[..., -1].ravel())
        return np.asarray(solved)


@dataclass(frozen=True, eq=False)
class Elimination:
    """Of n unknowns, the first m of which are outside the chain.

    data_slots: places of the entries of the matrix among all that there will be. count: of these;
    two more are 0 and 1. remaining: unknowns of the dense system, the first m and what is left of
    the chain. dense: places of its entries, and where they go.
    """

    m: int
    n: int
    levels: tuple[Level, ...]
    data_slots: Integers
    count: int
    remaining: Integers
    dense: tuple[Integers, Integers]

    @classmethod
    def of(cls, rows: Integers, columns: Integers, m: int, n: int) -> Elimination:
        """For a matrix (n, n) with entries at these rows and columns."""
        entries = np.append(rows, columns), np.append(columns, rows)
        pattern = _ones(csr_array((np.ones(2 * len(rows)), entries), (n, n)))
        chain, levels_found = np.arange(m, n), []
        while True:
            pieces = _pieces(pattern, chain)
            if len(pieces) < _FEWEST:
                break
            ones = np.ones(sum(map(len, pieces)))
            of = np.repeat(np.arange(len(pieces)), [len(piece) for piece in pieces])
            selection = csr_array((ones, (of, np.concatenate(pieces))), (len(pieces), n))
            chain = np.setdiff1d(chain, selection.indices)
            alive = np.zeros(n)
            alive[:m] = alive[chain] = 1.0
            adjacency = csr_array((selection @ pattern).multiply(alive[None]))
            adjacency.eliminate_zeros()
            levels_found.append((_padded(selection), _padded(adjacency)))
            pattern = _ones(csr_array(pattern + adjacency.T @ adjacency))
        remaining = np.append(np.arange(m), chain)
        number = np.full(n, -1)
        number[remaining] = np.arange(len(remaining))
        row, column = pattern.nonzero()
        inside = np.flatnonzero((number[row] >= 0) & (number[column] >= 0))
        to = number[row[inside]] * len(remaining) + number[column[inside]]
        slots = _Places.of(pattern)
        levels = tuple(slots.level(inner, boundary) for inner, boundary in levels_found)
        data_slots = slots(rows, columns)
        return cls(m, n, levels, data_slots, pattern.nnz, remaining, (inside, to))

    def solve(self, outside: Array, data: Array, r: Array) -> Array | None:
        """x (n,) of the matrix of these entries, with (m, m) added, for r (n,).

        None where it cannot be solved, or a piece cannot be eliminated.
        """
        entries, x, solved = np.zeros(self.count + 2), np.append(r, 0.0), []
        entries[self.data_slots] = data
        entries[-1] = 1.0
        try:
            for level in self.levels:
                solved.append(level.eliminate(entries, x))
        except np.linalg.LinAlgError:
            return None
        A = np.zeros((len(self.remaining), len(self.remaining)))
        A.ravel()[self.dense[1]] = entries[self.dense[0]]
        A[: self.m, : self.m] += outside
        factors, pivots, info = lapack.dgetrf(A.T, overwrite_a=True)
        if info:
            return None
        x[self.remaining], _ = lapack.dgetrs(factors, pivots, x[self.remaining], trans=1)
        for level, boundary_values in zip(reversed(self.levels), reversed(solved), strict=True):
            around = np.append(-x[level.boundary], np.ones((len(boundary_values), 1)), axis=1)
            x[level.inner] = (boundary_values @ around[..., None])[..., 0]
        return x[:-1]


@dataclass(frozen=True, eq=False)
class _Places:
    """Places of the entries of a pattern (n, n), in order. keys: row (n + 1) + column, rising."""

    keys: Integers
    n: int

    @classmethod
    def of(cls, pattern: csr_array) -> _Places:
        row, column = pattern.nonzero()
        return cls(row * (pattern.shape[0] + 1) + column, pattern.shape[0])

    def __call__(self, rows: Integers, columns: Integers) -> Integers:
        """Places; one after the last of those that there are not."""
        keys = rows * (self.n + 1) + columns
        at = np.searchsorted(self.keys, keys)
        stored = np.append(self.keys, -1)[at] == keys
        return np.asarray(np.where(stored, at, len(self.keys)))

    def level(self, inner: Integers, boundary: Integers) -> Level:
        """With 1 on the diagonal where a piece has fewer unknowns."""
        inside = self(inner[:, :, None], inner[:, None, :])
        piece, number = np.nonzero(inner == self.n)
        inside[piece, number, number] = len(self.keys) + 1
        return Level(
            inner,
            boundary,
            inside,
            self(inner[:, :, None], boundary[:, None, :]),
            self(boundary[:, :, None], inner[:, None, :]),
            self(boundary[:, :, None], boundary[:, None, :]),
        )


def _ones(pattern: csr_array) -> csr_array:
    """A pattern in order, with ones."""
    pattern.sum_duplicates()
    pattern.data[:] = 1.0
    return pattern


def _padded(rows: csr_array) -> Integers:
    """The columns (G, q) of each row of a pattern (G, n), rising; n where there are fewer."""
    rows.sort_indices()
    sizes = np.diff(rows.indptr)
    result = np.full((len(sizes), sizes.max(initial=0)), rows.shape[1], dtype=np.int64)
    result[np.arange(result.shape[1]) < sizes[:, None]] = rows.indices
    return result


def _pieces(pattern: csr_array, chain: Integers) -> list[Integers]:
    """Pieces of a chain that know nothing of each other; as few as can be are between them."""
    inner_pattern = pattern[chain][:, chain].tocoo()
    reach, k = np.arange(len(chain)), len(chain)
    np.maximum.at(reach, inner_pattern.row, inner_pattern.col)
    width = np.maximum.accumulate(reach) - np.arange(k)  # of what is between, if it ended there
    largest = max(_PIECE[0], _PIECE[1] * int(width[width > 0].min(initial=k)))
    pieces, start = [], 0
    while start < k:
        window = width[start : start + largest]
        size = len(window) - int(window[::-1].argmin())
        pieces.append(chain[start : start + size])
        start += size + int(window[size - 1])
    return pieces
