"""Which process has which elements and unknowns, and how PETSc numbers these."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from softehl.runtime.arrays import Flags, Integers
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.system import System


@dataclass(frozen=True, eq=False)
class Partition:
    """Elements and unknowns by process.

    elements: block -> (n,) process of each element. numbers: (n,) PETSc's number of each unknown:
    those of process 0 first, node by node. starts: (processes + 1,) where those of each process
    begin. interleaved: how many unknowns every node has, where all nodes have the same, else 1.
    """

    elements: dict[str, Integers]
    numbers: Integers
    starts: Integers
    interleaved: int

    @property
    def owners(self) -> Integers:
        """Process (n,) of each unknown."""
        return np.searchsorted(self.starts, self.numbers, side="right") - 1


def main_blocks(system: System) -> list[str]:
    """Pages whose cells have the highest dimension: what is cut into parts."""
    dimension = {name: CELLS[b.kind].dimension for name, b in system.blocks.items()}
    highest = max(dimension.values())
    return [name for name, d in dimension.items() if d == highest]


def neighbours(system: System, part: slice) -> csr_array[np.float64]:
    """Which elements of the main blocks have a face in common with the elements `part` of them:
    (part, elements). A face has as many nodes as there are dimensions, at least.
    """
    pages = [system.blocks[name] for name in main_blocks(system)]
    incidence = _incidence([page.nodes for page in pages], len(system.mesh.points))
    shared = csr_array(incidence[part] @ incidence.T)
    shared.data[shared.data < max(CELLS[page.kind].dimension for page in pages)] = 0.0
    shared.eliminate_zeros()
    return shared


def _incidence(cells: Sequence[Integers], points: int) -> csr_array[np.float64]:
    counts = np.concatenate([np.full(len(nodes), nodes.shape[1]) for nodes in cells])
    ends = np.concatenate([[0], np.cumsum(counts)])
    columns = np.concatenate([nodes.ravel() for nodes in cells])
    shape = (len(counts), points)
    return csr_array((np.ones(len(columns)), columns, ends), shape=shape)


def partition(system: System, main: Integers, processes: int) -> Partition:
    """The whole partition from that of the main blocks' elements, one after another in `main`."""
    elements: dict[str, Integers] = {}
    first = 0
    for name in main_blocks(system):
        count = len(system.blocks[name].nodes)
        elements[name] = main[first : first + count]
        first += count
    node = _node_owners(system, elements, processes)
    places = _nodes_of_unknowns(system)
    for block in system.assembler.blocks:
        if block.name not in elements:
            page = system.blocks.get(block.name)
            at = page.nodes[:, 0] if page is not None else places[block.dofs[:, 0]]
            elements[block.name] = node[at]
    owner = np.where(places >= 0, node[places], 0)
    loose = places < 0  # unknowns of elements: with the first element that has them
    for block in reversed(system.assembler.blocks):
        rows, columns = np.nonzero(loose[block.dofs])
        owner[block.dofs[rows, columns]] = elements[block.name][rows]
    order, interleaved = _order(system, owner, places)
    numbers = np.empty(len(order), dtype=np.int64)
    numbers[order] = np.arange(len(order))
    starts = np.concatenate([[0], np.cumsum(np.bincount(owner, minlength=processes))])
    return Partition(elements, numbers, starts, interleaved)


def _node_owners(system: System, elements: dict[str, Integers], processes: int) -> Integers:
    """Process (points,) of each node: of one of its elements, by turns where there are several."""
    points = len(system.mesh.points)
    low, high = np.full(points, processes), np.full(points, -1)
    for name, ranks in elements.items():
        nodes = system.blocks[name].nodes
        np.minimum.at(low, nodes.ravel(), np.repeat(ranks, nodes.shape[1]))
        np.maximum.at(high, nodes.ravel(), np.repeat(ranks, nodes.shape[1]))
    owner = np.where(np.arange(points) % 2 == 0, low, high)
    return np.where(high < 0, 0, owner)


def _nodes_of_unknowns(system: System) -> Integers:
    """Node (n,) of each unknown, -1 for those that have none."""
    places = np.full(system.size, -1)
    for numbers in system.numbering.nodal.values():
        there = np.flatnonzero(numbers >= 0)
        places[numbers[there]] = there
    return places


def _order(system: System, owner: Integers, places: Integers) -> tuple[Integers, int]:
    """Unknowns in PETSc's order: by process, then those that stand on the same nodes as the first
    field together, node by node; and how many of them a node has where there are no others.
    """
    nodal = list(system.numbering.nodal.values())
    present: list[Flags] = [numbers >= 0 for numbers in nodal]
    group = np.full(system.size, len(nodal))
    kind = np.zeros(system.size, dtype=np.int64)
    for k, (numbers, there) in enumerate(zip(nodal, present, strict=True)):
        group[numbers[there]] = next(
            j for j, other in enumerate(present) if np.array_equal(other, there)
        )
        kind[numbers[there]] = k
    order = np.lexsort((kind, places, group, owner))
    return order, len(nodal) if not group.any() else 1
