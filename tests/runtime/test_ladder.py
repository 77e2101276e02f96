"""A ladder of correctors: warm hand-off, costs added up, guards, memories kept up to date."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array
from softehl.runtime.solve.linear.linear_solver import SparseMatrix
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Solution, Status
from softehl.runtime.solve.solver_cascade import Ladder


class Root:
    """x^2 = 2."""

    def residual(self, x: Array) -> Array:
        return x**2 - 2.0

    def linearise(self, x: Array) -> tuple[Array, SparseMatrix]:
        return self.residual(x), csc_array(np.diag(2.0 * x))

    def norm(self, r: Array) -> float:
        return float(np.abs(r).max())

    def step_limit(self, x: Array, dx: Array) -> float:
        return 1.0


@dataclass
class Noted:
    """A corrector that notes where it began, and what it is told."""

    newton: Newton
    starts: list[float] = field(default_factory=list)
    told: list[float] = field(default_factory=list)

    def solve(self, problem: Any, x0: Array) -> Solution:
        self.starts.append(float(x0[0]))
        return self.newton.solve(problem, x0)

    def warm_start(self, problem: Any, x: Array) -> None:
        self.told.append(float(x[0]))


@dataclass(frozen=True)
class Fails:
    """A corrector that ends after so many iterations at x, its best iterate elsewhere."""

    x: float
    best: float | None = None

    def solve(self, problem: Any, x0: Array) -> Solution:
        best = None if self.best is None else np.array([self.best])
        end = Solution(np.array([self.x]), Status.DIVERGED, "lost", (1.0, 9.0), 3, 5)
        return replace(end, best=best)


def climbed(first: Any, *rest: Any, start: float = 3.0) -> tuple[Solution, Sequence[float]]:
    last = Noted(Newton())
    solution = Ladder((first, *rest, last)).solve(Root(), np.array([start]))
    return solution, last.starts


def test_the_cheapest_rung_that_serves_is_the_only_one() -> None:
    solution, starts = climbed(Newton())
    assert (solution.converged, solution.rung, starts) == (True, 0, [])
    assert solution.iterations == Newton().solve(Root(), np.array([3.0])).iterations


@pytest.mark.parametrize(
    ("failed", "start"),
    [
        (Fails(1.5), 1.5),  # nearer than the start
        (Fails(9.0), 3.0),  # farther
        (Fails(9.0, best=1.5), 1.5),  # its best iterate is nearer
        (Fails(math.nan), 3.0),
    ],
)
def test_the_next_rung_begins_with_the_better_of_iterate_and_start(
    failed: Fails, start: float
) -> None:
    solution, starts = climbed(failed)
    assert starts == [start]
    assert solution.x == pytest.approx([math.sqrt(2.0)])
    alone = Newton().solve(Root(), np.array([start]))
    assert solution.rung == 1
    assert solution.iterations == 5 + alone.iterations
    assert solution.factorisations == 3 + alone.factorisations
    assert solution.residual_norms == alone.residual_norms


def test_newton_hands_on_its_best_iterate() -> None:
    """From 0.01 the first step goes to 100: its last iterate is worse than the start."""
    short = Newton(max_iterations=3)
    end = short.solve(Root(), np.array([0.01]))
    assert end.status is Status.MAX_ITERATIONS
    assert end.nearest == pytest.approx([0.01])
    assert Newton(max_iterations=1).solve(Root(), np.array([3.0])).best is None
    _, starts = climbed(short, start=0.01)
    assert starts == [0.01]


def test_a_ladder_that_fails_says_what_each_rung_met() -> None:
    solution = Ladder((Fails(1.5), Newton(max_iterations=0))).solve(Root(), np.array([3.0]))
    assert (solution.status, solution.rung) == (Status.MAX_ITERATIONS, 1)
    assert solution.message.startswith("lost; then: last norms")
    assert (solution.iterations, solution.factorisations) == (5, 3)


def test_rungs_with_a_memory_learn_what_another_one_found() -> None:
    first, last = Noted(Newton(max_iterations=1)), Noted(Newton())
    ladder = Ladder((first, last))
    solution = ladder.solve(Root(), np.array([3.0]))
    assert first.told == [solution.x[0]]
    assert last.told == []
    ladder.solve(Root(), solution.x)  # the first serves here
    assert (len(first.told), last.told) == (1, [solution.x[0]])


def test_an_empty_ladder_is_none() -> None:
    with pytest.raises(ValueError, match="at least one"):
        Ladder(())
