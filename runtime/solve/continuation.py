"""Following a solution path: predict, correct, choose the next step, end with a reason.

There is one driver, `walk`. A `Way` makes the steps: by the parameter of the path
(`Continuation`), by its arc length where the parameter turns back (`solve.arclength`), by time
(`analyses.time_stepping`). Predictors extrapolate the last points, `StepRule` controls the step,
`Record` logs the path and the reason of its end. A corrector is Newton's method, a relative, or a
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


def next_parameter(here: float, goal: float, step: float) -> float:
    """Next parameter: the goal itself within a step, half-way within two (no sliver remains)."""
    remaining = abs(goal - here)
    if remaining <= step * (1.0 + _ROUNDING):
        return goal
    return here + math.copysign(min(step, 0.5 * remaining), goal - here)


Predictor: TypeAlias = Literal["secant", "parabola", "previous"]
POINTS: dict[Predictor, int] = {"previous": 1, "secant": 2, "parabola": 3}
"""Number of known points that a predictor uses."""

Guess: TypeAlias = Callable[[Point, float], Array]
"""Change (n,) from a known point to a parameter, by whoever knows better than its neighbours."""

_LONGEST_EXTRAPOLATION = 10.0  # a secant prolonged further mostly amplifies its own error
_PARABOLA = 2.5  # the same for a parabola, in lengths of the shorter chord


def through(times: Sequence[float], states: Iterable[Array], t: float) -> Array:
    """Value (n,) at t of the polynomial through the states (n,) at different times (Lagrange)."""
    parts = [
        math.prod((t - b) / (a - b) for b in times if b != a) * state
        for a, state in zip(times, states, strict=True)
    ]
    return np.asarray(np.sum(parts, axis=0))


def extrapolated(known: Sequence[Point], parameter: float) -> Array:
    """Change (n,) from the first of the points to `parameter`, on the polynomial through them all;
    on that of fewer points where it goes further beyond them than they are apart.
    """
    here, others = known[0], known[1:]
    t = parameter - here.parameter
    distances = [point.parameter - here.parameter for point in others]
    if len(set(distances)) < len(distances) or 0.0 in distances:
        return np.zeros_like(here.solution.x)
    if len(others) == 2 and abs(t) > _PARABOLA * min(abs(d) for d in distances):
        return extrapolated(known[:2], parameter)
    if len(others) == 1:
        t = math.copysign(min(abs(t), _LONGEST_EXTRAPOLATION * abs(distances[0])), t)
    changes = [point.solution.x - here.solution.x for point in known]
    return through([0.0, *distances], changes, t)


def predicted(predictor: Predictor | Guess, known: Sequence[Point], parameter: float) -> Array:
    """Change (n,) from the first of the known points to `parameter`."""
    if callable(predictor):
        return predictor(known[0], parameter)
    return extrapolated(known[: POINTS[predictor]], parameter)


def admissible_fraction(problem: NonlinearProblem, x: Array, dx: Array) -> float:
    """Fraction of a predictor that the problem admits; 0 if it admits none."""
    fraction = problem.step_limit(x, dx)
    return min(1.0, fraction) if fraction > 0.0 else 0.0


OnPoint: TypeAlias = Callable[[Point], object]
End: TypeAlias = tuple[Status, str]
"""End of a path, in code and in words."""

_NEAR, _STEEPER = 2.0, 2.0
"""A turning point is believed that is foreseen within so many lengths of the step that failed, or
where the slope has grown by such a factor over the last step.
"""
_BARRED = {Status.NOT_FINITE, Status.REFUSED}
_WORDS_OF_THEIR_OWN = {*_BARRED, Status.SINGULAR}
"""Failures of the shortest step that say more than that it was too long."""


@dataclass
class Record:
    """Record of a path so far: grows with every solve, and ends as a frozen Branch.

    slopes: change of x with the parameter over each of the last two steps, and where.
    """

    name: str
    keep_all: bool = False
    on_point: OnPoint | None = None
    points: list[Point] = field(default_factory=list)
    failures: list[Point] = field(default_factory=list)
    limit_points: list[LimitPoint] = field(default_factory=list)
    slopes: list[tuple[float, float]] = field(default_factory=list)
    factorisations: int = 0
    iterations: int = 0
    end: End | None = None

    def count(self, solution: Solution) -> Solution:
        """Add up the cost of a solve, converged or not, and pass it through."""
        self.factorisations += solution.factorisations
        self.iterations += solution.iterations
        return solution

    def accept(self, parameter: float, solution: Solution) -> Point:
        """Append a converged point, forget the x of the last but two, tell the caller."""
        point = Point(parameter, solution)
        if self.points and (way := parameter - self.points[-1].parameter):
            change = float(np.linalg.norm(solution.x - self.points[-1].solution.x))
            self.slopes = [*self.slopes[-1:], (parameter - 0.5 * way, change / abs(way))]
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
        """The path as it ended; as it is so far, with this status, where it has no end yet."""
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

    def no_start(self, start: float, solution: Solution) -> None:
        """End where not even the start was solved."""
        self.refuse(start, solution)
        message = f"no solution at the start, {self.name} = {start:.9g}: {solution.message}"
        self.end = solution.status, message

    def too_small(self, step: float, smallest: float) -> None:
        """End because the last failure asks for a step below `smallest`; say what stands there."""
        here, failed = self.points[-1].parameter, self.failures[-1]
        less = f"the next step would be {step:.2g}, smaller than {smallest:.2g}"
        words = (
            f"reached {self.name} = {here:.9g}; {less if step else 'no shorter step is tried'}; "
            f"last attempt, at {failed.parameter:.9g}: "
            f"{failed.solution.status.value} ({failed.solution.message})"
        )
        reason = failed.solution.status
        fold = None if reason in _BARRED else self._turning_point(failed.parameter - here)
        if fold is not None:
            self.end = Status.TURNING_POINT, f"at about {self.name} = {fold:.5g}; {words}"
        elif step >= smallest:
            self.end = Status.ROUNDING, words
        elif reason in _WORDS_OF_THEIR_OWN:
            self.end = reason, words
        else:
            self.end = Status.STEP_TOO_SMALL, words

    def _turning_point(self, failed: float) -> float | None:
        """The parameter at which the slopes grow beyond all bounds as those of a parabola do:
        their inverse squares vanish in proportion to the distance. None where it is not believed.

        failed: the last step.
        """
        if len(self.slopes) < 2:
            return None
        (a, before), (b, now) = self.slopes
        if not 0.0 < before < now < math.inf:
            return None
        fold = b + (b - a) * before**2 / (now**2 - before**2)
        near = abs(fold - self.points[-1].parameter) <= _NEAR * abs(failed)
        return fold if near or now >= _STEEPER * before else None


ProblemAt: TypeAlias = Callable[[float], NonlinearProblem]


@dataclass(frozen=True, eq=False)
class Trial:
    """An attempt at the next point of a path, over a step of length `taken`.

    following: length of the next step where the way knows it better than the step rule does.
    """

    parameter: float
    solution: Solution
    taken: float = 0.0
    following: float | None = None

    @classmethod
    def known(cls, parameter: float, x: Array, following: float) -> Self:
        """The start of a path that begins with a state (n,) which needs no solving."""
        return cls(parameter, Solution(x, Status.CONVERGED, "", (), 0, 0), following=following)

    @property
    def converged(self) -> bool:
        """True if it is a point of the path."""
        return self.solution.converged


class Way(Protocol):
    """A way to go along a path; it knows where it stands."""

    @property
    def resolution(self) -> float:
        """Length of step that is lost in rounding from where it stands."""
        return 0.0

    def start(self) -> Trial:
        """The attempt at the start."""
        ...

    def attempt(self, step: float) -> Trial:
        """A step of at most this length from where the way stands."""
        ...

    def accept(self, trial: Trial) -> None:
        """Stand at a trial that has converged, at first that of the start."""
        ...

    def end(self) -> End | None:
        """Words and status where the path has come to its end, else None."""
        ...


def walk(way: Way, steps: StepRule, log: Record) -> Iterator[Point]:
    """Converged points in order; afterwards the log has the end."""
    trial, step = way.start(), steps.first
    while log.end is None:
        log.count(trial.solution)
        step = _following(steps, step, trial)
        if trial.converged:
            way.accept(trial)
            yield log.accept(trial.parameter, trial.solution)
            log.end = way.end()
        elif not log.points:
            log.no_start(trial.parameter, trial.solution)
        else:
            log.refuse(trial.parameter, trial.solution)
            if step < max(steps.smallest, way.resolution):
                log.too_small(step, steps.smallest)
        if log.end is None:
            trial = way.attempt(step)


def _following(steps: StepRule, step: float, trial: Trial) -> float:
    """Length of the step after a trial; `step` was asked for."""
    if trial.following is not None:
        return trial.following
    if not trial.converged:
        return steps.after_failure(trial.taken, trial.solution.status)
    if not trial.taken:
        return step
    return steps.after_success(step, trial.taken, trial.solution.iterations)


def followed(way: Way, steps: StepRule, log: Record) -> Branch:
    """The whole path."""
    for _ in walk(way, steps, log):
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
    predictor: Predictor | Guess = "secant"
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

        Returns
        -------
        Branch
            CONVERGED if the end was reached.

        Raises
        ------
        ValueError
            A parameter is not finite or lies outside.
        """
        behind = [] if previous is None else [previous]
        way = _ByParameter(self, problem_at, start, x0, goals_of(start, stop, waypoints), behind)
        return followed(way, self.steps, Record(self.name, self.keep_all, on_point))


