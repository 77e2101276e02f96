"""Paths: continuation, arc length, bifurcations."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from softehl import Definition, Model, quadrature
from softehl.runtime.analyses.bifurcation import MissedBifurcations, critical_point
from softehl.runtime.arrays import Array
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.solve.arclength import Arclength
from softehl.runtime.solve.continuation import Continuation, Predictor, StepRule
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Branch, NotConverged, Point, Status
from softehl.runtime.study import Study, StudyError
from tests.runtime.field_pages import rubber_by_log as rubber
from tests.runtime.test_newton import Algebraic
from tests.runtime.touching_bodies import elastic

# --- Continuation on paths in closed form: lines, a circle, the Bratu fold, a von Mises truss -----


def line(p: float) -> Algebraic:
    """x^3 = p^3, whose path is the straight line x = p."""
    return Algebraic(lambda x: x**3 - p**3, lambda x: np.diag(3.0 * x**2))


def parabola(p: float) -> Algebraic:
    """x^2 = 1 - p, which turns back at p = 1."""
    return Algebraic(lambda x: x**2 - 1.0 + p, lambda x: np.diag(2.0 * x))


def circle(p: float) -> Algebraic:
    """x^2 + p^2 = 1."""
    return Algebraic(lambda x: x**2 + p**2 - 1.0, lambda x: np.diag(2.0 * x))


STEPS = StepRule(first=0.1, smallest=1e-3, largest=0.4)


def natural(steps: StepRule = STEPS, **settings: Any) -> Continuation:
    return Continuation(Newton(), steps, **settings)


# --- the step rule -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("step", "taken", "iterations", "expected"),
    [
        (1.0, 1.0, 6, 1.0),  # as many iterations as wanted: unchanged
        (1.0, 1.0, 4, 1.5),  # 6/4
        (1.0, 1.0, 0, 2.0),  # growth at most 2
        (1.0, 1.0, 8, 0.75),  # 6/8
        (1.0, 1.0, 25, 0.5),  # cut at most to a half
        (1.0, 0.1, 4, 1.0),  # shortened by a waypoint: the rule's own step survives
        (1.0, 0.1, 12, 0.05),  # unless even the short one was hard
        (3.0, 3.0, 3, 4.0),  # largest
        (0.011, 0.011, 12, 0.01),  # smallest
    ],
)
def test_step_after_success(step: float, taken: float, iterations: int, expected: float) -> None:
    rule = StepRule(first=1.0, smallest=0.01, largest=4.0)
    assert rule.after_success(step, taken, iterations) == pytest.approx(expected, rel=1e-14)


def test_step_after_failure_is_cut_deeper_when_it_was_wild() -> None:
    cuts = {s: STEPS.after_failure(0.8, s) for s in Status if s is not Status.CONVERGED}
    wild = {Status.DIVERGED, Status.NOT_FINITE}
    assert cuts == {s: pytest.approx(0.2 if s in wild else 0.4) for s in cuts}


@pytest.mark.parametrize(
    "change",
    [{"smallest": 0.0}, {"smallest": 0.2}, {"largest": 0.05}, {"growth": 0.9}, {"cut": 1.0}],
)
def test_senseless_step_rules_are_rejected(change: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="need 0 < "):
        replace(STEPS, **change)


# --- natural parameter ---------------------------------------------------------------------------


@pytest.mark.parametrize(("start", "stop"), [(1.0, 3.0), (3.0, 1.0), (-1.0, -2.5)])
def test_waypoints_and_stop_are_hit_exactly_in_either_direction(start: float, stop: float) -> None:
    waypoints = [start + part * (stop - start) for part in (0.7, 1 / 3, 0.34, 1.0, 0.0)]
    met: list[Point] = []
    branch = natural().follow(
        line, start, stop, np.array([start]), waypoints=waypoints, on_point=met.append
    )
    assert branch.status is Status.CONVERGED
    assert set(waypoints) <= set(branch.parameters)
    assert branch.parameters[0] == start
    assert branch.parameters[-1] == stop
    travelled = [abs(p - start) for p in branch.parameters]
    steps = [b - a for a, b in itertools.pairwise(travelled)]
    assert min(steps) > 0.0
    assert max(steps) <= 0.4 * (1.0 + 1e-8)
    assert [point.parameter for point in met] == list(branch.parameters)
    assert [point.solution.x[0] for point in met] == pytest.approx(branch.parameters, rel=1e-9)


def test_the_start_may_have_a_corrector_of_its_own() -> None:
    """Five iterations are too few for a start that is far away, and enough for every step."""
    short, far = Newton(max_iterations=5), np.array([50.0])
    failed = Continuation(short, STEPS).follow(line, 1.0, 2.0, far)
    assert (failed.status, failed.points) == (Status.MAX_ITERATIONS, ())
    branch = Continuation(short, STEPS, starter=Newton()).follow(line, 1.0, 2.0, far)
    assert branch.converged
    assert branch.points[0].solution.iterations > 5
    assert max(point.solution.iterations for point in branch.points[1:]) <= 5


def test_the_last_two_steps_before_a_waypoint_are_equal() -> None:
    branch = natural(StepRule(0.3, 0.3, 0.3)).follow(line, 1.0, 2.0, np.ones(1))
    assert branch.parameters == pytest.approx((1.0, 1.3, 1.6, 1.8, 2.0))


def bend(p: float) -> Algebraic:
    """x^3 = q^3 with q = 1 + p + p^2, a path without curvature but in its own parabola."""
    q = 1.0 + p + p**2
    return Algebraic(lambda x: x**3 - q**3, lambda x: np.diag(3.0 * x**2))


def test_a_parabola_needs_no_iteration_on_a_path_that_is_one() -> None:
    def iterations(predictor: Predictor, path: Callable[[float], Algebraic]) -> list[int]:
        walk = Continuation(Newton(), StepRule(0.1, 0.1, 0.1), predictor)
        waypoints = [0.47, 0.85]  # steps of different lengths
        points = walk.follow(path, 0.0, 1.0, np.ones(1), waypoints=waypoints).points
        return [point.solution.iterations for point in points]

    assert max(iterations("parabola", bend)[3:]) <= 1  # rounding
    assert min(iterations("secant", bend)[1:]) >= 2
    assert iterations("parabola", bend)[:3] == iterations("secant", bend)[:3]
    assert sum(iterations("parabola", line)[3:]) <= sum(iterations("secant", line)[3:])


def test_a_walk_resumes_with_the_secant_of_its_previous_point() -> None:
    first = natural().follow(line, 1.0, 1.5, np.ones(1))
    before, last = first.points[-2:]
    resumed = natural().follow(
        line, last.parameter, 2.0, last.solution.x, previous=before, waypoints=[1.6]
    )
    assert resumed.converged
    assert [point.solution.iterations for point in resumed.points] == [0] * len(resumed.points)
    cold = natural().follow(line, last.parameter, 2.0, last.solution.x)
    assert cold.points[1].solution.iterations > 0


def test_a_step_too_long_is_cut_until_newton_converges() -> None:
    # arctan(x - 10 p): from the previous point Newton converges only if 10 step < 1.3917.
    def problem_at(p: float) -> Algebraic:
        return Algebraic(
            lambda x: np.arctan(x - 10.0 * p), lambda x: np.diag(1.0 / (1.0 + (x - 10.0 * p) ** 2))
        )

    walk = Continuation(Newton(), StepRule(1.0, 0.01), "previous", keep_all=True)
    branch = walk.follow(problem_at, 0.0, 1.0, np.zeros(1))
    assert branch.converged
    assert len(branch.failures) >= 3
    assert not any(point.solution.converged for point in branch.failures)
    assert max(b - a for a, b in itertools.pairwise(branch.parameters)) < 0.13917
    for point in branch.points:
        assert point.solution.x == pytest.approx([10.0 * point.parameter], abs=1e-9)
    attempts = [point.solution for point in (*branch.points, *branch.failures)]
    assert branch.iterations == sum(solution.iterations for solution in attempts)
    assert branch.factorisations == sum(solution.factorisations for solution in attempts)


def test_a_turning_path_ends_next_to_its_fold_and_says_where_that_is() -> None:
    walk = Continuation(Newton(), STEPS, name="load factor")
    branch = walk.follow(parabola, 0.0, 2.0, np.ones(1))
    assert branch.status is Status.TURNING_POINT
    found = re.search(r"at about load factor = (\S+);", branch.message)
    assert found
    assert float(found[1]) == pytest.approx(1.0, abs=STEPS.smallest)
    reached = branch.parameters[-1]
    assert 0.0 <= 1.0 - reached < 4.0 * STEPS.smallest
    assert branch.last.x == pytest.approx([math.sqrt(1.0 - reached)], abs=1e-7)
    assert f"reached load factor = {reached:.9g};" in branch.message
    assert branch.failures[-1].parameter > 1.0
    assert branch.failures[-1].solution.status.value in branch.message
    assert "arc length" in branch.status.advice
    with pytest.raises(NotConverged, match="load factor") as caught:
        branch.raise_for_status()
    assert caught.value.result is branch
    assert (branch.end.status, branch.end.message) == (branch.status, branch.message)


def blocked(status: Status) -> Callable[[float], Algebraic]:
    """x = p, which cannot be solved beyond p = 1."""

    def problem_at(p: float) -> Algebraic:
        def residual(x: Array) -> Array:
            return np.where((x != 0.0) & (p > 1.0) & (status is Status.NOT_FINITE), np.nan, x - p)

        slope = 0.0 if p > 1.0 and status is Status.SINGULAR else 1.0
        if p > 1.0 and status is Status.MAX_ITERATIONS:
            slope = -1.0
        return Algebraic(residual, lambda x: slope * np.eye(1))

    return problem_at


@pytest.mark.parametrize(
    ("failure", "end"),
    [
        (Status.SINGULAR, Status.SINGULAR),
        (Status.NOT_FINITE, Status.NOT_FINITE),
        (Status.MAX_ITERATIONS, Status.STEP_TOO_SMALL),
    ],
)
def test_a_path_that_ends_says_what_stands_there(failure: Status, end: Status) -> None:
    branch = natural(predictor="previous").follow(blocked(failure), 0.0, 2.0, np.zeros(1))
    assert branch.status is end
    assert 0.0 <= 1.0 - branch.parameters[-1] < 4.0 * STEPS.smallest
    assert branch.failures[-1].solution.status.value in branch.message


def test_a_step_that_rounding_swallows_ends_a_path() -> None:
    """At 1e12 numbers are 1.2e-4 apart."""
    far, tiny = 1e12, StepRule(0.1, 1e-9)
    path = Continuation(Newton(), tiny, "previous")

    def wall(p: float) -> Algebraic:
        return blocked(Status.MAX_ITERATIONS)(p - far)

    branch = path.follow(wall, far, far + 2.0, np.zeros(1))
    assert branch.status is Status.ROUNDING
    assert branch.parameters[-1] == pytest.approx(far + 1.0, abs=1e-3)


def test_the_predictor_stays_admissible() -> None:
    # log x = -p: the secant through p = 0 and 2 is negative at 4.
    tried: list[Algebraic] = []

    def positive(x: Array, dx: Array) -> float:
        return min(1.0, 0.9 * x[0] / -dx[0]) if dx[0] < 0.0 else 1.0

    def problem_at(p: float) -> Algebraic:
        tried.append(Algebraic(lambda x: np.log(x) + p, lambda x: np.diag(1.0 / x), positive))
        return tried[-1]

    branch = natural(StepRule(2.0, 0.5, 2.0)).follow(problem_at, 0.0, 6.0, np.ones(1))
    assert branch.parameters == (0.0, 2.0, 4.0, 6.0)
    secant = 2.0 * math.exp(-2.0) - 1.0
    assert secant < 0.0
    assert tried[2].visited[0] == pytest.approx([0.1 * math.exp(-2.0)])
    assert min(x[0] for problem in tried for x in problem.visited) > 0.0
    assert branch.last.x == pytest.approx([math.exp(-6.0)], rel=1e-8)


def test_start_equal_to_stop_is_one_point() -> None:
    branch = natural().follow(line, 2.0, 2.0, np.ones(1), waypoints=[2.0])
    assert (branch.parameters, branch.status) == ((2.0,), Status.CONVERGED)


@pytest.mark.parametrize("waypoint", [0.9, 2.1, math.nan])
def test_waypoints_out_of_range_are_rejected(waypoint: float) -> None:
    with pytest.raises(ValueError, match="outside"):
        natural().follow(line, 1.0, 2.0, np.ones(1), waypoints=[waypoint])


@pytest.mark.parametrize("stop", [math.inf, math.nan])
def test_ends_must_be_finite(stop: float) -> None:
    with pytest.raises(ValueError, match="finite"):
        natural().follow(line, 1.0, stop, np.ones(1))


# --- arc length ----------------------------------------------------------------------------------


def arc(**settings: Any) -> Arclength:
    defaults = Arclength(Newton(), StepRule(0.1, 1e-4, 0.3), keep_all=True)
    return replace(defaults, **settings)


def after_folds(count: int) -> Callable[[Branch], bool]:
    return lambda branch: len(branch.limit_points) == count


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_circle_is_followed_round_through_both_folds(direction: float) -> None:
    branch = arc().follow(circle, 0.0, np.ones(1), direction=direction, until=after_folds(2))
    assert branch.converged
    angles = [
        math.atan2(direction * point.parameter, point.solution.x[0]) for point in branch.points
    ]
    turned = np.unwrap(angles)
    assert (np.diff(turned) > 0.0).all()
    assert turned[-1] > 1.5 * math.pi
    for point in branch.points:
        assert point.parameter**2 + point.solution.x[0] ** 2 == pytest.approx(1.0, abs=2e-9)
    first, second = branch.limit_points
    assert [first.kind, second.kind] == ["maximum", "minimum"][:: int(direction)]
    assert first.located
    assert second.located
    assert [first.parameter, second.parameter] == pytest.approx([direction, -direction], abs=2e-9)
    assert [first.x[0], second.x[0]] == pytest.approx([0.0, 0.0], abs=2e-7)


def test_a_skew_flat_fold_is_located() -> None:
    # p = 1 - x^4 (1 - x): dp/dx vanishes with x^3, which one-sided false position hardly closes in.
    def problem_at(p: float) -> Algebraic:
        return Algebraic(
            lambda x: x**4 * (1.0 - x) + p - 1.0, lambda x: np.diag(4.0 * x**3 - 5.0 * x**4)
        )

    start = 1.0 - 0.6**4 * 0.4
    branch = arc().follow(problem_at, start, np.array([0.6]), until=after_folds(1))
    (fold,) = branch.limit_points
    assert fold.located
    assert fold.parameter == pytest.approx(1.0, abs=2e-9)
    assert fold.x == pytest.approx([0.0], abs=(1e-7 / 4.0) ** (1.0 / 3.0))


def test_walk_ends_exactly_on_the_bound_it_crosses() -> None:
    branch = arc().follow(circle, 0.0, np.ones(1), within=(-0.5, 2.0))
    assert branch.converged
    assert branch.parameters[-1] == -0.5
    assert branch.last.x == pytest.approx([-math.sqrt(0.75)], rel=1e-8)
    assert max(branch.parameters) <= 1.0 + 1e-9
    assert len(branch.limit_points) == 1


def bratu(inner: int) -> Callable[[float], Algebraic]:
    """-u'' = lambda exp u on (0, 1) by second differences on `inner` points."""
    A = (2 * np.eye(inner) - np.eye(inner, k=1) - np.eye(inner, k=-1)) * (inner + 1.0) ** 2
    return lambda p: Algebraic(
        lambda u: (A @ u - p * np.exp(u)) / 8.0, lambda u: (A - p * np.diag(np.exp(u))) / 8.0
    )


def test_bratu_fold_converges_with_second_order_to_the_closed_form() -> None:
    # u = 2 ln(cosh z / cosh((1 - 2 x) z)), lambda = 8 z^2 / cosh^2 z, largest where z tanh z = 1.
    z = brentq(lambda z: z * math.tanh(z) - 1.0, 1.0, 2.0, xtol=1e-15)
    exact, u_mid = 8.0 * (z / math.cosh(z)) ** 2, 2.0 * math.log(math.cosh(z))
    assert exact == pytest.approx(3.513830719, abs=1e-9)
    walk = arc(parameter_scale=3.0)
    folds, mids = [], []
    for inner in (15, 31, 63):
        branch = walk.follow(bratu(inner), 0.0, np.zeros(inner), until=after_folds(1))
        assert branch.converged
        (fold,) = branch.limit_points
        assert (fold.kind, fold.located) == ("maximum", True)
        folds.append(fold.parameter)
        mids.append(fold.x[inner // 2])
    errors = np.array(folds) - exact
    orders = np.log2(errors[:-1] / errors[1:])
    assert orders == pytest.approx([2.0, 2.0], abs=0.02)
    assert (4.0 * folds[2] - folds[1]) / 3.0 == pytest.approx(exact, abs=1e-6)
    assert (4.0 * mids[2] - mids[1]) / 3.0 == pytest.approx(u_mid, abs=1e-5)


HEIGHT = 0.3  # of the truss, over half its span 1; load in units of E A height^3 / length^3


def truss(p: float) -> Algebraic:
    """Two bars of a von Mises truss in Green strain: p = s (1 - s^2), s = 1 - w / height."""

    def force(w: Array) -> Array:
        s = 1.0 - w / HEIGHT
        return s * (1.0 - s**2)

    def stiffness(w: Array) -> Array:
        return np.diag((3.0 * (1.0 - w / HEIGHT) ** 2 - 1.0) / HEIGHT)

    return Algebraic(lambda w: force(w) - p, stiffness)


def test_von_mises_truss_snaps_through_at_its_closed_form_limit_loads() -> None:
    # dp/ds = 0 at s = +- 1/sqrt 3: p = +- 2 / (3 sqrt 3).
    limit = 2.0 / (3.0 * math.sqrt(3.0))
    walk = arc(x_scale=HEIGHT, parameter_scale=limit)
    branch = walk.follow(truss, 0.0, np.zeros(1), within=(-2.0, 0.75))
    assert branch.converged
    up, down = branch.limit_points
    assert [up.kind, down.kind] == ["maximum", "minimum"]
    assert [up.parameter, down.parameter] == pytest.approx([limit, -limit], rel=1e-8)
    sway = HEIGHT / math.sqrt(3.0)
    assert [up.x[0], down.x[0]] == pytest.approx([HEIGHT - sway, HEIGHT + sway], rel=1e-6)
    assert branch.parameters[-1] == 0.75
    s = 1.0 - branch.last.x[0] / HEIGHT
    assert s < -1.0  # snapped through and in tension
    assert s * (1.0 - s**2) == pytest.approx(0.75, abs=1e-8)
    deflections = [point.solution.x[0] for point in branch.points]
    assert (np.diff(deflections) > 0.0).all()


def quadratic_order(derivative: Callable[[float, Array], Array] | None) -> float:
    """Exponent of the last residual norms of the longest corrector on the Bratu path."""
    walk = arc(parameter_scale=3.0, steps=StepRule(0.6, 0.6, 0.6), turn=60.0, max_points=3)
    branch = walk.follow(bratu(15), 0.0, np.zeros(15), derivative=derivative)
    norms = branch.points[1].solution.residual_norms
    a, b, c = [norm for norm in norms if norm > 1e-12][-3:]
    return math.log(c / b) / math.log(b / a)


def test_corrector_is_quadratic_only_with_the_right_parameter_derivative() -> None:
    assert quadratic_order(lambda p, u: -np.exp(u) / 8.0) == pytest.approx(2.0, abs=0.3)
    assert quadratic_order(None) == pytest.approx(2.0, abs=0.3)
    assert quadratic_order(lambda p, u: -1.1 * np.exp(u) / 8.0) == pytest.approx(1.0, abs=0.2)


def test_start_on_a_limit_point_is_singular() -> None:
    branch = arc().follow(circle, 1.0, np.zeros(1))
    assert branch.status is Status.SINGULAR
    assert branch.points == ()
    assert "no tangent" in branch.message


def test_start_out_of_bounds_is_rejected() -> None:
    with pytest.raises(ValueError, match="outside"):
        arc().follow(circle, 0.0, np.ones(1), within=(0.5, 1.0))


# --- Paths by arc length over a study: limit points of a shallow truss, refusals, what was --------


RISE = 0.2


@cache
def shallow_truss() -> Definition:
    """A node that moves by w between two shallow bars: W = k / 2 (w^2 / 2 - H w)^2."""
    m = Model("truss", nodes=1, rule=quadrature.point_rule())
    ((w,),) = m.nodal_unknowns("w")
    k, H = m.parameters(k="stiffness", H="height")
    m.potential(k / 2 * (w**2 / 2 - H * w) ** 2)
    return m.finish()


def shallow(k: float = 100.0) -> Study:
    study = Study(Mesh.line(1.0, cells=1))
    study.add("truss", shallow_truss(), on=lambda x: x[:, 0] == 0.0, k=k, H=RISE)
    study.load((0.0,), w=1.0)
    return study


def test_a_truss_snaps_through() -> None:
    """t = k w (w / 2 - H) (w - H) turns at w = H (1 -+ 1 / sqrt 3)."""
    study = shallow()
    path = study.follow(step=0.01, until=lambda r: r.values("w")[0] > 2.1 * RISE)
    w = np.array([r.values("w")[0] for r in path.results])
    t = np.array([r.t for r in path.results])
    np.testing.assert_allclose(t, 100.0 * w * (w / 2 - RISE) * (w - RISE), atol=1e-9)
    assert [limit.kind for limit in path.limits] == ["maximum", "minimum"]
    turn = 100.0 * RISE**3 / (3 * np.sqrt(3))
    found = [limit.t for limit in path.limits]
    np.testing.assert_allclose(found, [turn, -turn], rtol=1e-9)
    places = [limit.x[0] / RISE for limit in path.limits]
    np.testing.assert_allclose(places, [1 - 1 / np.sqrt(3), 1 + 1 / np.sqrt(3)], rtol=1e-5)
    assert not np.allclose(found, [1.001 * turn, -turn], rtol=1e-4), "the oracle can fail"


@cache
def link() -> Definition:
    """A spring between two nodes."""
    m = Model("link", nodes=2, rule=quadrature.point_rule())
    ((a, b),) = m.nodal_unknowns("w")
    (c,) = m.parameters(c="stiffness")
    m.potential(c / 2 * (b - a) ** 2)
    return m.finish()


SOFT = 0.5  # of the spring in series: the truss, k (3 w^2 / 2 - 3 H w + H^2), falls to -2
EVEN = 0.3  # of the load at the truss beside the moving end


def in_series(driven: str) -> Study:
    """The truss behind a spring, driven at the other end of the spring."""
    study = Study(Mesh.line(2.0, cells=2))
    study.add("truss", shallow_truss(), on=lambda x: x[:, 0] == 0.0, k=100.0, H=RISE)
    study.add("spring", link(), on=[[0, 1]], c=SOFT)
    study.add("anchor", link(), on=[[1, 2]], c=0.0)
    study.fix((2.0,), w=0.0)
    if driven == "force":
        study.load((1.0,), w=1.0)
    elif driven == "tie":
        study.tie((1.0,), (2.0,), "w", offset=lambda x, t: t)
    else:
        study.fix((1.0,), w=1.0)
    if driven == "both":
        study.load((0.0,), w=EVEN)
    return study


@pytest.mark.parametrize(
    ("driven", "step"),
    [
        *(("force", 0.2), ("fix", 10.0), ("tie", 0.2)),
        pytest.param("both", 10.0, marks=pytest.mark.slow),
    ],
)
def test_a_snap_back_is_followed_however_it_is_driven(driven: str, step: float) -> None:
    """The end is at t = w + F / c, which turns where F' = -c: at w = H (1 -+ 1/2)."""
    path = in_series(driven).follow(step=step, until=lambda r: r.values("w")[0] > 0.42)
    w = np.array([r.values("w")[0] for r in path.results])
    t = np.array([r.t for r in path.results])
    force = 100.0 * w * (w / 2 - RISE) * (w - RISE)
    theory = {"force": force, "both": (SOFT * w + force) / (SOFT + EVEN)}
    np.testing.assert_allclose(t, theory.get(driven, w + force / SOFT), atol=2e-9)
    assert (np.diff(w) > 0.0).all()
    found = [limit.t for limit in path.limits]
    turn = 100.0 * RISE**3 / (3 * np.sqrt(3))
    limits = {"force": (turn, -turn), "both": (0.25, 0.0)}
    np.testing.assert_allclose(found, limits.get(driven, (0.4, 0.0)), atol=2e-9)


