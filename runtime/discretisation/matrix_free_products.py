"""Tangents of a block times vectors without a matrix: sum factorisation, several threads.

Elements stand in groups of eight lanes. Each thread has a run of elements; those that share a node
with another thread's come last, by one thread alone, so that nobody adds to the same place.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from softehl.errors import SoftehlError
from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.kernels.kernel import Kernel
from softehl.runtime.kernels.shared_library import Action
from softehl.runtime.mesh.cells import CELLS, Cell
from softehl.system import processors

GROUP = 8
"""Elements of a group at most, whatever the processor."""
Numbers: TypeAlias = "np.ndarray[tuple[int, ...], np.dtype[np.int32]]"
_LINE = 8  # numbers in a line of the cache
_CHUNK = 512  # groups whose points are evaluated at once


class NoProductError(SoftehlError, ValueError):
    """A block has no product by sum factorisation; the message says why."""


def require_product(block: ElementBlock) -> Kernel:
    """The kernel of a block, which has such a product.  Raises NoProductError."""
    kernel = block.kernel
    if block.rule is not None:
        raise NoProductError(
            f"block {block.name!r}: products have the quadrature of the page; leave rule out"
        )
    if isinstance(kernel, Kernel) and kernel.kept:
        return kernel
    name = getattr(kernel, "name", type(kernel).__name__)
    raise NoProductError(
        f"block {block.name!r}: {name} has no product by sum factorisation; a page of fields has "
        "it on quadrilaterals and hexahedra, all its fields of the order of the cell, where it "
        "says m.offer(product=True); a law by name does not"
    )


def threads() -> int:
    """Threads that products use: $OMP_NUM_THREADS, or what the process may use."""
    setting = os.environ.get("OMP_NUM_THREADS", "")
    return int(setting) if setting.isdigit() and int(setting) > 0 else processors()


@dataclass(frozen=True, eq=False)
class ElementNumbering:
    """Places of the elements of a block, whatever their state.

    order: (m,) elements in groups, some twice to fill up a group. index: (groups, nodes, GROUP)
    places of the first unknown of their nodes in vectors that go node by node, x running first; an
    element that stands there twice is nowhere the second time, behind all unknowns, which are
    `size`. unknowns: (nodes, components) numbers of unknowns in the system; at: their places. runs:
    (first, last) of each thread; rest: of what is shared.
    """

    order: Integers
    index: Numbers
    unknowns: Integers
    at: Integers
    size: int
    runs: tuple[tuple[int, int], ...]
    shared_run: tuple[int, int]

    @classmethod
    def of(
        cls, block: ElementBlock, count: int, numbers: Integers | None = None
    ) -> ElementNumbering:
        """For so many threads.

        numbers: places of all unknowns of the system; None: the block has vectors of its own.
        """
        kernel = require_product(block)
        cell = CELLS[kernel.cell]
        columns = by_components(kernel)
        dofs = block.dofs[:, columns]  # (n, nodes, components)
        _, first, inverse = np.unique(dofs[:, :, 0], return_index=True, return_inverse=True)
        local = inverse.reshape(dofs.shape[:2]).astype(np.int32)
        unknowns = dofs.reshape(-1, dofs.shape[2])[first]
        nodes = local[:, lexicographic(cell)]
        pieces, shared = _divided(nodes, len(unknowns), count)
        order, (*runs, shared_run) = _together([*pieces, shared])
        index = nodes[np.abs(order) - (order < 0)]  # -1 - e: element e once more
        index[order < 0] = len(unknowns)
        order = np.where(order < 0, -1 - order, order)
        new_numbers = np.arange(unknowns.size).reshape(unknowns.shape)
        at = new_numbers if numbers is None else numbers[unknowns]
        size = new_numbers.size if numbers is None else len(numbers)
        gather_index = np.append(at[:, 0], size).astype(np.int32)[index]
        lanes = np.ascontiguousarray(
            np.swapaxes(gather_index.reshape(-1, GROUP, index.shape[1]), 1, 2)
        )
        return cls(order, lanes, unknowns, at, size, (*runs,), shared_run)

    @property
    def repeated(self) -> Flags:
        """(m,) elements of `order` that only fill up a group."""
        repeated = np.ones(len(self.order), dtype=bool)
        repeated[np.unique(self.order, return_index=True)[1]] = False
        return repeated

    def vector(self) -> Array:
        """Zeros for the unknowns node by node, and for what is read and written behind them."""
        return np.zeros(self.size + self.unknowns.shape[1] + 3)


def _divided(nodes: Numbers, size: int, count: int) -> tuple[list[Integers], Integers]:
    """Elements of each thread that share no node with another's, and all others."""
    n = len(nodes)
    owner = np.minimum(np.arange(n) * count // max(n, 1), count - 1)
    lowest, highest = np.full(size, count), np.full(size, -1)
    np.minimum.at(lowest, nodes, owner[:, None])
    np.maximum.at(highest, nodes, owner[:, None])
    met: Flags = (lowest != highest)[nodes].any(axis=1)
    return [np.flatnonzero((owner == k) & ~met) for k in range(count)], np.flatnonzero(met)


def _together(pieces: Sequence[Integers]) -> tuple[Integers, list[tuple[int, int]]]:
    """All pieces one after the other in whole groups, and where each begins and ends."""
    filled = [_filled(piece) for piece in pieces]
    bounds = np.cumsum([0, *map(len, filled)]).tolist()
    return np.concatenate(filled), [*pairwise(bounds)]


def _filled(elements: Integers) -> Integers:
    """Filled up to whole groups with the last one, as -1 - e."""
    missing = -len(elements) % GROUP
    return np.concatenate([elements, np.full(missing, -1 - elements[-1] if missing else 0)])


def by_components(kernel: Kernel) -> Integers:
    """Numbers (nodes, components) of the unknowns of an element."""
    names = list(dict.fromkeys(name for name, _ in kernel.places))
    numbers = np.full((kernel.nodes, len(names)), -1)
    for k, (name, node) in enumerate(kernel.places):
        numbers[node, names.index(name)] = k
    return numbers


@cache
def _lexicographic(kind: str) -> tuple[int, ...]:
    cell = CELLS[kind]
    rounded = np.round(cell.nodes, 9)
    return tuple(int(k) for k in np.lexsort(rounded.T))


def lexicographic(cell: Cell) -> list[int]:
    """Nodes of a cell with x running first, then y, then z."""
    return list(_lexicographic(cell.name))


@dataclass(eq=False)
class ElementProduct:
    """The tangent of a block at a state, as a function of a vector.

    kept: (m, points, numbers) in the order of the C function.
    """

    numbering: ElementNumbering
    action: Action
    cached: Array
    parameters: Array
    _pool: ThreadPoolExecutor | None = field(init=False)

    @classmethod
    def of(
        cls, block: ElementBlock, x: Array, parameters: Array, numbering: ElementNumbering
    ) -> ElementProduct:
        """At the vector x of the whole system."""
        kernel = require_product(block)
        points, m = len(kernel.default_rule.weights), len(numbering.order)
        keep = kernel.library.function(kernel.name, "keep")
        cached = _aligned(m, points * kernel.kept)
        nothing = np.empty(0)
        for first in range(0, m, GROUP * _CHUNK):
            part = slice(first, min(first + GROUP * _CHUNK, m))
            some = numbering.order[part]
            data = _data(block, some)
            read = (block.coordinates[some], x[block.dofs[some]], data)
            arrays = (*read, parameters, nothing, nothing, nothing)
            keep((len(some), points, 0), arrays, cached[part], None)
        return cls(numbering, kernel.library.action(kernel.name), cached, parameters)

    def __post_init__(self) -> None:
        several = len(self.numbering.runs) > 1
        self._pool = ThreadPoolExecutor(len(self.numbering.runs)) if several else None

    def __call__(self, x: Array, y: Array) -> None:
        """y += K x for vectors as `ElementNumbering.vector` makes them."""
        parameters, cached, index = self.parameters, self.cached, self.numbering.index

        def run(span: tuple[int, int]) -> None:
            first, last = span
            if last > first:
                self.action(span, parameters, cached, index, x, y)

        if self._pool is None:
            run((0, len(self.numbering.order)))
        else:
            list(self._pool.map(run, self.numbering.runs))
            run(self.numbering.shared_run)

    def coarse(self, kernel: Kernel) -> tuple[Array, Array]:
        """Diagonals (m, ndof), and tangents (m, k, k) of the k unknowns of the next lower order.

        Elements are in the order of the numbering. They follow from what is kept at the points.
        """
        m = len(self.numbering.order)
        diagonals = np.empty((m, len(kernel.unknowns)))
        tangents = np.empty((m, kernel.coarse, kernel.coarse))
        function, count = kernel.library.coarse(kernel.name), len(self.numbering.runs)
        bounds = [k * (m // GROUP) // count * GROUP for k in range(count)] + [m]

        def run(span: tuple[int, int]) -> None:
            function(span, self.parameters, self.cached, diagonals, tangents)

        if self._pool is None:
            run((0, m))
        else:
            list(self._pool.map(run, pairwise(bounds)))
        return diagonals, tangents

    def add(self, x: Array, y: Array) -> None:
        """y += K x for vectors of the whole system."""
        places, source, target = self.numbering, self.numbering.vector(), self.numbering.vector()
        source[places.at] = x[places.unknowns]
        self(source, target)
        y[places.unknowns] += target[places.at]


def _aligned(rows: int, columns: int) -> Array:
    """An array whose first number begins a line of the cache.

    Products are 1.4 to 1.7 times faster so: otherwise every vector of lanes lies in two lines.
    """
    buffer = np.empty(rows * columns + _LINE)
    first = -(buffer.ctypes.data // buffer.itemsize) % _LINE
    return buffer[first : first + rows * columns].reshape(rows, columns)


def _data(block: ElementBlock, some: Integers) -> Array:
    """Data of elements, those of their points behind."""
    parts: Sequence[Array] = [
        columns[some].reshape(len(some), -1)
        for columns in (block.data, block.point_data)
        if columns is not None
    ]
    return np.ascontiguousarray(np.concatenate(parts, axis=1)) if parts else np.empty(0)
