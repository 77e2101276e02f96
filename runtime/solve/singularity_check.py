"""Check of the support of a solved body: rounding alone makes the matrix of a floating body
regular, and the position of its solution is arbitrary.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Protocol, runtime_checkable

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.solve.linear.linear_solver import (
    Factors,
    LinearSolver,
    SingularMatrix,
    SparseMatrix,
)
from softehl.runtime.solve.newton import NamedProblem, Newton
from softehl.runtime.solve.solution import NotConverged, Solution, Status

SINGULAR = 1e-13
"""A change of the entries of a matrix, relative to each, that rounding may have made."""

_AT_REST = 1e-10  # of the largest entry of a vector


@runtime_checkable
class JudgesSingularity(Protocol):
    """Factors without an assembled matrix, which find unconstrained unknowns by themselves."""

    def unconstrained_unknown(self) -> int | None:
        """The number of the unknown that moves most where the matrix is singular, else None."""
        ...


@dataclass
class LastFactorisation:
    """A linear solver that keeps the last matrix and its factors."""

    solver: LinearSolver
    last: tuple[SparseMatrix, Factors] | None = field(default=None, init=False)

    @property
    def name(self) -> str:
        """See `LinearSolver`."""
        return self.solver.name

    def factorise(self, K: SparseMatrix) -> Factors:
        """See `LinearSolver`."""
        self.last = None  # never two at a time: they are what memory goes into
        factors = self.solver.factorise(K)
        self.last = K, factors
        return factors


@dataclass
class SupportCheck:
    """Newton's method of a path that checks the support of the body after the first step.

    memory: its linear solver, which keeps the last factors.
    """

    newton: Newton
    memory: LastFactorisation = field(init=False)
    _checked: bool = False

    def __post_init__(self) -> None:
        """Let the linear solver remember."""
        self.memory = LastFactorisation(self.newton.linear)
        self.newton = replace(self.newton, linear=self.memory)

    @property
    def last(self) -> tuple[SparseMatrix, Factors] | None:
        """The last matrix that was factorised, and its factors."""
        return self.memory.last

    def check(self, problem: NamedProblem, solution: Solution) -> None:
        """Raise NotConverged if the body is unconstrained; call after each converged step."""
        memory = self.memory.last
        if memory is None or self._checked:
            return
        self._checked = True
        K, factors = memory
        number = (
            factors.unconstrained_unknown()
            if isinstance(factors, JudgesSingularity)
            else unconstrained_unknown(K, factors)
        )
        if number is not None:
            message = f"nothing prevents a motion of {problem.name_of(number)}"
            raise NotConverged(replace(solution, status=Status.NOT_HELD, message=message))


def unconstrained_unknown(K: SparseMatrix, factors: Factors) -> int | None:
    """The unknown that moves most where K, (n, n), is singular but for rounding, else None.

    For K y = b, changes of the entries of K by max |b| / (|K| |y|), relative to each, make K
    singular (Oettli and Prager). Unknowns that hardly move with y
    stay at rest, prescribed ones above all.
    """
    try:
        y = factors.solve(random_signs(K.shape[0]))
    except SingularMatrix:
        return None  # it was regular enough for the solution
    y = without_small_entries(y, np.abs(y).max())
    if np.all(np.abs(np.asarray(K @ y)) <= SINGULAR * np.asarray(abs(K) @ np.abs(y))):
        return int(np.abs(y).argmax())
    return None


def random_signs(n: int, seed: int = 0) -> Array:
    """Random entries -1 and 1, (n,)."""
    entries: Array = np.where(np.random.default_rng(seed).random(n) < 0.5, -1.0, 1.0)
    return entries


def without_small_entries(y: Array, largest: float) -> Array:
    """Entries (n,) with those at rest set to 0; largest: magnitude of any."""
    return np.where(np.abs(y) <= _AT_REST * largest, 0.0, y)
