"""Halo exchange of distributed vectors: owned unknowns, copies of the neighbours', reductions."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.mpi import petsc, world


@dataclass(eq=False)
class HaloExchange:
    """Exchange between local vectors (m,), in the order of `LocalSystem.unknowns`, and PETSc's.

    numbers: (m,) PETSc's number of each local unknown. owned: (k,) local numbers of own unknowns,
    and positions: (k,) where they stand in this process's piece of PETSc's vectors.
    vector, copies: work space. sent: bytes that went to other processes, counted.
    """

    numbers: Integers
    owned: Integers
    positions: Integers
    vector: Any
    copies: Any
    scatter: Any
    ghosts: int
    sent: int = field(default=0)

    @classmethod
    def of(cls, numbers: Integers, owned: Integers, starts: Integers) -> HaloExchange:
        """Of unknowns with these numbers (m,); starts: where those of each process begin."""
        PETSc, comm = petsc(), world()
        first, last = starts[comm.rank : comm.rank + 2]
        vector = PETSc.Vec().createMPI((int(last - first), int(starts[-1])), comm=comm)
        vector.setBlockSize(1)
        copies = PETSc.Vec().createSeq(len(numbers))
        index_set = PETSc.IS().createGeneral(numbers.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
        scatter = PETSc.Scatter().create(vector, index_set, copies, None)
        ghosts, positions = len(numbers) - len(owned), numbers[owned] - first
        return cls(numbers, owned, positions, vector, copies, scatter, ghosts)

    def local(self, vector: Any) -> Array:
        """The local vector (m,) of one of PETSc's: own values and copies of the neighbours'."""
        mode = petsc().ScatterMode.FORWARD
        self.scatter.scatter(vector, self.copies, petsc().InsertMode.INSERT_VALUES, mode)
        self.sent += 8 * self.ghosts
        return np.array(self.copies.array_r)

    def copied(self, owned_values: Array) -> Array:
        """The local vector (m,) of own values (k,)."""
        vector = self.to_petsc(owned_values)
        local = self.local(vector)
        vector.destroy()
        return local

    def added(self, x: Array) -> Array:
        """Of sums (m,) over own elements those over all: of own unknowns, (k,)."""
        return self._back(x, petsc().InsertMode.ADD_VALUES)

    def highest(self, x: Array) -> Array:
        """Of numbers (m,), at least 0, the largest of any process: of own unknowns, (k,)."""
        return self._back(x, petsc().InsertMode.MAX_VALUES)

    def renumbered(self, mask: Flags) -> tuple[Integers, Integers]:
        """PETSc's numbers (m,) if it had only those own unknowns (k,) that are kept, -1 for others;
        and where those of each process begin.
        """
        indices = np.flatnonzero(mask)
        indices = indices[np.argsort(self.positions[indices])]
        starts = np.concatenate([[0], np.cumsum(world().allgather(len(indices)))])
        new_numbers = np.full(len(self.owned), -1.0)
        new_numbers[indices] = starts[world().rank] + np.arange(len(indices))
        return self.copied(new_numbers).astype(np.int64), starts

    def _back(self, x: Array, mode: Any) -> Array:
        self.copies.array[:] = x
        self.vector.set(0.0)
        self.scatter.scatter(self.copies, self.vector, mode, petsc().ScatterMode.REVERSE)
        self.sent += 8 * self.ghosts
        return np.array(self.vector.array_r[self.positions])

    def to_petsc(self, owned_values: Array) -> Any:
        """A new vector of PETSc's with these own values (k,): whoever asks destroys it, for Python
        cannot tell when the other processes are done with it.
        """
        vector = self.vector.duplicate()
        vector.array[self.positions] = owned_values
        return vector


def global_sum(values: Array) -> Array:
    """Sums over processes."""
    sums = np.empty_like(values)
    world().Allreduce(np.ascontiguousarray(values), sums)
    return sums


def global_max(value: float) -> float:
    """The largest number of any process; nan where one is."""
    result = np.empty(2)
    world().Allreduce(np.array([value, float(np.isnan(value))]), result, _maximum())
    return float("nan") if result[1] else float(result[0])


def _maximum() -> Any:
    from mpi4py import MPI

    return MPI.MAX
