"""Distribution of a solution over processes, where each has its part of the equations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.discretisation.communicator import Share
from softehl.runtime.discretisation.constraints import concave, internal_negative
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.equations.system import System
from softehl.runtime.mpi import world
from softehl.runtime.parallel.distributed_problem import Spread, Team
from softehl.runtime.parallel.halo_exchange import largest, total
from softehl.runtime.parallel.matrix_free import NO_INERTIA
from softehl.runtime.parallel.slepc import DistributedConstraints, Pencil

T = TypeVar("T")


@dataclass(eq=False)
class Processes(Share):
    """See `Share`: what a process of several has."""

    team: Team

    def __reduce__(self) -> tuple[Any, ...]:
        """Raises StudyError."""
        raise StudyError(
            "results of several processes are not pickled: write(...) them, or pickle what "
            "gathered(...) gives"
        )

    @property
    def first(self) -> bool:  # type: ignore[override]
        """See `Share`."""
        return bool(world().rank == 0)

    @property
    def pieces(self) -> tuple[int, int]:  # type: ignore[override]
        """See `Share`."""
        return world().rank, world().size

    def posed(self, problem: Problem) -> Spread:
        """See `Share`."""
        return Spread(problem, self.team)

    def whole(self, x: Array) -> Array:
        """See `Share`."""
        part = self.team.part
        return _gathered(x[..., part.owned], part.unknowns[part.owned], self._whole.size)

    def own(self, x: Array) -> Array:
        """See `Share`."""
        return np.asarray(x[..., self.team.part.unknowns])

    def whole_cells(self, block: str, values: Array) -> Array:
        """See `Share`."""
        rows = self.team.part.elements[block]
        count = len(self._whole.blocks[block].nodes)
        return np.moveaxis(_gathered(np.moveaxis(values, 0, -1), rows, count), -1, 0)

    def own_cells(self, block: str, values: Array) -> Array:
        """See `Share`."""
        return np.asarray(values[self.team.part.elements[block]])

    def whole_forces(self, forces: Array) -> Array:
        """See `Share`."""
        part = self.team.part
        owned = self.team.exchange.added(forces)
        return _gathered(owned, part.unknowns[part.owned], self._whole.size)

    def added(self, x: Array) -> Array:
        """See `Share`."""
        exchange = self.team.exchange
        return exchange.copied(exchange.added(x))

    def owned(self, size: int) -> Integers:
        """See `Share`."""
        return self.team.part.owned

    def total(self, values: Array) -> Array:
        """See `Share`."""
        return total(values)

    def free(self, problem: Problem) -> DistributedConstraints:
        """See `Share`."""
        return DistributedConstraints.of(problem, self.team.part, self.team.exchange)

    def part(self, posed: Spread) -> Problem:
        """See `Share`."""
        return posed.problem

    def lowest(
        self, problem: Problem, K: csc_array, M: csc_array, count: int
    ) -> tuple[Array, Array]:
        """See `Share`."""
        free = self.free(problem)
        rising = concave(problem, K, self.added, lambda flag: bool(largest(float(flag))))
        natural = int((free.gather(rising.astype(np.float64)) > 0.0).sum())
        negative = total(np.array([natural + internal_negative(problem, K)]))
        return Pencil(free, K, M).lowest(count, int(negative[0]))

    def buckling(
        self, problem: Problem, K: csc_array, G: csc_array, count: int
    ) -> tuple[Array, Array]:
        """See `Share`."""
        return Pencil(self.free(problem), K, G).factors(count)

    def renewed(self) -> Share:
        """See `Share`.  Raises StudyError without matrices."""
        if self.team.levels is not None:
            raise StudyError(NO_INERTIA)
        return type(self)(self.team.renewed())

    def largest(self, value: float) -> float:
        """See `Share`."""
        return largest(value)

    def together(self) -> None:
        """See `Share`."""
        world().Barrier()

    @property
    def _whole(self) -> System:
        return self.team.part.system.everywhere


@dataclass(eq=False)
class Parts(Processes):
    """See `Share`: of a mesh in parts; there is no whole, vectors are those of a part (m,)."""

    def whole(self, x: Array) -> Array:
        """See `Share`: those of the part."""
        return x

    def own(self, x: Array) -> Array:
        """See `Share`."""
        return x

    def whole_cells(self, block: str, values: Array) -> Array:
        """See `Share`: those of the part."""
        return values

    def own_cells(self, block: str, values: Array) -> Array:
        """See `Share`."""
        return values

    def whole_forces(self, forces: Array) -> Array:
        """See `Share`: sums at the unknowns of the part."""
        return self.added(forces)

    def norm(self, x: Array) -> float:
        """See `Share`."""
        owned = x[self.team.part.owned]
        return float(np.sqrt(total(np.array([owned @ owned]))[0]))

    def summed(self, values: Array, numbers: Integers) -> float:
        """See `Share`."""
        is_owned: Flags = np.zeros(len(values), dtype=bool)
        is_owned[self.team.part.owned] = True
        return float(total(np.array([values[numbers[is_owned[numbers]]].sum()]))[0])

    def found_each(self, values: list[T | None]) -> list[T | None]:
        """See `Share`."""
        by_process = zip(*world().allgather(values), strict=True)
        return [next((v for v in row if v is not None), None) for row in by_process]

    def at_all_nodes(self, values: Array) -> Array:
        """See `Share`."""
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


def _gathered(values: Array, places: Integers, count: int) -> Array:
    """The array (..., count) of which each process has `values` at its own `places`."""
    flat = values.reshape(-1, values.shape[-1]) if values.ndim > 1 else values[None]
    result = np.zeros((len(flat), count))
    result[:, places] = flat
    return np.asarray(total(result).reshape(*values.shape[:-1], count))
