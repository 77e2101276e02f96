"""Communicator: collective operations on unknowns and elements; here, of one process.

The engine of several processes (`runtime.parallel`) has a subclass. The vectors that pass through a
solution path are then those of one process, its own unknowns and copies of its neighbours'; every
decision is made by `Communicator`, so that all processes decide alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation.constraints import Constraints
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.discretisation.reduced_tangent import CondensedMap, symmetric
from softehl.runtime.solve.eigen import lowest, smallest_factors

T = TypeVar("T")


class Communicator:
    """Communicator of one process; every method is collective."""

    is_root = True
    """True if this process writes the files and the messages of all."""
    rank_and_size: tuple[int, int] = (0, 1)
    """Rank of this process, and number of processes."""

    def distribute(self, problem: Problem) -> Any:
        """Problem of all processes for a solver."""
        return problem

    def gather(self, x: Array) -> Array:
        """Unknowns (..., n) of all processes, on each of them."""
        return x

    def restrict(self, x: Array) -> Array:
        """Unknowns of this process out of those of all, (..., n)."""
        return x

    def gather_cells(self, block: str, values: Array) -> Array:
        """Values (n, ...) of the elements of a block of all processes, on each of them."""
        return values

    def restrict_cells(self, block: str, values: Array) -> Array:
        """Values of the elements of this process out of those of all, (n, ...)."""
        return values

    def gather_forces(self, forces: Array) -> Array:
        """Sums (n,) over all processes of what the elements of each add to every unknown."""
        return forces

    def sum_shared(self, x: Array) -> Array:
        """Sums over all processes, at the unknowns of this one, of what elements add to each."""
        return x

    def owned(self, size: int) -> Integers:
        """Numbers of the process's own of so many unknowns: each is one process's own."""
        return np.arange(size)

    def sum(self, values: Array) -> Array:
        """Sums over processes."""
        return values

    def dot(self, a: Array, b: Array) -> float:
        """Product of vectors of which each process has own values."""
        return float(self.sum(np.array([a @ b]))[0])

    def constraints(self, problem: Problem) -> Constraints:
        """Constraints of the equations of this process, with free unknowns z of all processes."""
        return problem.constraints

    def local_problem(self, distributed: Any) -> Problem:
        """Equations of this process of a distributed problem."""
        problem: Problem = distributed
        return problem

    def lowest_modes(
        self, problem: Problem, K: csc_array, M: csc_array, count: int
    ) -> tuple[Array, Array]:
        """Lowest eigenvalues (count,) of K x = w M x and vectors (count, n): `eigen.lowest`.

        problem: whose supports and ties hold. K, M: (n, n), of the elements of this process.
        """
        free = CondensedMap.of(problem, K)
        stiffness, mass = symmetric(free.matrix(K)), symmetric(free.matrix(M))
        values, vectors = lowest(stiffness, mass, count, free.saddle(K))
        return values, free.expand(vectors.T).T

    def buckling(
        self, problem: Problem, K: csc_array, G: csc_array, count: int
    ) -> tuple[Array, Array]:
        """Smallest positive f of (K + f G) x = 0, and vectors: `eigen.smallest_factors`."""
        free = CondensedMap.of(problem, K)
        factors, vectors = smallest_factors(
            symmetric(free.matrix(K)), symmetric(free.matrix(G)), count
        )
        return factors, free.expand(vectors.T).T

    def with_other_elements(self) -> Communicator:
        """Communicator of the same unknowns for equations with other elements."""
        return self

    def max(self, value: float) -> float:
        """Largest number of all processes."""
        return value

    def norm(self, x: Array) -> float:
        """2-norm of a vector of `gather`, each unknown counted once."""
        return float(np.linalg.norm(x))

    def sum_at(self, values: Array, numbers: Integers) -> float:
        """Sum of values at these unknowns, each counted once."""
        return float(values[numbers].sum())

    def first_not_none(self, values: list[T | None]) -> list[T | None]:
        """For each value the one of the first process that has it, on all processes."""
        return values

    def gather_nodes(self, values: Array) -> Array:
        """Values (n,) at the nodes of this process's mesh as those at all nodes of the whole."""
        return values

    def barrier(self) -> None:
        """Wait for the other processes."""

    def gather_state(self, state: Mapping[str, Array]) -> dict[str, Array]:
        """Block -> point data of all processes."""
        return {name: self.gather_cells(name, values) for name, values in state.items()}

    def restrict_state(self, state: Mapping[str, Array]) -> dict[str, Array]:
        """Block -> of the point data of all processes those of this one."""
        return {name: self.restrict_cells(name, values) for name, values in state.items()}


SERIAL = Communicator()
"""Communicator of a serial run."""
