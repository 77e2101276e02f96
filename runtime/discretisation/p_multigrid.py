"""p-multigrid: levels of lower order of the shape functions on the same cells, all of one order.

Nodes of the lower order are nodes of the higher one: corners, or corners and middles.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.matrix_free_products import (
    ElementNumbering,
    by_components,
    require_product,
)
from softehl.runtime.discretisation.near_nullspace import rigid_body_modes
from softehl.runtime.discretisation.sparsity import Pattern, build_pattern
from softehl.runtime.mesh.cells import CELLS, Cell

LOWER = {2: 1, 3: 1, 4: 2, 5: 1, 6: 2}
"""Order of the next level: where nodes of order 2 are not among those there are, 1."""


def cell_of(cell: Cell, order: int) -> Cell:
    """The cell of another order on the same corners."""
    shape = cell.name.rstrip("0123456789")
    return CELLS[f"{shape}{(order + 1) ** cell.dimension}"]


@dataclass(frozen=True, eq=False)
class OrderTransfer:
    """Elements of a block at a lower order.

    local: (nodes, lower nodes) values of the lower shape functions at the nodes. inside: numbers of
    the lower nodes among the nodes. columns: (nodes, components) numbers of an element's unknowns.
    """

    local: Array
    inside: Integers
    columns: Integers

    @classmethod
    def of(cls, block: ElementBlock, order: int) -> OrderTransfer:
        """To a lower order."""
        kernel = require_product(block)
        cell = CELLS[kernel.cell]
        lower = cell_of(cell, order)
        distances = np.linalg.norm(cell.nodes[:, None] - lower.nodes[None], axis=2)
        return cls(lower.shape(cell.nodes), distances.argmin(axis=0), by_components(kernel))

    def lower_dofs(self, block: ElementBlock) -> Integers:
        """Unknowns (n, lower nodes, components) of the lower order, by their numbers."""
        return np.asarray(block.dofs[:, self.columns[self.inside]])

    def matrix(self) -> Array:
        """Interpolation (unknowns, lower unknowns) of an element, components running first."""
        components = self.columns.shape[1]
        matrix = np.zeros((self.columns.size, self.local.shape[1] * components))
        for c in range(components):
            matrix[self.columns[:, c], c::components] = self.local
        return matrix


def interpolation(
    pairs: list[tuple[Integers, Integers, Array]], size: int, count: int
) -> csr_array:
    """Interpolation (size, count) of elements: unknowns (n, k), lower ones (n, l), and (k, l)."""
    times = np.zeros(size)
    for dofs, _, _ in pairs:
        np.add.at(times, dofs, 1.0)
    rows, columns, values = [], [], []
    for dofs, lower, local in pairs:
        i, j = np.nonzero(np.abs(local) > 1e-14)
        rows.append(dofs[:, i].ravel())
        columns.append(lower[:, j].ravel())
        values.append((local[i, j] / times[dofs[:, i]]).ravel())
    where = np.concatenate(rows), np.concatenate(columns)
    return csr_array((np.concatenate(values), where), (size, count))


@dataclass(frozen=True, eq=False)
class MultigridLevels:
    """Places of elements and levels of lower order, which all states share.

    numberings: of the elements of a block. transfers: to the first lower order, and lower: unknowns
    (n, k) of the elements there. unknowns: of every level by their numbers in the system; those of
    a node are neighbours. steps: interpolation to each level from the next.
    components: unknowns of a node. nullspace: (m, k) motions that the lowest level hardly resists.
    """

    numberings: dict[str, ElementNumbering]
    transfers: dict[str, OrderTransfer]
    lower: dict[str, Integers]
    unknowns: tuple[Integers, ...]
    steps: tuple[csr_array, ...]
    components: int
    nullspace: Array
    _patterns: dict[str, Pattern] = field(default_factory=dict)

    def pattern(self, block: str) -> Pattern:
        """Pattern of the matrix of a block at the first lower order; elements as numbered."""
        if block not in self._patterns:
            dofs = self.lower[block][self.numberings[block].order]
            self._patterns[block] = build_pattern(self.steps[0].shape[1], [dofs])
        return self._patterns[block]

    @classmethod
    def of(
        cls,
        points: Array,
        dofmap: Mapping[str, Integers],
        pages: Sequence[ElementBlock],
        *,
        order: int,
        size: int,
        threads: int,
    ) -> MultigridLevels:
        """Levels for blocks of cells of an order.

        points: (n, dim) nodes. dofmap: name -> (n,) unknowns at the nodes. size: of all unknowns.
        """
        names = list(dict.fromkeys(n for b in pages for n, _ in require_product(b).places))
        nodal = [dofmap[name] for name in names]
        orders = [order, LOWER[order]] if order > 1 else [1, 1]
        while orders[-1] > 1:
            orders.append(LOWER[orders[-1]])
        numbers = _node_by_node(nodal, size)
        position = inverse(numbers, size)
        dofs = [{b.name: position[b.dofs] for b in pages}]
        unknowns = [numbers]
        steps: list[csr_array] = []
        for upper, now in pairwise(orders):
            lower_dofs = {b.name: OrderTransfer.of(b, now).lower_dofs(b) for b in pages}
            first = np.concatenate([d[:, :, 0].ravel() for d in lower_dofs.values()])
            at = np.flatnonzero(np.isin(nodal[0], first))
            level_unknowns = np.stack([numbers[at] for numbers in nodal], axis=1).ravel()
            lower_numbers = inverse(level_unknowns, size)
            dofs.append({n: lower_numbers[d.reshape(len(d), -1)] for n, d in lower_dofs.items()})
            pairs = [
                (
                    dofs[-2][b.name],
                    dofs[-1][b.name],
                    _element(b, upper, now, kernel_order=len(steps) == 0),
                )
                for b in pages
            ]
            steps.append(interpolation(pairs, len(unknowns[-1]), len(level_unknowns)))
            unknowns.append(level_unknowns)
        element_numbering = {b.name: ElementNumbering.of(b, threads, position) for b in pages}
        transfers = {b.name: OrderTransfer.of(b, orders[1]) for b in pages}
        nullspace = rigid_body_modes(points[at], names)
        return cls(
            element_numbering, transfers, dofs[1], (*unknowns,), (*steps,), len(names), nullspace
        )


def _node_by_node(nodal: Sequence[Integers], size: int) -> Integers:
    """All unknowns: those of nodes that have every field node by node, then the others."""
    columns = np.stack(nodal, axis=1)
    first = columns[(columns >= 0).all(axis=1)].ravel()
    return np.concatenate([first, np.setdiff1d(np.arange(size), first)])


def inverse(numbers: Integers, size: int) -> Integers:
    """Place of each of `size` unknowns among numbers."""
    positions = np.empty(size, dtype=np.int64)
    positions[numbers] = np.arange(len(numbers))
    return positions


def _element(block: ElementBlock, upper: int, lower: int, *, kernel_order: bool) -> Array:
    """Interpolation of an element; whole: to its unknowns in the order of the kernel."""
    if kernel_order:
        return OrderTransfer.of(block, lower).matrix()
    kernel = require_product(block)
    cell, components = CELLS[kernel.cell], len(kernel.unknowns) // kernel.nodes
    local = cell_of(cell, lower).shape(cell_of(cell, upper).nodes)
    return np.asarray(np.kron(local, np.eye(components)))