def test_a_path_along_which_a_spring_closes_a_gap() -> None:
    """A corner of 72 degrees, at which no step is short enough to be smooth."""
    m = Model("corner", nodes=1, rule=quadrature.point_rule())
    ((w,),) = m.nodal_unknowns("w")
    m.weak_form([(sp.Piecewise((w, w < 1), (sp.Rational(3, 2) - w / 2, True)), w)])
    study = Study(Mesh.line(1.0, cells=1))
    study.add("corner", m.finish(), on=lambda x: x[:, 0] == 0.0)
    study.load((0.0,), w=1.0)
    path = study.follow(step=0.5, until=lambda r: r.values("w")[0] > 2.0)
    (limit,) = path.limits
    assert limit.t == pytest.approx(1.0, abs=1e-3)
    assert not limit.located


def test_what_is_refused() -> None:
    for step in (0.0, -1.0, float("nan")):
        with pytest.raises(StudyError, match=r"must be (positive|finite)"):
            shallow().follow(step=step, until=lambda r: True)
    for linear in ("amg", "matrix-free"):
        with pytest.raises(StudyError, match=f'no linear = "{linear}", it factorises'):
            shallow().follow(step=0.1, until=lambda r: True, linear=linear)


def test_history_is_committed_along_the_path() -> None:
    """A bar that counts its steps: each accepted point adds one, trials add none."""
    m = Model("counter", nodes=1, rule=quadrature.point_rule())
    ((u,),) = m.nodal_unknowns("u")
    (t,) = m.parameters(t="load factor")
    (n,) = m.point_data(n="points so far")
    m.weak_form([(u + u**3 - t, u)])
    m.fields(count=n)
    m.history(n=n + 1)
    study = Study(Mesh.line(1.0, cells=1))
    study.add("counter", m.finish(), on=lambda x: x[:, 0] == 0.0, t=lambda t: t)
    path = study.follow(step=0.2, until=lambda r: r.t > 1.0)
    last = path.results[-1]
    assert last.histories["counter"][0, 0, 0] == len(path.results)


