"""Levels of multigrid in the order of shape functions, for pages on cells of one order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.engines.motions import motions
from softehl.runtime.equations.system import System
from softehl.runtime.fem.assembly import ElementBlock
from softehl.runtime.fem.orders import LOWER, Transfer, cell_of, interpolation
from softehl.runtime.fem.products import Places, require_product
from softehl.runtime.mesh.cells import CELLS


@dataclass(frozen=True, eq=False)
class Levels:
    """Places of elements and levels of lower order, which all states share.

    places: of the elements of a block. transfers: to the first lower order, and lower: unknowns
    (n, k) of the elements there. unknowns: of every level by their numbers in the system; those of
    a node are neighbours. steps: interpolation to each level from the next.
    components: unknowns of a node. near: (m, k) motions that the lowest level hardly resists.
    """

    places: dict[str, Places]
    transfers: dict[str, Transfer]
    lower: dict[str, Integers]
    unknowns: tuple[Integers, ...]
    steps: tuple[csr_array, ...]
    components: int
    near: Array

    @classmethod
    def of(cls, system: System, pages: Sequence[ElementBlock], order: int, threads: int) -> Levels:
        """For blocks of cells of an order."""
        names = list(dict.fromkeys(n for b in pages for n, _ in require_product(b).places))
        nodal = [system.numbering.nodal[name] for name in names]
        orders = [order, LOWER[order]] if order > 1 else [1, 1]
        while orders[-1] > 1:
            orders.append(LOWER[orders[-1]])
        numbers = _node_by_node(nodal, system.size)
        whole = _inverse(numbers, system.size)
        dofs = [{b.name: whole[b.dofs] for b in pages}]
        unknowns = [numbers]
        steps: list[csr_array] = []
        for upper, now in pairwise(orders):
            own = {b.name: Transfer.of(b, now).lower_dofs(b) for b in pages}
            first = np.concatenate([d[:, :, 0].ravel() for d in own.values()])
            at = np.flatnonzero(np.isin(nodal[0], first))
            found = np.stack([numbers[at] for numbers in nodal], axis=1).ravel()
            inverse = _inverse(found, system.size)
            dofs.append({n: inverse[d.reshape(len(d), -1)] for n, d in own.items()})
            pairs = [
                (dofs[-2][b.name], dofs[-1][b.name], _element(b, upper, now, whole=len(steps) == 0))
                for b in pages
            ]
            steps.append(interpolation(pairs, len(unknowns[-1]), len(found)))
            unknowns.append(found)
        places = {b.name: Places.of(b, threads, whole) for b in pages}
        transfers = {b.name: Transfer.of(b, orders[1]) for b in pages}
        near = motions(system.mesh.points[at], names)
        return cls(places, transfers, dofs[1], (*unknowns,), (*steps,), len(names), near)


def _node_by_node(nodal: Sequence[Integers], size: int) -> Integers:
    """All unknowns: those of nodes that have every field node by node, then the others."""
    columns = np.stack(nodal, axis=1)
    first = columns[(columns >= 0).all(axis=1)].ravel()
    return np.concatenate([first, np.setdiff1d(np.arange(size), first)])


def _inverse(numbers: Integers, size: int) -> Integers:
    """Place of each of `size` unknowns among numbers."""
    found = np.empty(size, dtype=np.int64)
    found[numbers] = np.arange(len(numbers))
    return found


def _element(block: ElementBlock, upper: int, lower: int, *, whole: bool) -> Array:
    """Interpolation of an element; whole: to its unknowns in the order of the kernel."""
    if whole:
        return Transfer.of(block, lower).whole()
    kernel = require_product(block)
    cell, components = CELLS[kernel.cell], len(kernel.unknowns) // kernel.nodes
    local = cell_of(cell, lower).shape(cell_of(cell, upper).nodes)
    return np.asarray(np.kron(local, np.eye(components)))
