"""Newton's method, cascades of solvers, measures of residuals, pseudo-transients."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import inf
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csc_array

from softehl import Definition, Mesh, Model, Study, quadrature
from softehl.runtime.arrays import Array
from softehl.runtime.solve.linear.linear_solver import SparseMatrix
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.pseudo_transient import PseudoTransient, TransientState
from softehl.runtime.solve.solution import Branch, NotConverged, Solution, Status
from softehl.runtime.solve.solver_cascade import Ladder
from tests.runtime.enhanced_page import enhanced


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


# --- A ladder of correctors: warm hand-off, costs added up, guards, memories kept up to date ------


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


# --- When Newton's method has converged: every equation by itself, and each field as a whole ------


def bar() -> Definition:
    """Conduction between two nodes."""
    m = Model("bar", nodes=2, rule=quadrature.point_rule(), unroll=True)
    (X,) = m.coordinates("X")
    (T,) = m.nodal_unknowns("T")
    (k,) = m.parameters(k="conductivity")
    m.potential(k / 2 * (T[1] - T[0]) ** 2 / (X[1] - X[0]))
    return m.finish()


def cooled() -> Definition:
    """T + 100 T^3 at a node."""
    m = Model("cooled", nodes=1, rule=quadrature.point_rule(), unroll=True)
    m.coordinates("X")
    ((T,),) = m.nodal_unknowns("T")
    m.potential(T**2 / 2 + 25 * T**4)
    return m.finish()


@pytest.mark.filterwarnings("ignore:1 of 3 cells of the mesh have no elements")
@pytest.mark.parametrize("conductivity", [1.0, 1e9, 1e12])
def test_an_equation_is_solved_however_large_forces_are_elsewhere(conductivity: float) -> None:
    """T + 100 T^3 = 1 at one end; at the other a flux of `conductivity` between two supports."""
    mesh = Mesh.line(3.0, cells=3).with_group("conductor", lambda x: x[:, 0] < 1.1)
    study = Study(mesh.with_group("end", lambda x: x[:, 0] > 1.9))
    study.add("conductor", bar(), cells="conductor", k=conductivity)
    study.add("link", bar(), cells="end", k=1e-9)
    study.add("cooled", cooled(), on=lambda x: x[:, 0] > 2.9)
    study.fix((0.0,), T=0)
    study.fix((1.0,), T=1)
    study.fix((2.0,), T=0)
    study.load((3.0,), T=1)
    for steps in (1, 3):
        result = study.solve(steps=steps)
        assert result.at((3.0,))["T"] == pytest.approx(0.2, rel=1e-8)
    tail = [n for n in result.residual_norms if n > 1e-14]
    assert all(after < before for before, after in itertools.pairwise(tail))


@pytest.mark.parametrize("cells", [2, 6, 20])
def test_a_linear_problem_with_unknowns_of_elements_takes_one_iteration(cells: int) -> None:
    """Nothing but their own residual measures the equations of the enhanced strains."""
    study = Study(Mesh.rectangle(10.0, 1.0, cells=(cells, cells)))
    study.add("body", enhanced(), lame=1.5, mu=1.0)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_y=1e-4)
    result = study.solve()
    assert result.residual_norms[0] == pytest.approx(1.0)
    assert result.iterations == 1
    assert result.residual_norms[-1] < 1e-9


def test_a_body_at_rest_has_nothing_to_solve() -> None:
    study = Study(Mesh.rectangle(10.0, 1.0, cells=(4, 2)))
    study.add("body", enhanced(), lame=1.5, mu=1.0)
    study.fix("left", u_x=0, u_y=0)
    assert study.solve().norm() == 0.0


# --- Pseudo-transient continuation of dx/dt = 10 s - x - x^3, whose steady state at s = 1 is x ----


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
