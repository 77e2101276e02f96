"""Partition of a system: elements and unknowns of each process, and PETSc's numbers of these.

The part of a process has its elements, and all unknowns that these have. The mesh is one that all
processes have (`partition`), or it is in parts already (`local_system_of_partitioned_mesh`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.definition.problem_definition import Block, Load, StudyError
from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.dofmap import Numbering
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.loads import Tie
from softehl.runtime.equations.system import System
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.partitioning import MeshPartition
from softehl.runtime.mpi import world
from softehl.runtime.parallel.halo_exchange import HaloExchange
from softehl.runtime.parallel.linear_solver_choice import internal_unknowns


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
    """Pages whose cells have the highest dimension, and are partitioned."""
    dimension = {name: CELLS[b.kind].dimension for name, b in system.blocks.items()}
    highest = max(dimension.values())
    return [name for name, d in dimension.items() if d == highest]


@dataclass(frozen=True, eq=False)
class CellGraph:
    """Graph of the cells to be partitioned: those of the main blocks, each once.

    nodes: for each kind (n, k). rows: block -> number of the cell of each element.
    """

    nodes: tuple[Integers, ...]
    rows: dict[str, Integers]

    @classmethod
    def of(cls, system: System) -> CellGraph:
        """Elements of several blocks on one cell stay together."""
        nodes: list[Integers] = []
        rows: dict[str, Integers] = {}
        first = 0
        main = [system.blocks[name] for name in main_blocks(system)]
        for kind in dict.fromkeys(block.kind for block in main):
            blocks = [block for block in main if block.kind == kind]
            unique, inverse = blocks[0].nodes, np.arange(len(blocks[0].nodes))
            if len(blocks) > 1:
                every = np.concatenate([block.nodes for block in blocks])
                unique, inverse = np.unique(every, axis=0, return_inverse=True)
            bounds = np.cumsum([len(block.nodes) for block in blocks])[:-1]
            parts = np.split(inverse.ravel() + first, bounds)
            rows |= {block.name: part for block, part in zip(blocks, parts, strict=True)}
            nodes.append(unique)
            first += len(unique)
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
        indptr = np.concatenate([[0], np.cumsum(counts)])
        columns = np.concatenate([nodes.ravel() for nodes in self.nodes])
        incidence = csr_array((np.ones(len(columns)), columns, indptr))
        shared = csr_array(incidence[part] @ incidence.T)
        shared.data[shared.data < dimension] = 0.0
        shared.eliminate_zeros()
        return shared


def partition(system: System, cells: CellGraph, main: Integers, processes: int) -> Partition:
    """The whole partition from the process of each cell, `main`."""
    elements = {name: main[rows] for name, rows in cells.rows.items()}
    node = _node_owners(system, elements, processes)
    node_of_unknown = nodes_of_unknowns(system)
    for block in system.assembler.blocks:
        if block.name not in elements:
            page = system.blocks.get(block.name)
            stands = page is not None and page.nodes.shape[1] > 0
            at = page.nodes[:, 0] if page and stands else node_of_unknown[block.dofs[:, 0]]
            elements[block.name] = node[at]
    owner = np.where(node_of_unknown >= 0, node[node_of_unknown], 0)
    without_node = node_of_unknown < 0  # unknowns of elements: with the first element that has them
    for block in reversed(system.assembler.blocks):
        rows, columns = np.nonzero(without_node[block.dofs])
        owner[block.dofs[rows, columns]] = elements[block.name][rows]
    order, interleaved = petsc_ordering(system, owner, node_of_unknown)
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
    node_of_unknown = np.full(system.size, -1)
    for numbers in system.numbering.nodal.values():
        nodes = np.flatnonzero(numbers >= 0)
        node_of_unknown[numbers[nodes]] = nodes
    return node_of_unknown


def petsc_ordering(
    system: System, owner: Integers, node_of_unknown: Integers
) -> tuple[Integers, int]:
    """Unknowns in PETSc's order: by process, then those that stand on the same nodes as the first
    field together, node by node; and how many of them a node has where there are no others but
    internal ones.
    """
    nodal = list(system.numbering.nodal.values())
    present: list[Flags] = [numbers >= 0 for numbers in nodal]
    group = np.full(system.size, len(nodal))
    kind = np.zeros(system.size, dtype=np.int64)
    for k, (numbers, mask) in enumerate(zip(nodal, present, strict=True)):
        group[numbers[mask]] = next(
            j for j, other in enumerate(present) if np.array_equal(other, mask)
        )
        kind[numbers[mask]] = k
    order = np.lexsort((kind, node_of_unknown, group, owner))
    for inner in internal_unknowns(system.assembler):
        group[inner] = 0  # condensed before PETSc sees them
    alike = not group.any() and all(np.array_equal(mask, present[0]) for mask in present)
    return order, len(nodal) if alike else 1


@dataclass(frozen=True, eq=False)
class LocalSystem:
    """Equations of one process, and their place in the global system.

    system: its part of the equations, in local numbers. unknowns: (m,) number of each of its
    unknowns in the whole system, rising. elements: block -> number of each of its elements.
    owned: (k,) local numbers of the unknowns that are its own.
    """

    system: System
    unknowns: Integers
    elements: dict[str, Integers]
    owned: Integers


def part_of(system: System, partition: Partition, process: int) -> LocalSystem:
    """The part of one process."""
    elements = {n: np.flatnonzero(ranks == process) for n, ranks in partition.elements.items()}
    owners = partition.owners
    needed = owners == process
    for block in system.assembler.blocks:
        needed[block.dofs[elements[block.name]]] = True
    unknowns = np.flatnonzero(needed)
    local = np.full(system.size, -1)
    local[unknowns] = np.arange(len(unknowns))
    numbering = _numbering(system.numbering, local, elements)
    blocks = [_elements(b, local, elements[b.name]) for b in system.assembler.blocks]
    local_system = replace(
        system,
        numbering=numbering,
        assembler=Assembler.build(len(unknowns), blocks),
        blocks={name: _page(b, elements[name]) for name, b in system.blocks.items()},
        implied=tuple(_implied(force, numbering) for force in system.implied),
        whole=system,
    )
    return LocalSystem(
        local_system, unknowns, elements, np.flatnonzero(owners[unknowns] == process)
    )


def _numbering(numbering: Numbering, local: Integers, elements: dict[str, Integers]) -> Numbering:
    layout = numbering.layout
    counts = tuple(int((local[layout.part(name)] >= 0).sum()) for name in layout.names)
    nodal = {name: _mapped(local, numbers) for name, numbers in numbering.nodal.items()}
    dofs = {name: local[numbers[elements[name]]] for name, numbers in numbering.dofs.items()}
    return Numbering(replace(layout, counts=counts), nodal, dofs)


def _mapped(local: Integers, numbers: Integers) -> Integers:
    return np.where(numbers >= 0, local[numbers], -1)


def _elements(block: ElementBlock, local: Integers, rows: Integers) -> ElementBlock:
    changes: dict[str, Any] = {"dofs": np.ascontiguousarray(local[block.dofs[rows]])}
    if len(block.coordinates):
        changes["coordinates"] = block.coordinates[rows]
    changes["data"] = _rows_or_none(block.data, rows)
    changes["point_data"] = _rows_or_none(block.point_data, rows)
    return replace(block, **changes)


def _page(block: Block, rows: Integers) -> Block:
    return replace(
        block,
        nodes=block.nodes[rows],
        options=replace(
            block.options, along={n: p[rows] for n, p in block.options.dof_tables.items()}
        ),
        data={name: values[rows] for name, values in block.data.items()},
        initial=_rows_or_none(block.initial, rows),
    )


def _implied(force: Load, numbering: Numbering) -> Load:
    mask = (numbering.nodal[force.names[0]][force.nodes] >= 0).all(axis=1)
    return replace(force, nodes=force.nodes[mask])


def _rows_or_none(values: Array | None, rows: Integers) -> Array | None:
    return None if values is None else values[rows]


def local_system_of_partitioned_mesh(
    system: System, piece: MeshPartition
) -> tuple[LocalSystem, HaloExchange, int]:
    """Part and exchange of this process, and the unknowns of every node where all have as many.

    Raises StudyError for what goes beyond a part.
    """
    _require_possible(system)
    comm = world()
    is_owned, shared = _owned(system, piece), _for_all(system)
    order, interleaved = petsc_ordering(system, np.where(is_owned, 0, 1), nodes_of_unknowns(system))
    count = int(is_owned.sum())
    starts = np.concatenate([[0], np.cumsum(comm.allgather(count))])
    numbers = np.full(system.size, -1)
    numbers[order[:count]] = starts[comm.rank] + np.arange(count)
    for name, values in system.numbering.nodal.items():
        _number_halo(numbers, values, piece, name)
    numbers[shared] = comm.bcast(numbers[shared])
    rows = {name: np.arange(len(block.nodes)) for name, block in system.blocks.items()}
    for block in system.assembler.blocks:
        rows.setdefault(block.name, np.arange(len(block.dofs)))
    part = LocalSystem(system, np.arange(system.size), rows, np.flatnonzero(is_owned))
    exchange = HaloExchange.of(numbers, part.owned, starts)
    return part, exchange, min(comm.allgather(interleaved))


def _require_possible(system: System) -> None:
    tied = [b.name for b in system.assembler.blocks if isinstance(b.kernel, Tie)]
    if world().allreduce(len(tied) + len(system.implied)):
        raise StudyError("tie: not for a mesh in parts, its partners are on other processes")
    for name, block in system.blocks.items():
        if not world().allreduce(len(block.nodes)):
            raise StudyError(f"{name!r} has no elements, on any process")


def _owned(system: System, piece: MeshPartition) -> Flags:
    """(n,): whether an unknown is this process's is_owned: no process before it has the unknown."""
    is_owned: Flags = np.ones(system.size, dtype=bool)
    for numbers in system.numbering.nodal.values():
        for process, flags in piece.exchange(numbers >= 0).items():
            if process < world().rank:
                both = numbers[piece.shared[process][flags]]
                is_owned[both[both >= 0]] = False
    if world().rank:
        is_owned[_for_all(system)] = False
    return is_owned


def _for_all(system: System) -> Integers:
    """Unknowns that are one for all elements of a block, wherever these are."""
    blocks = system.blocks.values()
    names = dict.fromkeys(name for block in blocks for name in sorted(block.shared))
    layout = system.numbering.layout
    return np.array([layout.part(name).start for name in names], dtype=np.int64)


def _number_halo(
    numbers: Array | Integers, nodal: Integers, piece: MeshPartition, name: str
) -> None:
    """Put PETSc's numbers of halo unknowns into `numbers`."""
    local_numbers = np.where(nodal >= 0, numbers[nodal], -1)
    for process, other_numbers in piece.exchange(local_numbers).items():
        unknowns = nodal[piece.shared[process]]
        mask = (unknowns >= 0) & (other_numbers >= 0)
        numbers[unknowns[mask]] = other_numbers[mask]
    assert (numbers[nodal[nodal >= 0]] >= 0).all(), name
