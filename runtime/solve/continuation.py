"""Following a solution path in its parameter: predict, correct, choose the next step.

The predictors are in `solve.predictor`, the corrector is Newton's method or a relative, the step
rule is in `solve.steps`; `solve.arclength` passes limit points, where the parameter turns back.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from softehl.runtime.arrays import Array
from softehl.runtime.solve.newton import Corrector, NonlinearProblem
from softehl.runtime.solve.predictor import Guess, Predictor, admissible_fraction, predicted
from softehl.runtime.solve.record import OnPoint, Record
from softehl.runtime.solve.solution import Branch, Point, Solution, Status
from softehl.runtime.solve.steps import StepRule, goals_of, next_parameter

ProblemAt: TypeAlias = Callable[[float], NonlinearProblem]


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
        goals = goals_of(start, stop, waypoints)
        log = Record(self.name, self.keep_all, on_point)
        solution = log.count((self.starter or self.newton).solve(problem_at(start), x0))
        if not solution.converged:
            return log.no_start(start, solution)
        here, step = log.accept(start, solution), self.steps.first
        behind = [] if previous is None else [previous]
        while goals:
            parameter = next_parameter(here.parameter, goals[0], step)
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
        dx = predicted(self.predictor, known, parameter)
        return self.newton.solve(problem, x + admissible_fraction(problem, x, dx) * dx)
