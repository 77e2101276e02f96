"""Whether a solved problem was held: a body that floats solves equations that rounding alone keeps
regular, and where it ends up is an accident.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.sparse import issparse

from softehl.runtime.arrays import Array
from softehl.runtime.solve.linear import Factors, LinearSolver, SingularMatrix, SparseMatrix
from softehl.runtime.solve.newton import NamedProblem, Newton
from softehl.runtime.solve.solution import NotConverged, Solution, Status

SINGULAR = 1e-13
"""A change of the entries of a matrix, relative to each, that rounding may have made."""

_AT_REST = 1e-10  # of the largest entry of a vector


@dataclass
class Remembering:
    """A linear solver that keeps the last matrix and its factors until it is asked to forget."""

    solver: LinearSolver
    keeps: bool = True
    last: tuple[SparseMatrix, Factors] | None = field(default=None, init=False)

    @property
    def name(self) -> str:
        """See `LinearSolver`."""
        return self.solver.name

    def factorise(self, K: SparseMatrix) -> Factors:
        """See `LinearSolver`."""
        self.last = None  # never two at a time: they are what memory goes into
        factors = self.solver.factorise(K)
        self.last = (K, factors) if self.keeps else None
        return factors


def recorded(newton: Newton) -> tuple[Newton, Remembering]:
    """Newton's method whose latest factors are kept, and what keeps them."""
    kept = Remembering(newton.linear)
    return replace(newton, linear=kept), kept


@dataclass
class FirstStep:
    """Newton's method of a path whose first step that factorises is looked at once."""

    newton: Newton
    _memory: Remembering = field(init=False)

    def __post_init__(self) -> None:
        """Let the linear solver remember."""
        self._memory = Remembering(self.newton.linear)
        self.newton = replace(self.newton, linear=self._memory)

    def check(self, problem: NamedProblem, solution: Solution) -> None:
        """Raise NotConverged if nothing held what was solved; ask after each converged step."""
        memory, self._memory.last = self._memory.last, None
        if memory is None or not self._memory.keeps:
            return
        self._memory.keeps = False
        K, factors = memory
        # one that is spread over processes is not looked at
        number = loosest(K, factors) if issparse(K) else None
        if number is not None:
            message = f"nothing prevents a motion of {problem.name_of(number)}"
            raise NotConverged(replace(solution, status=Status.NOT_HELD, message=message))


def loosest(K: SparseMatrix, factors: Factors) -> int | None:
    """The unknown that moves most where K, (n, n), is singular but for rounding, else None.

    For K y = b, changes of the entries of K by max |b| / (|K| |y|), relative to each, make K
    singular (Oettli and Prager). What hardly moves with y, prescribed unknowns above all, is left
    at rest.
    """
    b: Array = np.where(np.random.default_rng(0).random(K.shape[0]) < 0.5, -1.0, 1.0)
    try:
        y = factors.solve(b)
    except SingularMatrix:
        return None  # it was regular enough for the solution
    y[np.abs(y) <= _AT_REST * np.abs(y).max()] = 0.0
    size = np.asarray(abs(K) @ np.abs(y))
    if np.all(np.abs(np.asarray(K @ y)) <= SINGULAR * size):
        return int(np.abs(y).argmax())
    return None
