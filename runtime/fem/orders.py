"""Shape functions of a lower order on the same cells: what multigrid in the order needs.

Nodes of the lower order are nodes of the higher one: corners, or corners and middles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.fem.assembly import ElementBlock
from softehl.runtime.fem.products import by_components, require_product
from softehl.runtime.mesh.cells import CELLS, Cell

LOWER = {2: 1, 3: 1, 4: 2, 5: 1, 6: 2}
"""Order of the next level: where nodes of order 2 are not among those there are, 1."""


def cell_of(cell: Cell, order: int) -> Cell:
    """The cell of another order on the same corners."""
    shape = cell.name.rstrip("0123456789")
    return CELLS[f"{shape}{(order + 1) ** cell.dimension}"]


@dataclass(frozen=True, eq=False)
class Transfer:
    """Elements of a block at a lower order.

    local: (nodes, lower nodes) values of the lower shape functions at the nodes. inside: numbers of
    the lower nodes among the nodes. columns: (nodes, components) numbers of an element's unknowns.
    """

    local: Array
    inside: Integers
    columns: Integers

    @classmethod
    def of(cls, block: ElementBlock, order: int) -> Transfer:
        """To a lower order."""
        kernel = require_product(block)
        cell = CELLS[kernel.cell]
        lower = cell_of(cell, order)
        apart = np.linalg.norm(cell.nodes[:, None] - lower.nodes[None], axis=2)
        return cls(lower.shape(cell.nodes), apart.argmin(axis=0), by_components(kernel))

    def lower_dofs(self, block: ElementBlock) -> Integers:
        """Unknowns (n, lower nodes, components) of the lower order, by their numbers."""
        return np.asarray(block.dofs[:, self.columns[self.inside]])

    def whole(self) -> Array:
        """Interpolation (unknowns, lower unknowns) of an element, components running first."""
        components = self.columns.shape[1]
        found = np.zeros((self.columns.size, self.local.shape[1] * components))
        for c in range(components):
            found[self.columns[:, c], c::components] = self.local
        return found


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