# --- Bifurcations of paths: found, located, and followed to the other branch ----------------------


K = 3.0


@cache
def rigid_link() -> Definition:
    """A rigid link of length 1 on a torsional spring, pressed along its axis by P."""
    m = Model("link", nodes=1, rule=quadrature.point_rule())
    ((q,),) = m.nodal_unknowns("q")
    k, P = m.parameters(k="stiffness", P="force")
    m.potential(k / 2 * q**2 - P * (1 - sp.cos(q)))
    return m.finish()


def column() -> Study:
    study = Study(Mesh.line(1.0, cells=1))
    study.add("link", rigid_link(), on=lambda x: x[:, 0] == 0.0, k=K, P=lambda t: t)
    return study


def far(result: Any) -> bool:
    return bool(abs(result.values("q")[0]) > 1.0)


def test_a_link_buckles_to_both_sides() -> None:
    """P = k q / sin q on the other branch."""
    study = column()
    straight = study.follow(step=0.7, until=lambda r: r.t > 5.0, detect="bifurcation")
    (found,) = straight.bifurcations
    assert found.located
    assert found.directions == 1
    assert found.t == pytest.approx(K, rel=1e-9)
    for start, side in ((found, 1.0), (found.reversed, -1.0)):
        path = study.follow(start=start, step=0.1, until=far)
        q = np.array([r.values("q")[0] for r in path.results[1:]])
        t = np.array([r.t for r in path.results[1:]])
        assert (q * side > 0.0).all()
        np.testing.assert_allclose(t, K * q / np.sin(q), rtol=1e-9)
        assert path.results[-1].unstable == 0
    assert straight.results[-1].unstable == 1


