"""Following a path of contact states stage by stage (section 4 of the paper).

A stage is a family of problems in one parameter. One that does not reach its end raises
`StageError`, which says how far it came and what may help.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from softehl.cases.seal.states.state import Observer, StageRecord, place
from softehl.runtime.arrays import Array
from softehl.runtime.fem.problem import Problem
from softehl.runtime.solve.homotopy import Continuation
from softehl.runtime.solve.newton import Corrector, Newton, NonlinearProblem
from softehl.runtime.solve.solution import Branch, Point
from softehl.runtime.solve.steps import StepRule

_BOTH = "both"
"""Strokes that a contact state serves."""


def _nothing(point: Point) -> None:
    """Default of Stage.on_point."""


@dataclass(frozen=True, eq=False)
class Stage:
    """A family of problems in one parameter, to be followed from `start` to `stop`.

    name, sealed_pressure: labels for observers and records. method: how it is solved, for the
    record. ended: words for a path that ends at a parameter. corrector: what solves it, None for
    the driver's Newton.
    """

    name: str
    problem_at: Callable[[float], NonlinearProblem]
    start: float
    stop: float
    steps: StepRule
    sealed_pressure: float
    ended: Callable[[float], str]
    method: str = "newton"
    corrector: Corrector | None = None
    on_point: Callable[[Point], None] = _nothing

    def fraction(self, parameter: float) -> float:
        """Share of the way, 0 to 1."""
        way = self.stop - self.start
        return (parameter - self.start) / way if way else 1.0


@dataclass(eq=False)
class StageError(Exception):
    """A stage that did not reach its end. records: what all stages so far have cost."""

    stage: Stage
    branch: Branch
    records: tuple[StageRecord, ...] = ()

    def __str__(self) -> str:
        """Words on how far the stage came, and what may help."""
        return self.stage.ended(self.reached)

    @property
    def reached(self) -> float:
        """Parameter of the last state; of the beginning, if there is none."""
        points = self.branch.points
        return points[-1].parameter if points else self.stage.start


@dataclass
class PathDriver:
    """Follows stages, reports every step and keeps a record of each stage.

    newton: corrector of every step, but where a stage has its own. Only `records` changes, by one
    with each stage.
    """

    observer: Observer
    newton: Newton = field(default_factory=lambda: Newton(max_iterations=10))
    records: list[StageRecord] = field(default_factory=list)

    def follow(self, stage: Stage, x0: Array) -> Array:
        """Unknowns (n,) at the end of a stage that begins with a solution near x0 (n,).

        A wall's friction is that of the way since the step before, in the first one since x0.
        Raises StageError.
        """
        begin = time.perf_counter()
        self.observer.stage(
            stage.name, sealed_pressure=stage.sealed_pressure, stroke=_BOTH, steps=None
        )
        points, before = list[Point](), [x0]

        def problem_at(parameter: float) -> NonlinearProblem:
            problem = stage.problem_at(parameter)
            return problem.since(before[0]) if isinstance(problem, Problem) else problem

        def report(point: Point) -> None:
            points.append(replace(point, solution=point.solution.forget()))
            self.observer.step(
                label=stage.name,
                parameter=point.parameter,
                iterations=point.solution.iterations,
                residuals=point.solution.residual_norms,
                fraction=stage.fraction(point.parameter),
            )
            before[0] = point.solution.x
            stage.on_point(point)

        continuation = Continuation(stage.corrector or self.newton, stage.steps, name=stage.name)
        branch = continuation.follow(problem_at, stage.start, stage.stop, x0, on_point=report)
        self.records.append(_record(stage, branch, points, time.perf_counter() - begin))
        if not branch.converged:
            raise StageError(stage, branch)
        return branch.last.x


def _record(stage: Stage, branch: Branch, points: list[Point], seconds: float) -> StageRecord:
    return StageRecord(
        name=stage.name,
        seconds=seconds,
        factorisations=branch.factorisations,
        iterations=branch.iterations,
        residual_histories=tuple(p.solution.residual_norms for p in points),
        parameters=tuple(p.parameter for p in points),
        where=place(stage.sealed_pressure, _BOTH),
        method=stage.method if branch.converged else f"{stage.method}; ended: {branch.message}",
    )
