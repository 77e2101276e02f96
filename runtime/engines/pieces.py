"""A system whose mesh is in parts already: what is whose, and how PETSc numbers the unknowns."""

from __future__ import annotations

import numpy as np

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.engines.exchange import Exchange
from softehl.runtime.engines.local import Part
from softehl.runtime.engines.partition import nodes_of_unknowns, numbered
from softehl.runtime.equations.system import System
from softehl.runtime.fem.loads import Tie
from softehl.runtime.mesh.piece import Piece
from softehl.runtime.mpi import world


def part_here(system: System, piece: Piece) -> tuple[Part, Exchange, int]:
    """Part and exchange of this process, and the unknowns of every node where all have as many.

    Raises StudyError for what goes beyond a part.
    """
    _require_possible(system)
    comm = world()
    own, shared = _owned(system, piece), _for_all(system)
    order, interleaved = numbered(system, np.where(own, 0, 1), nodes_of_unknowns(system))
    count = int(own.sum())
    starts = np.concatenate([[0], np.cumsum(comm.allgather(count))])
    numbers = np.full(system.size, -1)
    numbers[order[:count]] = starts[comm.rank] + np.arange(count)
    for name, values in system.numbering.nodal.items():
        _ask(numbers, values, piece, name)
    numbers[shared] = comm.bcast(numbers[shared])
    rows = {name: np.arange(len(block.nodes)) for name, block in system.blocks.items()}
    for block in system.assembler.blocks:
        rows.setdefault(block.name, np.arange(len(block.dofs)))
    part = Part(system, np.arange(system.size), rows, np.flatnonzero(own))
    exchange = Exchange.of(numbers, part.owned, starts)
    return part, exchange, min(comm.allgather(interleaved))


def _require_possible(system: System) -> None:
    tied = [b.name for b in system.assembler.blocks if isinstance(b.kernel, Tie)]
    if world().allreduce(len(tied) + len(system.implied)):
        raise StudyError("tie: not for a mesh in parts, its partners are on other processes")
    for name, block in system.blocks.items():
        if not world().allreduce(len(block.nodes)):
            raise StudyError(f"{name!r} has no elements, on any process")


def _owned(system: System, piece: Piece) -> Flags:
    """(n,): whether an unknown is this process's own: no process before it has the unknown."""
    own: Flags = np.ones(system.size, dtype=bool)
    for numbers in system.numbering.nodal.values():
        for process, there in piece.told(numbers >= 0).items():
            if process < world().rank:
                both = numbers[piece.shared[process][there]]
                own[both[both >= 0]] = False
    if world().rank:
        own[_for_all(system)] = False
    return own


def _for_all(system: System) -> Integers:
    """Unknowns that are one for all elements of a block, wherever these are."""
    blocks = system.blocks.values()
    names = dict.fromkeys(name for block in blocks for name in sorted(block.shared))
    layout = system.numbering.layout
    return np.array([layout.part(name).start for name in names], dtype=np.int64)


def _ask(numbers: Array | Integers, nodal: Integers, piece: Piece, name: str) -> None:
    """Put PETSc's numbers of an unknown at nodes of others into `numbers`."""
    here = np.where(nodal >= 0, numbers[nodal], -1)
    for process, theirs in piece.told(here).items():
        mine = nodal[piece.shared[process]]
        found = (mine >= 0) & (theirs >= 0)
        numbers[mine[found]] = theirs[found]
    assert (numbers[nodal[nodal >= 0]] >= 0).all(), name
