"""Paths of a study along which the load may turn back: arc length, limit points located."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from softehl.runtime.begin import Beginning
from softehl.runtime.fem.problem import Problem
from softehl.runtime.held import require_held
from softehl.runtime.result import Result
from softehl.runtime.solve.arclength import Arclength
from softehl.runtime.solve.held import FirstStep
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import LimitPoint, NotConverged, Point
from softehl.runtime.solve.steps import StepRule
from softehl.runtime.system import System


@dataclass(frozen=True, eq=False)
class LoadPath:
    """Converged results in order, and where the load factor turned.

    limits: each with `parameter` (the load factor), `kind` ("maximum" or "minimum") and `x`.
    """

    results: tuple[Result, ...]
    limits: tuple[LimitPoint, ...]


@dataclass(frozen=True, eq=False)
class ArcSteps:
    """Settings of a path: longest step, largest number of points, each handed to `on_step`."""

    step: float
    newton: Newton
    most: int
    on_step: Callable[[Result], object]

    def run(self, system: System, start: Beginning, until: Callable[[Result], bool]) -> LoadPath:
        """Follow the path as `Study.follow` describes.  Raises NotConverged."""
        begin, x0, histories = start
        state = [(x0, histories)]  # after the last converged point
        results: list[Result] = []

        def problem_at(t: float) -> Problem:
            return system.problem(system.still(t, *state[0]))

        def keep(point: Point) -> None:
            problem, x = problem_at(point.parameter), point.solution.x
            state[0] = x, system.committed(problem, x, state[0][1])
            results.append(Result(system, problem, point, state[0][1]))
            self.on_step(results[-1])

        first_step = FirstStep(self.newton)
        with np.errstate(all="ignore"):
            problem = problem_at(begin + self.step)
            require_held(system, problem, x0)
            first = first_step.newton.solve(problem, x0)
        if not first.converged:
            raise NotConverged(first)
        first_step.check(problem, first)
        scale = float(np.sqrt(np.mean((first.x - x0) ** 2))) / self.step
        rule = StepRule(self.step, 1e-6 * self.step, self.step)
        path = Arclength(
            self.newton, rule, x_scale=scale or 1.0, max_points=self.most, name="load factor"
        )
        branch = path.follow(
            problem_at, begin, x0, until=lambda _: until(results[-1]), on_point=keep
        )
        if not branch.converged:
            raise NotConverged(branch, results[-1] if results else None)
        return LoadPath((*results,), branch.limit_points)