def resting() -> Study:
    """A block that lies on another one, which nothing else holds."""
    lower = Mesh.rectangle(1, 1, cells=(2, 2))
    study = Study(Mesh.union(lower=lower, upper=lower.map(lambda x: np.add(x, [0, 1]))))
    study.add("body", elastic, mu=1.0, K=5.0)
    study.contact("upper:bottom", "lower:top", friction=0.3)
    study.fix("lower:bottom", u_x=0, u_y=0)
    study.load("upper:top", u_y=-0.05)
    return study


def test_a_path_that_cannot_see_bifurcations_says_so() -> None:
    with pytest.warns(MissedBifurcations, match="no symmetric, regular tangent at load factor"):
        path = resting().follow(step=0.5, until=lambda r: r.t > 1.0, detect="bifurcation")
    assert path.results[-1].unstable is None


def test_a_limit_point_is_no_bifurcation() -> None:
    path = shallow().follow(
        step=0.01, until=lambda r: r.values("w")[0] > 0.42, detect="bifurcation"
    )
    assert len(path.limits) == 2
    assert path.bifurcations == ()
    assert {r.unstable for r in path.results} == {0, 1}


def test_a_column_becomes_an_elastica() -> None:
    """Euler's curve, by elliptic integrals of half the angle at the end."""
    length, height, young = 100.0, 1.0, 2000.0
    study = Study(Mesh.rectangle(length, height, cells=(25, 1), order=2))
    study.add("body", rubber, mu=young / 2, lame=0.0)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_x=-1.0 / height)
    euler = np.pi**2 * young * height**3 / 12 / (4 * length**2)
    straight = study.follow(
        step=0.3 * euler, until=lambda r: r.t > 1.5 * euler, detect="bifurcation"
    )
    (found,) = straight.bifurcations
    assert found.t == pytest.approx(euler, rel=1e-3)
    tip = (length, height / 2)
    path = study.follow(start=found, step=0.05, until=lambda r: abs(r.at(tip)["u_y"]) > 60.0)
    assert len(path.results) > 5
    for result in path.results[1:]:
        angle = turned(result, length, height)
        k = np.sin(angle / 2)
        load = (2 * ellipk(k**2) / np.pi) ** 2 * euler
        assert result.t == pytest.approx(load, rel=3e-3)
        assert abs(result.at(tip)["u_y"]) == pytest.approx(2 * k / ellipk(k**2) * length, rel=5e-3)
        shortened = length * (2 - 2 * ellipe(k**2) / ellipk(k**2))
        assert -result.at(tip)["u_x"] == pytest.approx(shortened, rel=1e-2, abs=5e-3)
    assert path.results[-1].unstable == 0


def turned(result: Any, length: float, height: float) -> float:
    """Angle of the section at the end."""
    top, bottom = (result.at((length, y)) for y in (height, 0.0))
    return float(np.arcsin(abs(top["u_x"] - bottom["u_x"]) / height))


def test_bifurcations_that_are_refused() -> None:
    study = column()
    with pytest.raises(StudyError, match=r"detect = 'bifurcations': allowed are"):
        study.follow(step=0.5, until=lambda r: True, detect="bifurcations")  # type: ignore[arg-type]


def test_what_is_nearly_singular_is_looked_for_with_contact() -> None:
    result = resting().solve()
    sought = result.system.problem(result.system.quasi_static_step(1.0, result.x, {}))
    found = critical_point(sought, 1.0, result.x)
    assert abs(found.value) > 1e-3  # without contact the block is free
    assert found.value == pytest.approx(critical_point(sought.at(result.x), 1.0, result.x).value)
