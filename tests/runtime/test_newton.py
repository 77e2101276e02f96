"""Newton on algebraic problems whose answers and convergence are known in closed form."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array
from softehl.runtime.solve.linear.linear_solver import SparseMatrix
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import NotConverged, Solution, Status


def _full_step(x: Array, dx: Array) -> float:
    return 1.0


@dataclass(frozen=True)
class Algebraic:
    """R and dR/dx as plain functions; `visited` lists the x at which R was asked for."""

    equations: Callable[[Array], Array]
    jacobian: Callable[[Array], Array]
    limit: Callable[[Array, Array], float] = _full_step
    visited: list[Array] = field(default_factory=list)

    def residual(self, x: Array) -> Array:
        self.visited.append(x.copy())
        return self.equations(x)

    def linearise(self, x: Array) -> tuple[Array, SparseMatrix]:
        return self.equations(x), csc_array(np.atleast_2d(self.jacobian(x)))

    def norm(self, r: Array) -> float:
        return float(np.abs(r).max())

    def step_limit(self, x: Array, dx: Array) -> float:
        return self.limit(x, dx)


def square_root(scale: float = 1.0) -> Algebraic:
    """x^2 = 2, with a tangent that is `scale` times the exact one."""
    return Algebraic(lambda x: x**2 - 2.0, lambda x: scale * 2.0 * np.diag(x))


def circle_and_hyperbola(coupling: float = 1.0) -> Algebraic:
    """x^2 + y^2 = 4, x y = 1; `coupling` = 1 makes the off-diagonal tangent exact.

    (x + y)^2 = 6 and (x - y)^2 = 2, so x = (sqrt 6 + sqrt 2) / 2, y = (sqrt 6 - sqrt 2) / 2.
    """
    return Algebraic(
        lambda v: np.array([v @ v - 4.0, v[0] * v[1] - 1.0]),
        lambda v: np.array([[2.0 * v[0], coupling * 2.0 * v[1]], [coupling * v[1], v[0]]]),
    )


def order(solution: Solution) -> float:
    """Exponent q of norm_{k+1} ~ norm_k^q, from the last three norms above rounding."""
    a, b, c = [norm for norm in solution.residual_norms if norm > 1e-13][-3:]
    return math.log(c / b) / math.log(b / a)


def solve(problem: Algebraic, *x0: float, newton: Newton | None = None) -> Solution:
    return (newton or Newton()).solve(problem, np.array(x0))


def test_each_residual_of_a_square_root_is_the_squared_last_one() -> None:
    # Exactly r_{k+1} = r_k^2 / (4 x_k^2) for x^2 = 2.
    problem = square_root()
    solution = solve(problem, 3.0)
    assert solution.status is Status.CONVERGED
    assert solution.x == pytest.approx([math.sqrt(2.0)], rel=1e-15)
    pairs = list(itertools.pairwise(solution.residual_norms))
    assert len(pairs) == solution.iterations == 5
    for x, (before, after) in zip(problem.visited, pairs, strict=False):
        assert after == pytest.approx(before**2 / (4.0 * x[0] ** 2), rel=1e-6, abs=2e-15)
    assert order(solution) == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize(
    ("problem", "x0"),
    [(square_root(scale=1.05), (3.0,)), (circle_and_hyperbola(coupling=0.5), (3.0, 0.1))],
)
def test_a_wrong_tangent_loses_quadratic_convergence(
    problem: Algebraic, x0: tuple[float, ...]
) -> None:
    solution = solve(problem, *x0)
    assert solution.converged
    assert order(solution) == pytest.approx(1.0, abs=0.1)
    assert solution.residual_norms[-1] <= Newton().tolerance  # not by way of stagnation


def test_a_tangent_too_stiff_by_a_tenth_converges_at_the_rate_of_theory() -> None:
    # The error shrinks by 1 - 1/1.1 in each iteration.
    norms = solve(square_root(scale=1.1), 1.5).residual_norms
    assert norms[-1] / norms[-2] == pytest.approx(1.0 - 1.0 / 1.1, rel=1e-4)


def test_full_step_passes_a_kink_although_the_norm_rises() -> None:
    # x + 10 max(x - 1, 0) = 5 has the root 15/11; from 0 the first full step overshoots to 5.
    problem = Algebraic(
        lambda x: x + 10.0 * np.maximum(x - 1.0, 0.0) - 5.0,
        lambda x: np.diag(np.where(x > 1.0, 11.0, 1.0)),
    )
    solution = solve(problem, 0.0)
    assert solution.x == pytest.approx([15.0 / 11.0], rel=1e-15)
    assert solution.residual_norms == pytest.approx((5.0, 40.0, 0.0), abs=1e-13)


def test_line_search_is_an_option() -> None:
    # Newton on arctan diverges from |x| > 1.392.
    problem = Algebraic(np.arctan, lambda x: np.diag(1.0 / (1.0 + x**2)))
    assert solve(problem, 2.0, newton=Newton(max_iterations=5)).status is Status.MAX_ITERATIONS
    searched = solve(problem, 2.0, newton=Newton(max_iterations=5, line_search=True))
    assert searched.converged
    assert searched.x == pytest.approx([0.0], abs=1e-9)
    assert all(after < before for before, after in itertools.pairwise(searched.residual_norms))


def test_growth_is_called_diverged() -> None:
    # Next to the extremum 1/sqrt 3 of x^3 - x the tangent is nearly zero, the step enormous.
    problem = Algebraic(lambda x: x**3 - x, lambda x: np.diag(3.0 * x**2 - 1.0))
    solution = solve(problem, 1.0 / math.sqrt(3.0) + 1e-5)
    assert solution.status is Status.DIVERGED
    assert solution.iterations == 1
    assert solution.residual_norms[1] > 1e6 > solution.residual_norms[0]


def test_singular_tangent_is_a_status_and_leaves_x() -> None:
    solution = solve(square_root(), 0.0)
    assert solution.status is Status.SINGULAR
    assert (solution.iterations, solution.factorisations) == (0, 1)
    assert solution.x == pytest.approx([0.0], abs=0.0)


LOGARITHM = Algebraic(np.log, lambda x: np.diag(1.0 / x))


def test_start_that_is_not_finite() -> None:
    solution = solve(LOGARITHM, -1.0)
    assert solution.status is Status.NOT_FINITE
    assert "start" in solution.message


def test_step_into_the_undefined_is_halved() -> None:
    # From 4 the Newton step for log x = 0 ends at 4 - 4 log 4 < 0, half of it at 4 - 2 log 4 > 0.
    problem = Algebraic(LOGARITHM.equations, LOGARITHM.jacobian)
    solution = solve(problem, 4.0)
    assert solution.x == pytest.approx([1.0], rel=1e-9)
    assert [x[0] for x in problem.visited[1:3]] == pytest.approx(
        [4.0 - 4.0 * math.log(4.0), 4.0 - 2.0 * math.log(4.0)]
    )
    refused = solve(problem, 4.0, newton=Newton(halvings=0))
    assert refused.status is Status.NOT_FINITE
    assert refused.x == pytest.approx([4.0], abs=0.0)


def test_step_limit_keeps_every_trial_admissible() -> None:
    def positive(x: Array, dx: Array) -> float:
        return min(1.0, 0.9 * x[0] / -dx[0]) if dx[0] < 0.0 else 1.0

    problem = Algebraic(LOGARITHM.equations, LOGARITHM.jacobian, positive)
    solution = solve(problem, 4.0)
    assert solution.x == pytest.approx([1.0], rel=1e-9)
    assert problem.visited[1] == pytest.approx([0.4])
    assert min(x[0] for x in problem.visited) > 0.0


@pytest.mark.parametrize("limit", [0.0, math.nan])
def test_no_admissible_step_is_a_failure(limit: float) -> None:
    problem = Algebraic(LOGARITHM.equations, LOGARITHM.jacobian, lambda x, dx: limit)
    solution = solve(problem, 4.0)
    assert solution.status is Status.DIVERGED
    assert "admissible" in solution.message


def rounded(floor: float) -> Algebraic:
    """x^2 = 2 with a residual of few digits that never falls below `floor`."""
    return Algebraic(
        lambda x: np.round((x**2 - 2.0) / (4.0 * floor)) * 4.0 * floor + floor,
        lambda x: 2.0 * np.diag(x),
    )


def test_rounding_above_the_tolerance_counts_as_converged_within_the_bound() -> None:
    solution = solve(rounded(4e-9), 1.5)
    assert solution.status is Status.CONVERGED
    assert solution.residual_norms[-2:] == pytest.approx((4e-9, 4e-9), rel=1e-6)
    assert "rounding" in solution.message


@pytest.mark.parametrize(("floor", "stagnation"), [(4e-9, 1.0), (4e-7, 100.0)])
def test_rounding_beyond_the_bound_is_not_accepted(floor: float, stagnation: float) -> None:
    solution = solve(rounded(floor), 1.5, newton=Newton(stagnation=stagnation))
    assert solution.status is Status.MAX_ITERATIONS
    assert solution.residual_norms[-1] == pytest.approx(floor, rel=1e-6)


@dataclass(frozen=True)
class Represented(Algebraic):
    """One that knows what the last digits of x make of its residual."""

    share: float = 1.0

    def beyond_rounding(self, r: Array, x: Array, K: SparseMatrix) -> float:
        """What is left beyond a share of the residual."""
        return (1.0 - self.share) * float(np.abs(r).max())


def test_what_the_last_digits_of_x_cause_is_not_iterated_on() -> None:
    def of(share: float) -> Solution:
        plain = rounded(4e-9)
        return solve(Represented(plain.equations, plain.jacobian, share=share), 1.5)

    known, unknown = of(1.0), of(0.0)
    assert known.converged
    assert "all of it rounding" in known.message
    assert known.iterations < unknown.iterations
    assert known.residual_norms == unknown.residual_norms[: known.iterations + 1]


@pytest.mark.parametrize("status", Status)
def test_every_failure_has_advice(status: Status) -> None:
    assert bool(status.advice) is (status is not Status.CONVERGED)


def test_only_raise_for_status_raises() -> None:
    solution = solve(square_root(), 0.0)
    with pytest.raises(NotConverged, match=r"singular tangent.*rigid motion") as caught:
        solution.raise_for_status()
    assert caught.value.result is solution
