"""Load steps of a study, from one load factor to another: cut and grown as Newton needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from softehl.runtime.begin import SMALLEST, Beginning
from softehl.runtime.fem.problem import Problem
from softehl.runtime.held import require_held
from softehl.runtime.result import Result
from softehl.runtime.solve.held import FirstStep
from softehl.runtime.solve.homotopy import Continuation
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import NotConverged, Point
from softehl.runtime.solve.steps import StepRule
from softehl.runtime.system import System


@dataclass(frozen=True, eq=False)
class LoadSteps:
    """Settings of a load: the number of steps, each result handed to `on_step`."""

    steps: int
    newton: Newton
    on_step: Callable[[Result], object]

    def run(self, system: System, start: Beginning, until: float) -> Result:
        """The result at load factor `until`.  Raises NotConverged."""
        begin, x0, histories = start
        state = [(x0, histories)]  # after the last converged step
        reached: list[Result] = []
        first_step = FirstStep(self.newton)

        def problem_at(t: float) -> Problem:
            return system.problem(system.still(t, *state[0]))

        def keep(point: Point) -> None:
            problem, x = problem_at(point.parameter), point.solution.x
            first_step.check(problem, point.solution)
            state[0] = x, system.committed(problem, x, state[0][1])
            reached[:] = [Result(system, problem, point, state[0][1])]
            self.on_step(reached[0])

        first = abs(until - begin) / self.steps or 1.0  # nowhere to go: one solution there
        with np.errstate(all="ignore"):
            require_held(system, problem_at(begin + (until - begin) / self.steps), x0)
        rule = StepRule(first, min(SMALLEST, first), first)
        path = Continuation(first_step.newton, rule, name="load factor")
        branch = path.follow(problem_at, begin, until, x0, on_point=keep)
        if not branch.converged:
            raise NotConverged(branch, reached[0] if reached else None)
        return reached[0]
