"""Continuation of a solution path: predict, correct, choose the next step, end with a reason.

There is one driver, `path_points`. A `Stepper` makes the steps: by the parameter of the path
(`Continuation`), by its arc length where the parameter turns back (`solve.arclength`), by time
(`analyses.time_stepping`). Predictors extrapolate the last points, `StepRule` controls the step,
`PathLog` logs the path and the reason of its end. A corrector is Newton's method, a relative, or a
`Ladder` of them: it escalates within a step, continuation shortens the step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, Protocol, Self, TypeAlias

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.solve.newton import Corrector, NonlinearProblem
from softehl.runtime.solve.solution import Branch, LimitPoint, Point, Solution, Status

_ROUNDING = 1e-9  # a step this close to a waypoint, relatively, goes there


@dataclass(frozen=True)
class StepRule:
    """Step control by the number of iterations.

    Parameters
    ----------
    first : float
        Length of the first step, in units of the parameter or arc length.
    smallest : float
        A failed step is not cut below it.
    largest : float
        Length of the longest step.
    growth : float
        Largest ratio of successive steps.
    cut : float
        Factor after a failure, its square after a divergence, and least ratio after a success.
    target_iterations : int
        Newton iterations at which the step keeps its length.

    Raises
    ------
    ValueError
        Not 0 < smallest <= first <= largest, or a factor is not allowed.
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

    def scaled(self, unit: float) -> StepRule:
        """Return the rule with its lengths in another unit.

        Parameters
        ----------
        unit : float
            Length of the present unit in the new one.

        Returns
        -------
        StepRule
            The rule.
        """
        first, smallest, largest = (unit * a for a in (self.first, self.smallest, self.largest))
        return replace(self, first=first, smallest=smallest, largest=largest)

    def after_success(self, step: float, taken: float, iterations: int) -> float:
        """Return the next step after a converged one.

        Parameters
        ----------
        step : float
            Length that was proposed.
        taken : float
            Length of the step, which a waypoint may have shortened.
        iterations : int
            Newton iterations.

        Returns
        -------
        float
            Length.
        """
        factor = self.target_iterations / max(iterations, 1)
        proposal = taken * min(max(factor, self.cut), self.growth)
        if iterations <= self.target_iterations:
            proposal = max(proposal, step)  # a waypoint's short step says nothing against `step`
        return min(max(proposal, self.smallest), self.largest)

    def after_failure(self, taken: float, status: Status) -> float:
        """Return the next step after a failed one.

        Parameters
        ----------
        taken : float
            Length of the failed step.
        status : Status
            Reason.

        Returns
        -------
        float
            Length; below `smallest` the path ends.
        """
        wild = status in (Status.DIVERGED, Status.NOT_FINITE)
        return taken * (self.cut**2 if wild else self.cut)


def goals_of(start: float, stop: float, waypoints: Iterable[float]) -> list[float]:
    """Waypoints and stop in the order of travel, each once, without start."""
    if not (math.isfinite(start) and math.isfinite(stop)):
        raise ValueError(f"start and stop must be finite, got {start} and {stop}")
    goals = {float(waypoint) for waypoint in waypoints} | {float(stop)}
    low, high = min(start, stop), max(start, stop)
    outside = sorted(goal for goal in goals if not low <= goal <= high)
    if outside:
        raise ValueError(f"waypoints {outside} lie outside [{low}, {high}]")
    return sorted(goals - {float(start)}, reverse=stop < start)


def next_parameter(parameter: float, goal: float, step: float) -> float:
    """Next parameter: the goal itself within a step, half-way within two (no sliver remains)."""
    remaining = abs(goal - parameter)
    if remaining <= step * (1.0 + _ROUNDING):
        return goal
    return parameter + math.copysign(min(step, 0.5 * remaining), goal - parameter)


Predictor: TypeAlias = Literal["secant", "parabola", "previous"]
POINTS: dict[Predictor, int] = {"previous": 1, "secant": 2, "parabola": 3}
"""Number of known points that a predictor uses."""

UserPredictor: TypeAlias = Callable[[Point, float], Array]
"""User-supplied predictor: increment (n,) from the last point to a parameter."""

