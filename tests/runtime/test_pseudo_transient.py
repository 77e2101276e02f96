"""Pseudo-transient continuation of dx/dt = 10 s - x - x^3, whose steady state at s = 1 is x = 2."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf

import numpy as np
import pytest

from softehl.runtime.arrays import Array
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.pseudo_transient import PseudoTransient, TransientState
from softehl.runtime.solve.solution import Branch, Status
from tests.runtime.test_newton import Algebraic

START = TransientState(np.array([-5.0]), 1e-3)


@dataclass
class Decay:
    """The problem; it notes the length and the load of each attempt.

    size: of a change, by the number of the attempt; None for its true size.
    """

    size: Callable[[int], float | None] = lambda number: None
    asked: list[tuple[float, float]] = field(default_factory=list)

    def step(self, before: Array, tau: float, load: float) -> Algebraic:
        """See `Transient`."""
        self.asked.append((tau, load))
        return Algebraic(
            lambda x: x**3 + x - 10.0 * load + (x - before) / tau,
            lambda x: np.diag(3.0 * x**2 + 1.0 + 1.0 / tau),
        )

    def change(self, before: Array, after: Array) -> float:
        """See `Transient`."""
        size = self.size(len(self.asked))
        return float(np.abs(after - before).max()) if size is None else size


def followed(problem: Decay, **rule: int | tuple[int, int]) -> tuple[Branch, TransientState]:
    return PseudoTransient(Newton(max_iterations=30), **rule).follow(problem, START)  # type: ignore[arg-type]


def test_it_ends_at_the_steady_state_after_long_steps() -> None:
    problem = Decay()
    branch, reached = followed(problem)
    assert branch.converged, branch.message
    assert reached.x == pytest.approx([2.0], rel=1e-6)
    assert reached.load == 1.0
    lengths = [tau for tau, _ in problem.asked]
    assert lengths[-1] >= 1e4
    assert all(b <= 10.0 * a * (1.0 + 1e-12) for a, b in pairwise(lengths))


def test_a_step_that_changes_much_is_followed_by_a_shorter_one() -> None:
    problem = Decay(size=lambda number: (0.07, 1.05, 0.7)[(number - 1) % 3])
    followed(problem, max_steps=4)
    ratios = [b / a for (a, _), (b, _) in pairwise(problem.asked)]
    assert ratios == pytest.approx([10.0, 0.7 / 1.05, 1.0])


def test_the_load_grows_in_doubling_steps_while_their_length_stays() -> None:
    problem = Decay()
    followed(problem)
    loads = [load for _, load in problem.asked]
    first = next(k for k, load in enumerate(loads) if load > 0.0)
    assert set(loads[:first]) == {0.0}
    assert loads[first : first + 3] == [0.25, 0.75, 1.0]
    assert set(loads[first + 3 :]) == {1.0}
    lengths = [tau for tau, _ in problem.asked]
    assert lengths[first - 1] < 1.0 <= lengths[first]
    assert len(set(lengths[first : first + 4])) == 1  # the first step under all of it too


def test_a_failed_step_is_cut_and_takes_less_of_the_load() -> None:
    plain, failing = Decay(), Decay()
    followed(plain)
    second = next(k for k, (_, load) in enumerate(plain.asked) if load == 0.75)
    failing.size = lambda number: inf if number == second + 1 else None
    branch, reached = followed(failing)
    (tau, load), (again, less) = failing.asked[second : second + 2]
    assert (again, load, less) == (0.25 * tau, 0.75, 0.5)
    assert branch.converged
    assert reached.x == pytest.approx([2.0], rel=1e-6)


@pytest.mark.parametrize(("every", "attempts"), [(1, 3), (2, 24)], ids=["in a row", "in all"])
def test_failures_end_the_path_with_a_reason(every: int, attempts: int) -> None:
    problem = Decay(size=lambda number: inf if number % every == 0 else None)
    branch, _ = followed(problem)
    assert branch.status is Status.REFUSED
    assert "not admissible" in branch.message
    assert len(problem.asked) == attempts


def test_a_corrector_that_fails_is_a_failure_too() -> None:
    branch, reached = PseudoTransient(Newton(max_iterations=0)).follow(Decay(), START)
    assert not branch.converged
    assert "too many iterations" in branch.message
    assert reached.x == START.x


def test_what_does_not_become_steady_ends_after_its_steps() -> None:
    problem = Decay(size=lambda number: 0.7)
    branch, _ = followed(problem, max_steps=5)
    assert branch.status is Status.MAX_ITERATIONS
    assert branch.message.startswith("not steady after 5 steps")
    assert len(problem.asked) == 5


def test_a_path_goes_on_from_the_moment_that_was_reached() -> None:
    whole, first, rest = Decay(), Decay(), Decay()
    followed(whole)
    rule = PseudoTransient(Newton(max_iterations=30), max_steps=4)
    _, moment = rule.follow(first, START)
    branch, reached = PseudoTransient(Newton(max_iterations=30)).follow(rest, moment)
    assert branch.converged
    assert [*first.asked, *rest.asked] == whole.asked
    assert reached.x == pytest.approx([2.0], rel=1e-6)


@pytest.mark.parametrize("iterations", [30, 0], ids=["found", "not found"])
def test_the_steady_equations_are_the_last_point_of_a_path(iterations: int) -> None:
    """Their cost is that of the path, and if they fail, so does it."""
    steady = Algebraic(lambda x: x**3 + x - 10.0, lambda x: np.diag(3.0 * x**2 + 1.0))
    corrector = Newton(max_iterations=iterations, tolerance=1e-14)
    plain, _ = followed(Decay())
    branch, reached = PseudoTransient(Newton(max_iterations=30)).follow(
        Decay(), START, finish=lambda x: corrector.solve(steady, x)
    )
    assert branch.converged is (iterations > 0)
    if branch.converged:
        assert branch.last.x == pytest.approx([2.0], rel=1e-14)
        assert len(branch.points) == len(plain.points) + 1
        assert branch.iterations == plain.iterations + branch.last.iterations
    else:
        assert branch.status is Status.MAX_ITERATIONS
        assert branch.message.startswith("steady state: ")
        assert reached.x == pytest.approx([2.0], rel=1e-6)
