"""Numbering of the unknowns: named fields, one after another, in one vector."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from softehl.errors import UnknownNameError
from softehl.runtime.arrays import Integers

AXES = ("x", "y", "z", "r")
"""Suffixes of the names of the components of a vector."""


@dataclass(frozen=True)
class DofLayout:
    """Places of the named fields in the vector of unknowns.

    names, counts: fields in the order in which they are numbered.
    """

    names: tuple[str, ...]
    counts: tuple[int, ...]

    @classmethod
    def of(cls, **counts: int) -> DofLayout:
        """Layout of fields given as name=count, in that order."""
        return cls(tuple(counts), tuple(counts.values()))

    @property
    def total(self) -> int:
        """Length of the vector of unknowns."""
        return sum(self.counts)

    def count(self, name: str) -> int:
        """Number of unknowns of a field; KeyError for an unknown name."""
        part = self.part(name)
        return int(part.stop - part.start)

    def part(self, name: str) -> slice:
        """Slice of a field in the vector of unknowns; KeyError for an unknown name."""
        try:
            return self._parts[name]
        except KeyError:
            known = ", ".join(self.names)
            raise UnknownNameError(f"no field {name!r}; there are {known}") from None

    def dofs(self, name: str) -> Integers:
        """Numbers (count,) of the unknowns of a field; KeyError for an unknown name."""
        part = self.part(name)
        return np.arange(part.start, part.stop)

    @cached_property
    def fields(self) -> tuple[Integers, ...]:
        """Numbers of the unknowns of each field; components u_x, u_y, ... of one are together."""
        return tuple(np.concatenate([self.dofs(n) for n in names]) for names in self.vectors)

    @cached_property
    def vectors(self) -> tuple[tuple[str, ...], ...]:
        """Names of the fields, those of the components of a vector together."""
        found: dict[str, list[str]] = {}
        for name in self.names:
            stem, _, axis = name.rpartition("_")
            found.setdefault(stem if stem and axis in AXES else name, []).append(name)
        return tuple(map(tuple, found.values()))

    @cached_property
    def _parts(self) -> dict[str, slice]:
        ends = itertools.accumulate(self.counts)
        named = zip(self.names, self.counts, ends, strict=True)
        return {name: slice(end - count, end) for name, count, end in named}


def displacement_dofs(nodes: Integers) -> Integers:
    """Displacement unknowns u_z, u_r of nodes (n, k), node by node: (n, 2 k)."""
    pairs = np.stack([2 * nodes, 2 * nodes + 1], axis=-1)
    return pairs.reshape(len(nodes), 2 * nodes.shape[-1])


def chain_dofs(segments: int, order: int, first: int) -> Integers:
    """Unknowns of a continuous piecewise polynomial along a chain: (segments, order + 1).

    Neighbours share the unknown at their common end, so `order * segments + 1` are used.
    """
    start = first + order * np.arange(segments)
    return start[:, None] + np.arange(order + 1)[None, :]


def separate_dofs(segments: int, order: int, first: int) -> Integers:
    """Unknowns of a discontinuous piecewise polynomial along a chain: (segments, order + 1).

    Neighbours share none, so `(order + 1) * segments` are used.
    """
    return first + np.arange(segments * (order + 1)).reshape(segments, order + 1)


def gather_rows(*parts: Integers) -> Integers:
    """Element dof map (n, ndof) from maps that stand side by side; each (n, k) or (n,)."""
    columns: Sequence[Integers] = [p[:, None] if p.ndim == 1 else p for p in parts]
    return np.ascontiguousarray(np.concatenate(columns, axis=1))