_LONGEST_EXTRAPOLATION = 10.0  # a secant prolonged further mostly amplifies its own error
_PARABOLA = 2.5  # the same for a parabola, in lengths of the shorter chord


def polynomial_value(times: Sequence[float], states: Iterable[Array], t: float) -> Array:
    """Value (n,) at t of the polynomial through the states (n,) at different times (Lagrange)."""
    parts = [
        math.prod((t - b) / (a - b) for b in times if b != a) * state
        for a, state in zip(times, states, strict=True)
    ]
    return np.asarray(np.sum(parts, axis=0))


def extrapolate(points: Sequence[Point], parameter: float) -> Array:
    """Change (n,) from the first of the points to `parameter`, on the polynomial through them all;
    on that of fewer points where it goes further beyond them than they are apart.
    """
    last, others = points[0], points[1:]
    t = parameter - last.parameter
    distances = [point.parameter - last.parameter for point in others]
    if len(set(distances)) < len(distances) or 0.0 in distances:
        return np.zeros_like(last.solution.x)
    if len(others) == 2 and abs(t) > _PARABOLA * min(abs(d) for d in distances):
        return extrapolate(points[:2], parameter)
    if len(others) == 1:
        t = math.copysign(min(abs(t), _LONGEST_EXTRAPOLATION * abs(distances[0])), t)
    changes = [point.solution.x - last.solution.x for point in points]
    return polynomial_value([0.0, *distances], changes, t)


def predict(
    predictor: Predictor | UserPredictor, points: Sequence[Point], parameter: float
) -> Array:
    """Increment (n,) from the first of the points to `parameter`."""
    if callable(predictor):
        return predictor(points[0], parameter)
    return extrapolate(points[: POINTS[predictor]], parameter)


def admissible_fraction(problem: NonlinearProblem, x: Array, dx: Array) -> float:
    """Fraction of a predictor that the problem admits; 0 if it admits none."""
    fraction = problem.step_limit(x, dx)
    return min(1.0, fraction) if fraction > 0.0 else 0.0


OnPoint: TypeAlias = Callable[[Point], object]
End: TypeAlias = tuple[Status, str]
"""End of a path, in code and in words."""

_NEARBY, _STEEPER = 2.0, 2.0
"""A turning point is believed that is foreseen within so many lengths of the step that failed, or
where the slope has grown by such a factor over the last step.
"""
_NO_TURNING_POINT = {Status.NOT_FINITE, Status.REFUSED}
_OWN_ADVICE = {*_NO_TURNING_POINT, Status.SINGULAR}
"""Failures of the shortest step that say more than that it was too long."""


