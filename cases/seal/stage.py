"""Walking one stage of a solution path: report every step, count the cost, keep the histories."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from softehl.cases.seal.state import Observer, StageRecord, place
from softehl.runtime.arrays import Array
from softehl.runtime.solve.continuation import Continuation
from softehl.runtime.solve.newton import Corrector, Newton, NonlinearProblem
from softehl.runtime.solve.predictor import Predictor
from softehl.runtime.solve.solution import Branch, Point
from softehl.runtime.solve.steps import StepRule


def _nothing(point: Point) -> None:
    """Default of Stage.on_point."""


@dataclass(frozen=True, eq=False)
class Stage:
    """A family of problems in one parameter, to be followed from `start` to `stop`.

    name, sealed_pressure, stroke: what observers and records call it. waypoints: parameters
    hit exactly. shown: the parameter as it is reported (mm/s for a path in log |U|). method: how
    it is solved, for the record. corrector: what solves it, None for the walker's Newton.
    predictor: how it is guessed.
    """

    name: str
    problem_at: Callable[[float], NonlinearProblem]
    start: float
    stop: float
    steps: StepRule
    sealed_pressure: float
    stroke: str
    waypoints: tuple[float, ...] = ()
    method: str = "newton"
    corrector: Corrector | None = None
    predictor: Predictor = "secant"
    on_point: Callable[[Point], None] = _nothing
    shown: Callable[[float], float] = float

    def fraction(self, parameter: float) -> float:
        """Share of the way, 0 to 1."""
        way = self.stop - self.start
        return (parameter - self.start) / way if way else 1.0


@dataclass(frozen=True)
class Walker:
    """How stages are walked.

    newton: corrector of every step. patience: iterations allowed at the start of a stage,
    which has no predictor; a step that needs as many is better cut.
    """

    newton: Newton = field(default_factory=lambda: Newton(max_iterations=10))
    patience: int = 40

    def walk(self, stage: Stage, x0: Array, observer: Observer) -> tuple[Branch, StageRecord]:
        """Solve at the start from x0, follow to the end; failure is in the branch's status."""
        begin = time.perf_counter()
        observer.stage(
            stage.name, sealed_pressure=stage.sealed_pressure, stroke=stage.stroke, steps=None
        )
        points: list[Point] = []

        def report(point: Point) -> None:
            points.append(replace(point, solution=point.solution.forget()))
            observer.step(
                label=stage.name,
                parameter=stage.shown(point.parameter),
                iterations=point.solution.iterations,
                residuals=point.solution.residual_norms,
                fraction=stage.fraction(point.parameter),
            )
            stage.on_point(point)

        branch = self._follow(stage, x0, report)
        return branch, _record(stage, branch, points, time.perf_counter() - begin)

    def _follow(self, stage: Stage, x0: Array, report: Callable[[Point], None]) -> Branch:
        patient = replace(self.newton, max_iterations=self.patience)
        continuation = Continuation(
            stage.corrector or self.newton,
            stage.steps,
            stage.predictor,
            name=stage.name,
            starter=stage.corrector or patient,
        )
        return continuation.follow(
            stage.problem_at,
            stage.start,
            stage.stop,
            x0,
            waypoints=stage.waypoints,
            on_point=report,
        )


def _record(stage: Stage, branch: Branch, points: list[Point], seconds: float) -> StageRecord:
    return StageRecord(
        name=stage.name,
        seconds=seconds,
        factorisations=branch.factorisations,
        iterations=branch.iterations,
        residual_histories=tuple(p.solution.residual_norms for p in points),
        parameters=tuple(stage.shown(p.parameter) for p in points),
        where=place(stage.sealed_pressure, stage.stroke),
        method=stage.method if branch.converged else f"{stage.method}; ended: {branch.message}",
    )
