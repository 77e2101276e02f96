"""MPI communicator: collective operations on a distributed solution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.discretisation.communicator import Communicator
from softehl.runtime.discretisation.constraints import Constraints
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.discretisation.reduced_tangent import concave, internal_negative
from softehl.runtime.equations.system import System
from softehl.runtime.mpi import world
from softehl.runtime.parallel.distributed_problem import (
    DistributedProblem,
    ParallelContext,
    distributed_constraints,
)
from softehl.runtime.parallel.halo_exchange import global_max, global_sum
from softehl.runtime.parallel.matrix_free import NO_INERTIA
from softehl.runtime.parallel.slepc import Pencil

T = TypeVar("T")


@dataclass(eq=False)
class MpiCommunicator(Communicator):
    """See `Communicator`: operations of one of several processes."""

    team: ParallelContext

    def __reduce__(self) -> tuple[Any, ...]:
        """Raises StudyError."""
        raise StudyError(
            "results of several processes are not pickled: write(...) them, or pickle what "
            "gathered(...) gives"
        )

    @property
    def is_root(self) -> bool:  # type: ignore[override]
        """See `Communicator`."""
        return bool(world().rank == 0)

    @property
    def rank_and_size(self) -> tuple[int, int]:  # type: ignore[override]
        """See `Communicator`."""
        return world().rank, world().size

    def distribute(self, problem: Problem) -> DistributedProblem:
        """See `Communicator`."""
        return DistributedProblem(problem, self.team)

    def gather(self, x: Array) -> Array:
        """See `Communicator`."""
        part = self.team.part
        return _gathered(x[..., part.owned], part.unknowns[part.owned], self._global_system.size)

    def restrict(self, x: Array) -> Array:
        """See `Communicator`."""
        return np.asarray(x[..., self.team.part.unknowns])

    def gather_cells(self, block: str, values: Array) -> Array:
        """See `Communicator`."""
        rows = self.team.part.elements[block]
        count = len(self._global_system.blocks[block].nodes)
        return np.moveaxis(_gathered(np.moveaxis(values, 0, -1), rows, count), -1, 0)

    def restrict_cells(self, block: str, values: Array) -> Array:
        """See `Communicator`."""
        return np.asarray(values[self.team.part.elements[block]])

    def gather_forces(self, forces: Array) -> Array:
        """See `Communicator`."""
        part = self.team.part
        owned = self.team.exchange.added(forces)
        return _gathered(owned, part.unknowns[part.owned], self._global_system.size)

    def sum_shared(self, x: Array) -> Array:
        """See `Communicator`."""
        exchange = self.team.exchange
        return exchange.copied(exchange.added(x))

    def owned(self, size: int) -> Integers:
        """See `Communicator`."""
        return self.team.part.owned

    def sum(self, values: Array) -> Array:
        """See `Communicator`."""
        return global_sum(values)

    def constraints(self, problem: Problem) -> Constraints:
        """See `Communicator`."""
        return distributed_constraints(problem, self.team.part, self.team.exchange)

    def local_problem(self, distributed: DistributedProblem) -> Problem:
        """See `Communicator`."""
        return distributed.problem

    def lowest_modes(
        self, problem: Problem, K: csc_array, M: csc_array, count: int
    ) -> tuple[Array, Array]:
        """See `Communicator`."""
        constraints = self.constraints(problem)
        rising = concave(problem, K, self.sum_shared, lambda flag: bool(global_max(float(flag))))
        natural = int((constraints.gather(rising.astype(np.float64)) > 0.0).sum())
        negative = global_sum(np.array([natural + internal_negative(problem, K)]))
        return Pencil(constraints, K, M).lowest(count, int(negative[0]))

    def buckling(
        self, problem: Problem, K: csc_array, G: csc_array, count: int
    ) -> tuple[Array, Array]:
        """See `Communicator`."""
        return Pencil(self.constraints(problem), K, G).factors(count)

    def with_other_elements(self) -> Communicator:
        """See `Communicator`.  Raises StudyError without matrices."""
        if self.team.levels is not None:
            raise StudyError(NO_INERTIA)
        return type(self)(self.team.with_other_elements())

    def max(self, value: float) -> float:
        """See `Communicator`."""
        return global_max(value)

    def barrier(self) -> None:
        """See `Communicator`."""
        world().Barrier()

    @property
    def _global_system(self) -> System:
        return self.team.part.system.everywhere


@dataclass(eq=False)
class PartitionedMeshCommunicator(MpiCommunicator):
    """See `Communicator`: of a partitioned mesh; vectors are those of the partition (m,)."""

    def gather(self, x: Array) -> Array:
        """See `Communicator`: those of the part."""
        return x

    def restrict(self, x: Array) -> Array:
        """See `Communicator`."""
        return x

    def gather_cells(self, block: str, values: Array) -> Array:
        """See `Communicator`: those of the part."""
        return values

    def restrict_cells(self, block: str, values: Array) -> Array:
        """See `Communicator`."""
        return values

    def gather_forces(self, forces: Array) -> Array:
        """See `Communicator`: sums at the unknowns of the part."""
        return self.sum_shared(forces)

    def norm(self, x: Array) -> float:
        """See `Communicator`."""
        owned = x[self.team.part.owned]
        return float(np.sqrt(global_sum(np.array([owned @ owned]))[0]))

    def sum_at(self, values: Array, numbers: Integers) -> float:
        """See `Communicator`."""
        is_owned: Flags = np.zeros(len(values), dtype=bool)
        is_owned[self.team.part.owned] = True
        return float(global_sum(np.array([values[numbers[is_owned[numbers]]].sum()]))[0])

    def first_not_none(self, values: list[T | None]) -> list[T | None]:
        """See `Communicator`."""
        by_process = zip(*world().allgather(values), strict=True)
        return [next((v for v in row if v is not None), None) for row in by_process]

    def gather_nodes(self, values: Array) -> Array:
        """See `Communicator`."""
        piece = self.team.part.system.mesh.piece
        assert piece is not None
        by_process = world().allgather((piece.numbers, values))
        numbers, inverse = np.unique(
            np.concatenate([n for n, _ in by_process]), return_inverse=True
        )
        every, result = np.concatenate([v for _, v in by_process]), np.full(len(numbers), np.nan)
        mask = ~np.isnan(every)
        result[inverse[mask]] = every[mask]
        return result


def _gathered(values: Array, positions: Integers, count: int) -> Array:
    """The array (..., count) of which each process has `values` at its own `places`."""
    flat = values.reshape(-1, values.shape[-1]) if values.ndim > 1 else values[None]
    result = np.zeros((len(flat), count))
    result[:, positions] = flat
    return np.asarray(global_sum(result).reshape(*values.shape[:-1], count))