@dataclass
class PathLog:
    """Log of a path: grows with every solve, and ends as a frozen Branch.

    rates: change of x with the parameter over each of the last two steps, and where.
    """

    name: str
    keep_all: bool = False
    on_point: OnPoint | None = None
    points: list[Point] = field(default_factory=list)
    failures: list[Point] = field(default_factory=list)
    limit_points: list[LimitPoint] = field(default_factory=list)
    rates: list[tuple[float, float]] = field(default_factory=list)
    factorisations: int = 0
    iterations: int = 0
    end: End | None = None

    def count(self, solution: Solution) -> Solution:
        """Add up the cost of a solve, converged or not, and pass it through."""
        self.factorisations += solution.factorisations
        self.iterations += solution.iterations
        return solution

    def accept(self, parameter: float, solution: Solution) -> Point:
        """Append a converged point, drop the x of the last but two, call `on_point`."""
        point = Point(parameter, solution)
        if self.points and (increment := parameter - self.points[-1].parameter):
            change = float(np.linalg.norm(solution.x - self.points[-1].solution.x))
            self.rates = [*self.rates[-1:], (parameter - 0.5 * increment, change / abs(increment))]
        self.points.append(point)
        if len(self.points) > 2 and not self.keep_all:
            old = self.points[-3]
            self.points[-3] = replace(old, solution=old.solution.forget())
        if self.on_point is not None:
            self.on_point(point)
        return point

    def refuse(self, parameter: float, solution: Solution) -> None:
        """Note a failed attempt."""
        self.failures.append(Point(parameter, solution.forget()))

    def branch(self, status: Status = Status.CONVERGED, message: str = "") -> Branch:
        """The finished path; before its end, the path so far with this status."""
        status, message = self.end or (status, message)
        return Branch(
            points=tuple(self.points),
            status=status,
            message=message,
            factorisations=self.factorisations,
            iterations=self.iterations,
            failures=tuple(self.failures),
            limit_points=tuple(self.limit_points),
        )

    def end_no_start(self, start: float, solution: Solution) -> None:
        """End where not even the start was solved."""
        self.refuse(start, solution)
        message = f"no solution at the start, {self.name} = {start:.9g}: {solution.message}"
        self.end = solution.status, message

    def end_step_too_small(self, step: float, smallest: float) -> None:
        """End the path, since the next step would be below `smallest`; report the last failure."""
        parameter, failed = self.points[-1].parameter, self.failures[-1]
        step_message = f"the next step would be {step:.2g}, smaller than {smallest:.2g}"
        message = (
            f"reached {self.name} = {parameter:.9g}; "
            f"{step_message if step else 'no shorter step is tried'}; "
            f"last attempt, at {failed.parameter:.9g}: "
            f"{failed.solution.status.value} ({failed.solution.message})"
        )
        reason = failed.solution.status
        fold = (
            None
            if reason in _NO_TURNING_POINT
            else self._turning_point(failed.parameter - parameter)
        )
        if fold is not None:
            self.end = Status.TURNING_POINT, f"at about {self.name} = {fold:.5g}; {message}"
        elif step >= smallest:
            self.end = Status.ROUNDING, message
        elif reason in _OWN_ADVICE:
            self.end = reason, message
        else:
            self.end = Status.STEP_TOO_SMALL, message

    def _turning_point(self, failed: float) -> float | None:
        """The parameter at which the slopes grow beyond all bounds as those of a parabola do:
        their inverse squares vanish in proportion to the distance. None where it is not believed.

        failed: the last step.
        """
        if len(self.rates) < 2:
            return None
        (a, previous), (b, latest) = self.rates
        if not 0.0 < previous < latest < math.inf:
            return None
        fold = b + (b - a) * previous**2 / (latest**2 - previous**2)
        nearby = abs(fold - self.points[-1].parameter) <= _NEARBY * abs(failed)
        return fold if nearby or latest >= _STEEPER * previous else None


ProblemAt: TypeAlias = Callable[[float], NonlinearProblem]


@dataclass(frozen=True, eq=False)
class StepAttempt:
    """An attempt at the next point of a path, over a step of length `step_length`.

    next_step: length of the next step where the stepper overrides the step rule.
    """

    parameter: float
    solution: Solution
    step_length: float = 0.0
    next_step: float | None = None

    @classmethod
    def solved(cls, parameter: float, x: Array, next_step: float) -> Self:
        """Start of a path at a given state (n,), which is not solved for."""
        return cls(parameter, Solution(x, Status.CONVERGED, "", (), 0, 0), next_step=next_step)

    @property
    def converged(self) -> bool:
        """True if it is a point of the path."""
        return self.solution.converged


class Stepper(Protocol):
    """Stepper of a solution path; it holds the last accepted point."""

    @property
    def resolution(self) -> float:
        """Length of a step that is lost in the rounding of the last point."""
        return 0.0

    def start(self) -> StepAttempt:
        """The attempt at the start."""
        ...

    def attempt(self, step: float) -> StepAttempt:
        """A step of at most this length from the last point."""
        ...

    def accept(self, attempt: StepAttempt) -> None:
        """Make a converged attempt the last point; the first one is that of the start."""
        ...

    def end(self) -> End | None:
        """Status and message at the end of the path, else None."""
        ...


def path_points(stepper: Stepper, steps: StepRule, log: PathLog) -> Iterator[Point]:
    """Converged points in order; afterwards the log has the end."""
    attempt, step = stepper.start(), steps.first
    while log.end is None:
        log.count(attempt.solution)
        step = _next_step(steps, step, attempt)
        if attempt.converged:
            stepper.accept(attempt)
            yield log.accept(attempt.parameter, attempt.solution)
            log.end = stepper.end()
        elif not log.points:
            log.end_no_start(attempt.parameter, attempt.solution)
        else:
            log.refuse(attempt.parameter, attempt.solution)
            if step < max(steps.smallest, stepper.resolution):
                log.end_step_too_small(step, steps.smallest)
        if log.end is None:
            attempt = stepper.attempt(step)


