"""Distribution of unknowns and elements over processes: here, all are in one process.

The engine of several processes (`runtime.parallel`) has a subclass. The vectors that pass through a
solution path are then those of one process, its own unknowns and copies of its neighbours'; every
decision is made by `Share`, so that all processes decide alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, TypeVar

import numpy as np
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation.constraints import Constraints, symmetric
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.solve.eigen import lowest, smallest_factors

T = TypeVar("T")


class ConstraintMap(Protocol):
    """Free unknowns z of a problem: all change by T z; see `constraints.Constraints`."""

    def gather(self, forces: Array) -> Array:
        """T' f of forces of the elements of this process: own sums over all."""
        ...

    def spread(self, z: Array) -> Array:
        """T z at the unknowns of this process."""
        ...


class Share:
    """All unknowns and elements on one process; every method is called by all processes alike."""

    first = True
    """True if this process writes what is one file for all, and speaks."""
    pieces: tuple[int, int] = (0, 1)
    """Number of this process, and of all."""

    def posed(self, problem: Problem) -> Any:
        """The problem as a solver sees it."""
        return problem

    def whole(self, x: Array) -> Array:
        """Unknowns (..., n) of all processes, on each of them."""
        return x

    def own(self, x: Array) -> Array:
        """Of unknowns (..., n) of all processes those of this one."""
        return x

    def whole_cells(self, block: str, values: Array) -> Array:
        """Values (n, ...) of the elements of a block of all processes, on each of them."""
        return values

    def own_cells(self, block: str, values: Array) -> Array:
        """Of values (n, ...) of the elements of a block those of this process."""
        return values

    def whole_forces(self, forces: Array) -> Array:
        """Sums (n,) over all processes of what the elements of each add to every unknown."""
        return forces

    def added(self, x: Array) -> Array:
        """Sums over all processes, at the unknowns of this one, of what elements add to each."""
        return x

    def owned(self, size: int) -> Integers:
        """Numbers of the process's own of so many unknowns: each is one process's own."""
        return np.arange(size)

    def total(self, values: Array) -> Array:
        """Sums over processes."""
        return values

    def dot(self, a: Array, b: Array) -> float:
        """Product of vectors of which each process has own values."""
        return float(self.total(np.array([a @ b]))[0])

    def free(self, problem: Problem) -> ConstraintMap:
        """Free unknowns of the equations of this process."""
        return Constraints.of(problem)

    def part(self, posed: Any) -> Problem:
        """Of what `posed` gave, the equations of this process."""
        found: Problem = posed
        return found

    def lowest(
        self, problem: Problem, K: csc_array, M: csc_array, count: int
    ) -> tuple[Array, Array]:
        """Lowest eigenvalues (count,) of K x = w M x and vectors (count, n): `eigen.lowest`.

        problem: whose supports and ties hold. K, M: (n, n), of the elements of this process.
        """
        free = Constraints.of(problem, K)
        given = symmetric(free.matrix(K)), symmetric(free.matrix(M))
        values, found = lowest(*given, count, free.saddle(K))
        return values, np.asarray((free.map @ found.T).T)

    def buckling(
        self, problem: Problem, K: csc_array, G: csc_array, count: int
    ) -> tuple[Array, Array]:
        """Smallest positive f of (K + f G) x = 0, and vectors: `eigen.smallest_factors`."""
        free = Constraints.of(problem, K)
        factors, found = smallest_factors(
            symmetric(free.matrix(K)), symmetric(free.matrix(G)), count
        )
        return factors, np.asarray((free.map @ found.T).T)

    def renewed(self) -> Share:
        """A distribution of the same unknowns, for equations with other elements."""
        return self

    def largest(self, value: float) -> float:
        """The largest of the numbers that the processes have."""
        return value

    def norm(self, x: Array) -> float:
        """2-norm of what `whole` gave, each unknown counted once."""
        return float(np.linalg.norm(x))

    def summed(self, values: Array, numbers: Integers) -> float:
        """Sum of values at these unknowns, each counted once."""
        return float(values[numbers].sum())

    def found_each(self, values: list[T | None]) -> list[T | None]:
        """Of each value that of the first process that has found it, on all of them."""
        return values

    def at_all_nodes(self, values: Array) -> Array:
        """Values (n,) at the nodes of this process's mesh as those at all nodes of the whole."""
        return values

    def together(self) -> None:
        """Wait for the other processes."""

    def whole_state(self, state: Mapping[str, Array]) -> dict[str, Array]:
        """Block -> point data of all processes."""
        return {name: self.whole_cells(name, values) for name, values in state.items()}

    def own_state(self, state: Mapping[str, Array]) -> dict[str, Array]:
        """Block -> of the point data of all processes those of this one."""
        return {name: self.own_cells(name, values) for name, values in state.items()}


ALONE = Share()
"""All on one process."""
