"""Which process has which elements and unknowns, and how PETSc numbers these."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from softehl.runtime.arrays import Flags, Integers
from softehl.runtime.engines.sizes import internal
from softehl.runtime.equations.system import System
from softehl.runtime.mesh.cells import CELLS


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


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells to be cut into parts: those of the main blocks, each once.

    nodes: for each kind (n, k). rows: block -> number of the cell of each element.
    """

    nodes: tuple[Integers, ...]
    rows: dict[str, Integers]

    @classmethod
    def of(cls, system: System) -> Cells:
        """Elements of several blocks on one cell stay together."""
        nodes: list[Integers] = []
        rows: dict[str, Integers] = {}
        first = 0
        main = [system.blocks[name] for name in main_blocks(system)]
        for kind in dict.fromkeys(block.kind for block in main):
            there = [block for block in main if block.kind == kind]
            found, place = there[0].nodes, np.arange(len(there[0].nodes))
            if len(there) > 1:
                every = np.concatenate([block.nodes for block in there])
                found, place = np.unique(every, axis=0, return_inverse=True)
            ends = np.cumsum([len(block.nodes) for block in there])[:-1]
            parts = np.split(place.ravel() + first, ends)
            rows |= {block.name: part for block, part in zip(there, parts, strict=True)}
            nodes.append(found)
            first += len(found)
        return cls((*nodes,), rows)

    @property
    def count(self) -> int:
        """Number of cells."""
        return sum(len(nodes) for nodes in self.nodes)

    def neighbours(self, part: slice, dimension: int) -> csr_array[np.float64]:
        """Which cells have a face in common with the cells `part`: (part, cells).

        A face has as many nodes as there are dimensions, at least.
        """
        counts = np.concatenate([np.full(len(nodes), nodes.shape[1]) for nodes in self.nodes])
        ends = np.concatenate([[0], np.cumsum(counts)])
        columns = np.concatenate([nodes.ravel() for nodes in self.nodes])
        incidence = csr_array((np.ones(len(columns)), columns, ends))
        shared = csr_array(incidence[part] @ incidence.T)
        shared.data[shared.data < dimension] = 0.0
        shared.eliminate_zeros()
        return shared


def partition(system: System, cells: Cells, main: Integers, processes: int) -> Partition:
    """The whole partition from the process of each cell, `main`."""
    elements = {name: main[rows] for name, rows in cells.rows.items()}
    node = _node_owners(system, elements, processes)
    places = nodes_of_unknowns(system)
    for block in system.assembler.blocks:
        if block.name not in elements:
            page = system.blocks.get(block.name)
            stands = page is not None and page.nodes.shape[1] > 0
            at = page.nodes[:, 0] if page and stands else places[block.dofs[:, 0]]
            elements[block.name] = node[at]
    owner = np.where(places >= 0, node[places], 0)
    loose = places < 0  # unknowns of elements: with the first element that has them
    for block in reversed(system.assembler.blocks):
        rows, columns = np.nonzero(loose[block.dofs])
        owner[block.dofs[rows, columns]] = elements[block.name][rows]
    order, interleaved = numbered(system, owner, places)
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


def nodes_of_unknowns(system: System) -> Integers:
    """Node (n,) of each unknown, -1 for those that have none."""
    places = np.full(system.size, -1)
    for numbers in system.numbering.nodal.values():
        there = np.flatnonzero(numbers >= 0)
        places[numbers[there]] = there
    return places


def numbered(system: System, owner: Integers, places: Integers) -> tuple[Integers, int]:
    """Unknowns in PETSc's order: by process, then those that stand on the same nodes as the first
    field together, node by node; and how many of them a node has where there are no others but
    internal ones.
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
    for inner in internal(system.assembler):
        group[inner] = 0  # condensed before PETSc sees them
    alike = not group.any() and all(np.array_equal(there, present[0]) for there in present)
    return order, len(nodal) if alike else 1
