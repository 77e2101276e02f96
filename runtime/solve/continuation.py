"""Following a solution path: predictor, corrector, step rule, events.

`Continuation` steps a natural parameter and reads Newton's status to choose the step; `Arclength`
also passes limit points, where the parameter turns back (Keller's pseudo-arclength).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

import numpy as np
from scipy.sparse import csc_array, hstack, vstack

from softehl.runtime.arrays import Array
from softehl.runtime.solve.linear import LinearSolver, SingularMatrix, SparseMatrix
from softehl.runtime.solve.newton import Corrector, Newton, NonlinearProblem
from softehl.runtime.solve.solution import Branch, LimitPoint, Point, Solution, Status

__all__ = ["Arclength", "Branch", "Continuation", "LimitPoint", "Point", "StepRule"]

ProblemAt: TypeAlias = Callable[[float], NonlinearProblem]
Derivative: TypeAlias = Callable[[float, Array], Array]
OnPoint: TypeAlias = Callable[[Point], object]
Predictor: TypeAlias = Literal["secant", "parabola", "previous"]

_LONGEST_EXTRAPOLATION = 10.0  # a secant prolonged further mostly amplifies its own error
_PARABOLA = 2.5  # the same for a parabola, in lengths of the shorter chord
_FOLD_ITERATIONS = 20
_ROUNDING = 1e-9  # a step this close to a waypoint, relatively, goes there


@dataclass(frozen=True)
class StepRule:
    """Step control by iteration count; lengths > 0, in units of the parameter or arc length.

    first: length of the first step; smallest: a failed step is not cut below it;
    largest: no step is longer; growth: largest ratio of successive steps;
    cut: factor after a failure (its square after a wild one), and least ratio after a success;
    target_iterations: Newton iterations at which the step stays as it is.
    """

    first: float
    smallest: float
    largest: float = math.inf
    growth: float = 2.0
    cut: float = 0.5
    target_iterations: int = 6

    def __post_init__(self) -> None:
        """Raise ValueError unless 0 < smallest <= first <= largest and the factors make sense."""
        if not 0.0 < self.smallest <= self.first <= self.largest:
            raise ValueError(f"need 0 < smallest <= first <= largest, got {self}")
        if not (0.0 < self.cut < 1.0 <= self.growth and self.target_iterations >= 1):
            raise ValueError(f"need 0 < cut < 1 <= growth and target_iterations >= 1, got {self}")

    def after_success(self, step: float, taken: float, iterations: int) -> float:
        """Next step when `taken`, possibly shortened from `step` by a waypoint, has converged."""
        factor = self.target_iterations / max(iterations, 1)
        proposal = taken * min(max(factor, self.cut), self.growth)
        if iterations <= self.target_iterations:
            proposal = max(proposal, step)  # a waypoint's short step says nothing against `step`
        return min(max(proposal, self.smallest), self.largest)

    def after_failure(self, taken: float, status: Status) -> float:
        """Next step when `taken` has failed; it may come out below `smallest`: then give up."""
        wild = status in (Status.DIVERGED, Status.NOT_FINITE)
        return taken * (self.cut**2 if wild else self.cut)


@dataclass
class _Log:
    """What a walk has met so far; turned into a frozen Branch at its end."""

    name: str
    keep_all: bool
    on_point: OnPoint | None
    points: list[Point] = field(default_factory=list)
    failures: list[Point] = field(default_factory=list)
    limit_points: list[LimitPoint] = field(default_factory=list)
    factorisations: int = 0
    iterations: int = 0

    def count(self, solution: Solution) -> Solution:
        """Add up the cost of a solve, converged or not, and pass it through."""
        self.factorisations += solution.factorisations
        self.iterations += solution.iterations
        return solution

    def count_trial(self, trial: _Trial) -> _Trial:
        self.count(trial.solution)
        return trial

    def accept(self, parameter: float, solution: Solution) -> Point:
        """Append a converged point, forget the x of the last but two, tell the caller."""
        point = Point(parameter, solution)
        self.points.append(point)
        if len(self.points) > 2 and not self.keep_all:
            old = self.points[-3]
            self.points[-3] = replace(old, solution=old.solution.forget())
        if self.on_point is not None:
            self.on_point(point)
        return point

    def refuse(self, parameter: float, solution: Solution) -> None:
        self.failures.append(Point(parameter, solution.forget()))

    def branch(self, status: Status, message: str) -> Branch:
        return Branch(
            points=tuple(self.points),
            status=status,
            message=message,
            factorisations=self.factorisations,
            iterations=self.iterations,
            failures=tuple(self.failures),
            limit_points=tuple(self.limit_points),
        )

    def no_start(self, start: float, solution: Solution) -> Branch:
        self.refuse(start, solution)
        message = f"no solution at the start, {self.name} = {start:.9g}: {solution.message}"
        return self.branch(solution.status, message)

    def too_small(self, step: float, smallest: float) -> Branch:
        """The walk ends because the last failure asks for a step below `smallest`."""
        reached, failed = self.points[-1].parameter, self.failures[-1]
        message = (
            f"reached {self.name} = {reached:.9g}; the next step would be {step:.2g}, smaller than "
            f"{smallest:.2g}; last attempt, at {failed.parameter:.9g}: "
            f"{failed.solution.status.value} ({failed.solution.message})"
        )
        return self.branch(Status.STEP_TOO_SMALL, message)


@dataclass(frozen=True)
class Continuation:
    """Natural-parameter continuation with an adaptive step.

    newton: the corrector; steps: the step rule, lengths in units of the parameter (which the
    caller may have transformed, for instance to log U); predictor: "secant" through the last two
    points, "parabola" through the last three (the secant until there are three), or "previous"
    point; keep_all: keep x at every point, not just the last two;
    name: what messages call the parameter; starter: the corrector of the start, which has no
    predictor and may deserve more iterations than a step that is better cut (None: the same).
    """

    newton: Corrector
    steps: StepRule
    predictor: Predictor = "secant"
    keep_all: bool = False
    name: str = "parameter"
    starter: Corrector | None = None

    def follow(
        self,
        problem_at: ProblemAt,
        start: float,
        stop: float,
        x0: Array,
        *,
        waypoints: Iterable[float] = (),
        on_point: OnPoint | None = None,
        previous: Point | None = None,
    ) -> Branch:
        """Solve problem_at(parameter) from start to stop, either of which may be the larger.

        x0: (n,) guess at start. waypoints: parameters in [start, stop], any order, hit exactly
        (as stop is). on_point: called after each converged point. previous: a converged point
        before start, from which the first secant is drawn when a walk is resumed. Raises
        ValueError for waypoints that are out of range or not finite.
        """
        goals = _goals(start, stop, waypoints)
        log = _Log(self.name, self.keep_all, on_point)
        solution = log.count((self.starter or self.newton).solve(problem_at(start), x0))
        if not solution.converged:
            return log.no_start(start, solution)
        here, step = log.accept(start, solution), self.steps.first
        behind = [] if previous is None else [previous]
        while goals:
            parameter = _approach(here.parameter, goals[0], step)
            taken = abs(parameter - here.parameter)
            solution = self._correct(problem_at(parameter), parameter, [here, *behind])
            log.count(solution)
            if solution.converged:
                behind, here = [here, *behind[:1]], log.accept(parameter, solution)
                goals = goals[1:] if parameter == goals[0] else goals
                step = self.steps.after_success(step, taken, solution.iterations)
                continue
            log.refuse(parameter, solution)
            step = self.steps.after_failure(taken, solution.status)
            if step < self.steps.smallest or here.parameter + step == here.parameter:
                return log.too_small(step, self.steps.smallest)
        return log.branch(Status.CONVERGED, f"reached {self.name} = {stop:.9g}")

    def _correct(
        self, problem: NonlinearProblem, parameter: float, known: Sequence[Point]
    ) -> Solution:
        """Predict at `parameter` from the known points, last first, no further than the problem
        admits, and correct.
        """
        x = known[0].solution.x
        count = {"previous": 1, "secant": 2, "parabola": 3}[self.predictor]
        dx = _extrapolated(known[:count], parameter)
        return self.newton.solve(problem, x + _admissible(problem, x, dx) * dx)


def _extrapolated(known: Sequence[Point], parameter: float) -> Array:
    """Change (n,) from the first of the points to `parameter`, on the polynomial through them all;
    on that of fewer points where it goes further beyond them than they are apart.
    """
    here, others = known[0], known[1:]
    t = parameter - here.parameter
    distances = [point.parameter - here.parameter for point in others]
    if len(set(distances)) < len(distances) or 0.0 in distances:
        return np.zeros_like(here.solution.x)
    if len(others) == 2 and abs(t) > _PARABOLA * min(abs(d) for d in distances):
        return _extrapolated(known[:2], parameter)
    if len(others) == 1:
        t = math.copysign(min(abs(t), _LONGEST_EXTRAPOLATION * abs(distances[0])), t)
    dx = np.zeros_like(here.solution.x)
    for point, d in zip(others, distances, strict=True):
        rest = math.prod((t - e) / (d - e) for e in distances if e != d)
        dx += (t / d) * rest * (point.solution.x - here.solution.x)
    return dx


def _goals(start: float, stop: float, waypoints: Iterable[float]) -> list[float]:
    """Waypoints and stop in the order of travel, each once, without start."""
    if not (math.isfinite(start) and math.isfinite(stop)):
        raise ValueError(f"start and stop must be finite, got {start} and {stop}")
    goals = {float(waypoint) for waypoint in waypoints} | {float(stop)}
    low, high = min(start, stop), max(start, stop)
    outside = sorted(goal for goal in goals if not low <= goal <= high)
    if outside:
        raise ValueError(f"waypoints {outside} lie outside [{low}, {high}]")
    return sorted(goals - {float(start)}, reverse=stop < start)


def _approach(here: float, goal: float, step: float) -> float:
    """Next parameter: the goal itself within a step, half-way within two (no sliver remains)."""
    remaining = abs(goal - here)
    if remaining <= step * (1.0 + _ROUNDING):
        return goal
    return here + math.copysign(min(step, 0.5 * remaining), goal - here)


def _admissible(problem: NonlinearProblem, x: Array, dx: Array) -> float:
    """Fraction of a predictor that the problem admits; 0 if it admits none."""
    fraction = problem.step_limit(x, dx)
    return min(1.0, fraction) if fraction > 0.0 else 0.0


@dataclass(frozen=True, eq=False)
class _Trial:
    """A point of arc-length continuation, accepted or refused; t: unit tangent, shape (n + 1,)."""

    parameter: float
    solution: Solution
    t: Array = field(default_factory=lambda: np.empty(0))

    @property
    def y(self) -> Array:
        return np.append(self.solution.x, self.parameter)

    def refuse(self, status: Status, message: str) -> _Trial:
        return replace(self, solution=replace(self.solution, status=status, message=message))


@dataclass(frozen=True, eq=False)
class _Path:
    """The curve R(x, parameter) = 0 in the space of y = (x, parameter), with a metric."""

    problem_at: ProblemAt
    derivative: Derivative | None
    x_scale: float
    parameter_scale: float
    difference: float

    def weigh(self, t: Array) -> Array:
        """Covector of t: weigh(t) @ y is the scalar product of the metric."""
        weights = np.full(t.size, 1.0 / ((t.size - 1) * self.x_scale**2))
        weights[-1] = self.parameter_scale**-2
        return weights * t

    def parameter_derivative(self, y: Array) -> Array:
        """dR/dparameter at y, shape (n,); a central difference unless a derivative is given."""
        x, parameter = y[:-1], float(y[-1])
        if self.derivative is not None:
            return self.derivative(parameter, x)
        h = self.difference * max(abs(parameter), self.parameter_scale)
        ahead = self.problem_at(parameter + h).residual(x)
        behind = self.problem_at(parameter - h).residual(x)
        return (ahead - behind) / (2.0 * h)

    def bordered(self, y: Array, row: Array) -> tuple[Array, SparseMatrix]:
        """R at y, and [[dR/dx, dR/dparameter], [row]], regular at a simple limit point."""
        r, K = self.problem_at(float(y[-1])).linearise(y[:-1])
        column = self.parameter_derivative(y)[:, None]
        upper = hstack([csc_array(K), csc_array(column)])
        return r, vstack([upper, csc_array(row[None, :])], format="csc")

    def tangent(self, y: Array, along: Array, linear: LinearSolver) -> Array:
        """Unit tangent at y on the side of the covector `along`; may raise SingularMatrix."""
        _, matrix = self.bordered(y, along)
        unit = np.zeros(y.size)
        unit[-1] = 1.0
        t = linear.factorise(matrix).solve(unit)
        return t / math.sqrt(float(self.weigh(t) @ t))


@dataclass(frozen=True, eq=False)
class _Corrector:
    """NonlinearProblem in y: R = 0 on the plane `length` along the unit tangent t at `base`."""

    path: _Path
    base: Array
    covector: Array
    length: float

    def _plane(self, y: Array) -> Array:
        return np.array([self.covector @ (y - self.base) / self.length - 1.0])

    def _problem(self, y: Array) -> NonlinearProblem:
        return self.path.problem_at(float(y[-1]))

    def residual(self, y: Array) -> Array:
        return np.concatenate([self._problem(y).residual(y[:-1]), self._plane(y)])

    def linearise(self, y: Array) -> tuple[Array, SparseMatrix]:
        r, matrix = self.path.bordered(y, self.covector / self.length)
        return np.concatenate([r, self._plane(y)]), matrix

    def norm(self, r: Array) -> float:
        problem = self._problem(self.base)
        return max(problem.norm(r[:-1]), abs(float(r[-1])))

    def step_limit(self, y: Array, dy: Array) -> float:
        return self._problem(y).step_limit(y[:-1], dy[:-1])


@dataclass(frozen=True)
class Arclength:
    """Pseudo-arclength continuation, which passes limit points and reports them.

    newton: corrector on the plane normal to the tangent; steps: step rule, lengths in the metric
    |dy|^2 = |dx|^2 / (n x_scale^2) + (dparameter / parameter_scale)^2;
    turn: largest angle between successive tangents [degrees]; a sharper turn (often a jump to
    another branch, or two folds in one step) is refused and the step cut;
    difference: relative step of the central difference for dR/dparameter, about eps^(1/3);
    fold_tolerance: parameter component of the unit tangent at which a fold counts as located
    (the error of its parameter is of second order in this);
    max_points, keep_all, name: as for Continuation.
    """

    newton: Newton
    steps: StepRule
    x_scale: float = 1.0
    parameter_scale: float = 1.0
    turn: float = 30.0
    difference: float = 6e-6
    fold_tolerance: float = 1e-7
    max_points: int = 1000
    keep_all: bool = False
    name: str = "parameter"

    def follow(
        self,
        problem_at: ProblemAt,
        start: float,
        x0: Array,
        *,
        direction: float = 1.0,
        within: tuple[float, float] = (-math.inf, math.inf),
        until: Callable[[Branch], bool] | None = None,
        derivative: Derivative | None = None,
        on_point: OnPoint | None = None,
    ) -> Branch:
        """Follow the path through the solution at `start`, x0 of shape (n,) being the guess.

        direction: sign of the first change of the parameter. derivative(parameter, x): dR/dp,
        shape (n,). on_point: called after each converged point. Start must not be a limit point.
        The walk ends CONVERGED where the parameter leaves `within` (the last point lies exactly
        on the bound) or when `until` is true of the branch so far; MAX_ITERATIONS at max_points,
        unless no other end was asked for. Raises ValueError if start is not within.
        """
        if not within[0] <= start <= within[1]:
            raise ValueError(f"start {start} lies outside {within}")
        path = _Path(problem_at, derivative, self.x_scale, self.parameter_scale, self.difference)
        log = _Log(self.name, self.keep_all, on_point)
        here, step = log.count_trial(self._start(path, start, x0, direction)), self.steps.first
        if not here.solution.converged:
            return log.no_start(start, here.solution)
        log.accept(here.parameter, here.solution)
        while len(log.points) < self.max_points:
            trial = log.count_trial(self._trial(path, here, step))
            leaving = trial.solution.converged and not within[0] <= trial.parameter <= within[1]
            if leaving:
                trial = log.count_trial(self._leave(path, here, trial, within))
            if not trial.solution.converged:
                log.refuse(trial.parameter, trial.solution)
                step = self.steps.after_failure(step, trial.solution.status)
                if step < self.steps.smallest:
                    return log.too_small(step, self.steps.smallest)
                continue
            if not leaving and _turns(here, trial):
                log.limit_points.append(self._locate(path, log, (here, trial), step))
            log.accept(trial.parameter, trial.solution)
            if leaving or (until is not None and until(log.branch(Status.CONVERGED, ""))):
                return log.branch(Status.CONVERGED, f"reached {self.name} = {trial.parameter:.9g}")
            here, step = trial, self.steps.after_success(step, step, trial.solution.iterations)
        endless = until is None and math.isinf(within[0]) and math.isinf(within[1])
        status = Status.CONVERGED if endless else Status.MAX_ITERATIONS
        message = f"{self.max_points} points, the last at {self.name} = {here.parameter:.9g}"
        return log.branch(status, message)

    def _start(self, path: _Path, start: float, x0: Array, direction: float) -> _Trial:
        """Solve at `start` and find the tangent on which the parameter changes as asked."""
        trial = _Trial(start, self.newton.solve(path.problem_at(start), x0))
        along = np.zeros(trial.y.size)
        along[-1] = math.copysign(1.0 / self.parameter_scale, direction)
        return self._with_tangent(path, trial, along, cosine=0.0)

    def _trial(self, path: _Path, here: _Trial, length: float) -> _Trial:
        """Predict along the tangent, no further than the problem admits, and correct."""
        corrector = _Corrector(path, here.y, path.weigh(here.t), length)
        dy = length * here.t
        end = self.newton.solve(corrector, here.y + _admissible(corrector, here.y, dy) * dy)
        trial = _Trial(float(end.x[-1]), replace(end, x=end.x[:-1]))
        cosine = math.cos(math.radians(self.turn))
        return self._with_tangent(path, trial, corrector.covector, cosine)

    def _with_tangent(self, path: _Path, trial: _Trial, along: Array, cosine: float) -> _Trial:
        """The trial with its tangent; refused if there is none or it turns away from `along`."""
        if not trial.solution.converged:
            return trial
        count = trial.solution.factorisations + 1
        try:
            t = path.tangent(trial.y, along, self.newton.linear)
        except SingularMatrix as error:
            refused = trial.refuse(Status.SINGULAR, f"no tangent of the path: {error}")
            return replace(refused, solution=replace(refused.solution, factorisations=count))
        trial = replace(trial, solution=replace(trial.solution, factorisations=count), t=t)
        if along @ t < cosine:
            angle = math.degrees(math.acos(float(along @ t)))
            return trial.refuse(Status.DIVERGED, f"the path turned by {angle:.0f} degrees")
        return trial

    def _leave(
        self, path: _Path, here: _Trial, trial: _Trial, within: tuple[float, float]
    ) -> _Trial:
        """The point on the bound that the path crosses between `here` and `trial`."""
        if _turns(here, trial):
            return trial.refuse(Status.DIVERGED, "a limit point and the bound within one step")
        bound = within[0] if trial.parameter < within[0] else within[1]
        part = (bound - here.parameter) / (trial.parameter - here.parameter)
        guess = here.y + part * (trial.y - here.y)
        return _Trial(bound, self.newton.solve(path.problem_at(bound), guess[:-1]))

    def _locate(
        self, path: _Path, log: _Log, ends: tuple[_Trial, _Trial], step: float
    ) -> LimitPoint:
        """The fold between the ends, where the tangent has no parameter component (Illinois)."""
        here, there = ends
        kind, index = "maximum" if here.t[-1] > 0.0 else "minimum", len(log.points)
        a, slope_a, b, slope_b = 0.0, float(here.t[-1]), step, float(there.t[-1])
        near = min(ends, key=lambda end: abs(end.t[-1]))
        for _ in range(_FOLD_ITERATIONS):
            if abs(near.t[-1]) <= self.fold_tolerance * self.parameter_scale:
                return LimitPoint(near.parameter, near.solution.x, kind, index, located=True)
            c = b - slope_b * (b - a) / (slope_b - slope_a)
            trial = log.count_trial(self._trial(path, here, c))
            if not trial.solution.converged:
                break
            slope = float(trial.t[-1])
            if slope * slope_b < 0.0:
                a, slope_a = b, slope_b
            else:
                slope_a *= 0.5
            b, slope_b, near = c, slope, trial
        return LimitPoint(near.parameter, near.solution.x, kind, index, located=False)


def _turns(here: _Trial, there: _Trial) -> bool:
    """True if the parameter changes direction between the two points."""
    return bool(here.t[-1] != 0.0 and here.t[-1] * there.t[-1] <= 0.0)
