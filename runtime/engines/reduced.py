"""Free unknowns of a problem that is spread over processes: supports hold, tied ones are one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.engines.exchange import Exchange
from softehl.runtime.engines.local import Part
from softehl.runtime.equations.system import System
from softehl.runtime.fem.loads import Tie
from softehl.runtime.fem.problem import Problem
from softehl.runtime.mpi import world


@dataclass(frozen=True, eq=False)
class Reduced:
    """As `fem.reduction.Reduction`, of the vectors of one process.

    there: local numbers of unknowns that move. exchange: of these, where tied ones have the number
    of the first of them.
    """

    size: int
    there: Integers
    exchange: Exchange

    @classmethod
    def of(cls, problem: Problem, part: Part, exchange: Exchange) -> Reduced:
        """Of the local part of a problem."""
        held = np.zeros(problem.assembler.size)
        held[problem.fixed] = 1.0
        for block in problem.assembler.blocks:
            if isinstance(block.kernel, Tie):
                held[block.dofs[:, 2]] = 1.0
        first = _tied(part, exchange)
        kept = first.highest(held) == 0.0
        numbers, starts = first.renumbered(kept)
        there = np.flatnonzero(numbers >= 0)
        owned = np.searchsorted(there, first.owned[kept])
        return cls(len(held), there, Exchange.of(numbers[there], owned, starts))

    def gather(self, forces: Array) -> Array:
        """T' f: own sums over all processes of forces (m,) that the elements of each have."""
        return self.exchange.added(forces[self.there])

    def spread(self, z: Array) -> Array:
        """T z: unknowns (m,) of own free ones."""
        x = np.zeros(self.size)
        x[self.there] = self.exchange.copied(z)
        return x


def _tied(part: Part, exchange: Exchange) -> Exchange:
    """The exchange of a part in which each unknown is the first of those that it is tied to."""
    whole = part.system.everywhere
    pairs = [b.dofs[:, :2] for b in whole.assembler.blocks if isinstance(b.kernel, Tie)]
    if not pairs:
        return exchange
    first = _first(np.concatenate(pairs), whole.size)
    numbers = _all_numbers(whole, part, exchange)
    own = first[part.unknowns[part.owned]] == part.unknowns[part.owned]
    comm = world()
    ends = comm.allgather(len(part.owned))
    starts = np.concatenate([[0], np.cumsum(ends)])
    return Exchange.of(numbers[first[part.unknowns]], part.owned[own], starts)


def _first(pairs: Integers, n: int) -> Integers:
    """For each of n unknowns the first of those that are tied to it."""
    graph = csr_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    groups = connected_components(graph, directed=False)[1]
    _, first, inverse = np.unique(groups, return_index=True, return_inverse=True)
    return np.asarray(first[inverse], dtype=np.int64)


def _all_numbers(whole: System, part: Part, exchange: Exchange) -> Integers:
    """PETSc's number of each unknown of the whole."""
    found = np.zeros(whole.size, dtype=np.int64)
    for unknowns, numbers in world().allgather(
        (part.unknowns[part.owned], exchange.numbers[part.owned])
    ):
        found[unknowns] = numbers
    return found