def _next_step(steps: StepRule, step: float, attempt: StepAttempt) -> float:
    """Length of the step after an attempt at a step of length `step`."""
    if attempt.next_step is not None:
        return attempt.next_step
    if not attempt.converged:
        return steps.after_failure(attempt.step_length, attempt.solution.status)
    if not attempt.step_length:
        return step
    return steps.after_success(step, attempt.step_length, attempt.solution.iterations)


def follow_path(stepper: Stepper, steps: StepRule, log: PathLog) -> Branch:
    """The whole path."""
    for _ in path_points(stepper, steps, log):
        pass
    return log.branch()


@dataclass(frozen=True)
class Continuation:
    """Continuation in a parameter: one Newton solution for each step.

    Parameters
    ----------
    newton : Newton
        Solver of the steps.
    steps : StepRule
        Step control, in units of the parameter.
    predictor : str or callable
        Initial guess of a step from the previous points.
    starter : Newton, optional
        Solver at the start, if it is another one.
    keep_all : bool
        True: all points have their x, else the last two.
    name : str
        Name of the parameter, for messages.
    """

    newton: Corrector
    steps: StepRule
    predictor: Predictor | UserPredictor = "secant"
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
        solved: bool = False,
    ) -> Branch:
        """Follow the path from `start` to `stop`.

        Parameters
        ----------
        problem_at : callable
            Function of the parameter that returns the problem.
        start : float
            First parameter.
        stop : float
            Last parameter.
        x0 : array (n,)
            Initial guess at the start.
        waypoints : iterable of float
            Parameters that are points of the path.
        on_point : callable, optional
            Called with each converged Point.
        previous : Point, optional
            A point before the start, for the predictor.
        solved : bool
            True: x0 is the solution at the start, and is not solved for again.

        Returns
        -------
        Branch
            CONVERGED if the end was reached.

        Raises
        ------
        ValueError
            A parameter is not finite or lies outside.
        """
        earlier = [] if previous is None else [previous]
        stepper = _ParameterStepper(
            self, problem_at, start, x0, goals_of(start, stop, waypoints), earlier, solved
        )
        return follow_path(stepper, self.steps, PathLog(self.name, self.keep_all, on_point))


@dataclass(eq=False)
class _ParameterStepper(Stepper):
    """goals: parameters to be hit, in order; points: the last points, latest first."""

    settings: Continuation
    problem_at: ProblemAt
    start_parameter: float
    x0: Array
    goals: list[float]
    points: list[Point]
    solved: bool = False

    @property
    def resolution(self) -> float:
        """See `Stepper`."""
        return float(np.spacing(abs(self.points[0].parameter)))

    def start(self) -> StepAttempt:
        """See `Stepper`."""
        if self.solved:
            return StepAttempt.solved(self.start_parameter, self.x0, self.settings.steps.first)
        corrector = self.settings.starter or self.settings.newton
        return StepAttempt(
            self.start_parameter, corrector.solve(self.problem_at(self.start_parameter), self.x0)
        )

    def attempt(self, step: float) -> StepAttempt:
        """Predict, no further than the problem admits, and correct."""
        last = self.points[0]
        parameter = next_parameter(last.parameter, self.goals[0], step)
        problem, x = self.problem_at(parameter), last.solution.x
        dx = predict(self.settings.predictor, self.points, parameter)
        guess = x + admissible_fraction(problem, x, dx) * dx
        solution = self.settings.newton.solve(problem, guess)
        return StepAttempt(parameter, solution, abs(parameter - last.parameter))

    def accept(self, attempt: StepAttempt) -> None:
        """See `Stepper`."""
        self.points = [Point(attempt.parameter, attempt.solution), *self.points[:2]]
        self.goals = self.goals[1:] if attempt.parameter in self.goals[:1] else self.goals

    def end(self) -> End | None:
        """See `Stepper`."""
        if self.goals:
            return None
        return Status.CONVERGED, f"reached {self.settings.name} = {self.points[0].parameter:.9g}"
