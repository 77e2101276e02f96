"""Following a solution path: predict, correct, choose the next step, end with a reason.

There is one driver, `walk`. A `Way` makes the steps: by the parameter of the path
(`Continuation`), by its arc length where the parameter turns back (`solve.arclength`), by time
(`analyses.time_stepping`). Predictors are in `solve.predictor`, the step rule is in `solve.steps`.
A corrector is Newton's method, a relative, or a `Ladder` of them: escalation within a step is its
business, a shorter step is ours.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol, Self, TypeAlias

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.solve.newton import Corrector, NonlinearProblem
from softehl.runtime.solve.predictor import Guess, Predictor, admissible_fraction, predicted
from softehl.runtime.solve.record import End, OnPoint, Record
from softehl.runtime.solve.solution import Branch, Point, Solution, Status
from softehl.runtime.solve.steps import StepRule, goals_of, next_parameter

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
    """Natural-parameter continuation with an adaptive step.

    newton: the corrector; steps: the step rule, lengths in units of the parameter (which the
    caller may have transformed, for instance to log U); predictor: "secant" through the last two
    points, "parabola" through the last three (the secant until there are three), "previous" point,
    or a guess; keep_all: keep x at every point, not just the last two;
    name: what messages call the parameter; starter: the corrector of the start, which has no
    predictor and may deserve more iterations than a step that is better cut (None: the same).
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
        """Solve problem_at(parameter) from start to stop, either of which may be the larger.

        x0: (n,) guess at start. waypoints: parameters in [start, stop], any order, hit exactly
        (as stop is). on_point: called after each converged point. previous: a converged point
        before start, from which the first secant is drawn when a path is resumed. Raises
        ValueError for waypoints that are out of range or not finite.
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
