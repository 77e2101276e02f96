"""A band whose unknowns come in groups along a chain, solved group by group for many right sides.

The unknowns inside an element of a film are coupled to each other and to the two at its ends only.
They are eliminated all at once; a band of a third of its width and length is left for LAPACK, which
goes through the right sides of a band one by one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from softehl.runtime.arrays import Array, Integers

_FEWEST = 4  # groups that are worth it


@dataclass(frozen=True, eq=False)
class Groups:
    """Of a chain of k unknowns: like groups that know themselves and at most two others each.

    inner: (G, g) unknowns of the groups. outer: (n,) all others. ends: (G, 2) the others that a
    group knows, as they are numbered in `outer`, n for none. places: of the entries inner x inner,
    inner x ends and ends x inner in the band (lower + upper + lower + 1 values a column, column by
    column), where 0 is an entry that is zero. kept: where entries outer x outer are, and where they
    go in the band that is left. added: (G, 2, 2) where those of the groups go. width: below and
    above the diagonal of the band that is left.
    """

    inner: Integers
    outer: Integers
    ends: Integers
    places: tuple[Integers, Integers, Integers]
    kept: tuple[Integers, Integers]
    added: Integers
    width: int

    @classmethod
    def of(cls, i: Integers, j: Integers, k: int, widths: tuple[int, int]) -> Groups | None:
        """Of a chain with entries at rows i and columns j; None where it has no such groups.

        widths: of the band below and above its diagonal.
        """
        lower, upper = widths
        if not lower or not len(i):
            return None
        first, last = np.arange(k), np.arange(k)
        for row, column in ((i, j), (j, i)):
            np.minimum.at(first, row, column)
            np.maximum.at(last, row, column)
        inner = _groups(first, last)
        if len(inner) < _FEWEST:
            return None
        others = np.setdiff1d(np.arange(k), inner)
        number = np.full(k + 1, len(others))
        number[others] = np.arange(len(others))
        known = np.stack([first[inner[:, 0]], last[inner[:, 0]]], axis=1)
        known[(known >= inner[:, :1]) & (known <= inner[:, -1:])] = k
        ends = number[known]
        between = np.flatnonzero((number[i] < len(others)) & (number[j] < len(others)))
        a, b = number[i[between]], number[j[between]]
        width = max(int(np.abs(a - b).max(initial=0)), 1)
        if (np.ptp(ends, axis=1)[(ends < len(others)).all(axis=1)] > width).any():
            return None

        def places(rows: Integers, columns: Integers) -> Integers:
            at = columns * (2 * lower + upper + 1) + (lower + upper + rows - columns)
            there = (rows < k) & (columns < k)
            there &= (rows - columns <= lower) & (columns - rows <= upper)
            return np.asarray(np.where(there, at, 0))

        def left(rows: Integers, columns: Integers) -> Integers:
            at = columns * (3 * width + 1) + (2 * width + rows - columns)
            there = (rows < len(others)) & (columns < len(others))
            return np.asarray(np.where(there, at, 0))  # of what LAPACK overwrites

        return cls(
            inner,
            others,
            ends,
            (
                places(inner[:, :, None], inner[:, None, :]),
                places(inner[:, :, None], known[:, None, :]),
                places(known[:, :, None], inner[:, None, :]),
            ),
            (places(i[between], j[between]), left(a, b)),
            left(ends[:, :, None], ends[:, None, :]),
            width,
        )

    def solve(self, band: Array, b: Array) -> Array | None:
        """x (k, j) of the band for right sides b (k, j); None where a group is singular.

        band: (2 lower + upper + 1, k), which stays as it is.
        """
        entries, n = band.T.ravel(), len(self.outer)
        inside, out, back = (entries[places] for places in self.places)
        try:
            inverse = np.linalg.inv(inside)
        except np.linalg.LinAlgError:
            return None
        if not np.isfinite(inverse).all():
            return None
        x, y = inverse @ b[self.inner], inverse @ out
        small = np.zeros((n, 3 * self.width + 1))
        small.ravel()[self.kept[1]] = entries[self.kept[0]]
        np.subtract.at(small.ravel(), self.added, back @ y)
        small[0, 0] = 0.0
        rest = np.zeros((n + 1, b.shape[1]))
        rest[:n] = b[self.outer]
        loads = back @ x
        for side in (0, 1):
            rest[self.ends[:, side]] -= loads[:, side]
        _, _, found, info = lapack.dgbsv(self.width, self.width, small.T, rest[:n])
        if info:
            return None
        rest[:n], rest[n] = found, 0.0
        solution = np.empty_like(b)
        solution[self.outer] = found
        solution[self.inner] = x - y @ rest[self.ends]
        return solution


def _groups(first: Integers, last: Integers) -> Integers:
    """Groups (G, g) of neighbours that all know the same of a chain, from the first to the last
    unknown that each of them knows; those of the size that is found most often.
    """
    begins = np.flatnonzero((np.diff(first, prepend=-1) != 0) | (np.diff(last, prepend=-1) != 0))
    sizes = np.diff(np.append(begins, len(first)))
    beside = (first[begins] >= begins - 1) & (last[begins] <= begins + sizes)
    begins, sizes = begins[beside & (sizes > 1)], sizes[beside & (sizes > 1)]
    if not len(sizes):
        return np.empty((0, 0), dtype=np.int64)
    size = np.bincount(sizes).argmax()
    return np.asarray(begins[sizes == size][:, None] + np.arange(size))
