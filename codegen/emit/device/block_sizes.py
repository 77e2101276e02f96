"""Sizes of a block of threads: its elements, and their nodes, points and shared memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from softehl.codegen.emit.points.point_layout import PointLayout
from softehl.codegen.language.definition import Component

THREADS = 256
"""Threads of a block at most, where an element has no more points."""
SHARED = 48_000
"""Bytes of shared memory that a block may have without asking the driver."""
DOUBLE = 8


@dataclass(frozen=True)
class Nodal:
    """Values at the nodes of one order: components first to last - 1.

    before: nodes of an element in front of these in an index.
    """

    order: int
    first: int
    last: int
    before: int = 0

    @property
    def count(self) -> int:
        """Components."""
        return self.last - self.first

    @property
    def n(self) -> int:
        """Nodes along a line."""
        return self.order + 1


def nodes_of(fields: Sequence[Nodal], dimension: int) -> int:
    """Nodes of an element, those of every order counted by themselves."""
    return int(fields[-1].before + fields[-1].n ** dimension)


def node_of(f: Nodal, name: str) -> str:
    """Number of a node among those of all orders, in C."""
    return f"{f.before} + {name}" if f.before else name


@dataclass(frozen=True, eq=False)
class BlockSizes:
    """Sizes of a layout."""

    layout: PointLayout

    @cached_property
    def components(self) -> list[Component]:
        """Components of all fields, those of the highest order first."""
        return sorted(self.layout.components, key=lambda c: -c.order)

    @cached_property
    def fields(self) -> list[Nodal]:
        """Fields by their order, the highest first."""
        found, before = list[Nodal](), 0
        orders = [c.order for c in self.components]
        for order in dict.fromkeys(orders):
            first = orders.index(order)
            found.append(Nodal(order, first, first + orders.count(order), before))
            before += found[-1].n ** self.D
        return found

    @property
    def D(self) -> int:
        """Dimension."""
        return self.layout.dimension

    @property
    def C(self) -> int:
        """Components."""
        return len(self.components)

    @property
    def _coordinates(self) -> list[Nodal]:
        return [Nodal(self.n - 1, 0, self.D)]

    @cached_property
    def n(self) -> int:
        """Nodes of the cell along a line."""
        assert self.layout.geometry.line is not None
        return len(self.layout.geometry.line.values[0])

    @cached_property
    def q(self) -> int:
        """Points along a line."""
        assert self.layout.geometry.line is not None
        return len(self.layout.geometry.line.values)

    @property
    def m(self) -> int:
        """Entries of a line in an array."""
        return max(self.n, self.q)

    @property
    def row(self) -> int:
        """Length of a line in shared memory, odd: neighbours lie in different banks."""
        return self.m | 1

    @property
    def size(self) -> int:
        """Entries of a component of an element in shared memory."""
        return int(self.row * self.m ** (self.D - 1))

    @property
    def nodes(self) -> int:
        """Nodes of an element, those of lower orders counted by themselves."""
        return nodes_of(self.fields, self.D)

    @property
    def points(self) -> int:
        """Points of an element."""
        return int(self.q**self.D)

    @cached_property
    def elements(self) -> int:
        """Elements of a block: as many as threads and shared memory hold."""
        of_memory = SHARED // (DOUBLE * (2 + self.D) * max(self.C, self.D) * self.size)
        return max(1, min(THREADS // self.points, of_memory))

    @property
    def owners(self) -> int:
        """Threads that have a point."""
        return self.elements * self.points

    @property
    def threads(self) -> int:
        """Threads of a block."""
        return -(-self.owners // 32) * 32