@dataclass(eq=False)
class _ByParameter(Way):
    """goals: parameters to be hit, in order; known: the last points, latest first."""

    settings: Continuation
    problem_at: ProblemAt
    begin: float
    x0: Array
    goals: list[float]
    known: list[Point]

    @property
    def resolution(self) -> float:
        """See `Way`."""
        return float(np.spacing(abs(self.known[0].parameter)))

    def start(self) -> Trial:
        """See `Way`."""
        corrector = self.settings.starter or self.settings.newton
        return Trial(self.begin, corrector.solve(self.problem_at(self.begin), self.x0))

    def attempt(self, step: float) -> Trial:
        """Predict, no further than the problem admits, and correct."""
        here = self.known[0]
        parameter = next_parameter(here.parameter, self.goals[0], step)
        problem, x = self.problem_at(parameter), here.solution.x
        dx = predicted(self.settings.predictor, self.known, parameter)
        guess = x + admissible_fraction(problem, x, dx) * dx
        solution = self.settings.newton.solve(problem, guess)
        return Trial(parameter, solution, abs(parameter - here.parameter))

    def accept(self, trial: Trial) -> None:
        """See `Way`."""
        self.known = [Point(trial.parameter, trial.solution), *self.known[:2]]
        self.goals = self.goals[1:] if trial.parameter in self.goals[:1] else self.goals

    def end(self) -> End | None:
        """See `Way`."""
        if self.goals:
            return None
        return Status.CONVERGED, f"reached {self.settings.name} = {self.known[0].parameter:.9g}"
