"""The part of a system that one process has: its elements, and all unknowns that these touch."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.definition.problem_definition import Block, Force
from softehl.runtime.engines.partition import Partition
from softehl.runtime.equations.system import System
from softehl.runtime.fem.assembly import Assembler, ElementBlock
from softehl.runtime.fem.unknowns import Numbering


@dataclass(frozen=True, eq=False)
class Part:
    """Part of a study that one process has.

    system: its part of the equations, in local numbers. unknowns: (m,) number of each of its
    unknowns in the whole system, rising. elements: block -> number of each of its elements.
    owned: (k,) local numbers of the unknowns that are its own.
    """

    system: System
    unknowns: Integers
    elements: dict[str, Integers]
    owned: Integers


def part_of(system: System, partition: Partition, process: int) -> Part:
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
    found = replace(
        system,
        numbering=numbering,
        assembler=Assembler.build(len(unknowns), blocks),
        blocks={name: _page(b, elements[name]) for name, b in system.blocks.items()},
        implied=tuple(_implied(force, numbering) for force in system.implied),
        whole=system,
    )
    return Part(found, unknowns, elements, np.flatnonzero(owners[unknowns] == process))


def _numbering(whole: Numbering, local: Integers, elements: dict[str, Integers]) -> Numbering:
    layout = whole.layout
    counts = tuple(int((local[layout.part(name)] >= 0).sum()) for name in layout.names)
    nodal = {name: _mapped(local, numbers) for name, numbers in whole.nodal.items()}
    dofs = {name: local[numbers[elements[name]]] for name, numbers in whole.dofs.items()}
    return Numbering(replace(layout, counts=counts), nodal, dofs)


def _mapped(local: Integers, numbers: Integers) -> Integers:
    return np.where(numbers >= 0, local[numbers], -1)


def _elements(block: ElementBlock, local: Integers, rows: Integers) -> ElementBlock:
    changes: dict[str, Any] = {"dofs": np.ascontiguousarray(local[block.dofs[rows]])}
    if len(block.coordinates):
        changes["coordinates"] = block.coordinates[rows]
    changes["data"] = _chosen(block.data, rows)
    changes["point_data"] = _chosen(block.point_data, rows)
    return replace(block, **changes)


def _page(block: Block, rows: Integers) -> Block:
    return replace(
        block,
        nodes=block.nodes[rows],
        form=replace(block.form, along={n: p[rows] for n, p in block.form.places.items()}),
        data={name: values[rows] for name, values in block.data.items()},
        initial=_chosen(block.initial, rows),
    )


def _implied(force: Force, numbering: Numbering) -> Force:
    here = (numbering.nodal[force.names[0]][force.nodes] >= 0).all(axis=1)
    return replace(force, nodes=force.nodes[here])


def _chosen(values: Array | None, rows: Integers) -> Array | None:
    return None if values is None else values[rows]
