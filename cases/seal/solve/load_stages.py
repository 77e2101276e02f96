"""Load stages: a path of contact states, followed stage by stage (section 4 of the paper).

A stage is a family of problems in one parameter. One that does not reach its end raises
`StageError`, with the parameter that it reached and what may help.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from softehl.cases.harness.observer import Observer, StageRecord
from softehl.cases.seal.states.state import operating_point
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.solve.continuation import Continuation, StepRule
from softehl.runtime.solve.newton import Corrector, Newton, NonlinearProblem
from softehl.runtime.solve.solution import Branch, Point, Solution

STEPS = StepRule(0.05, 3e-4, 0.3)
"""Steps of the way of the rod, of the pressure over the shear modulus, of what friction takes."""


@dataclass(frozen=True, eq=False)
class Stage:
    """A family of problems in one parameter, to be followed from `start` to `stop`.

    A stage with the same start and stop has one step. name, sealed_pressure: labels for observers
    and records. ended: words for a path that ends at a parameter. method: how it is solved, for
    the record. corrector: what solves it, None for the driver's Newton.
    """

    name: str
    problem_at: Callable[[float], NonlinearProblem]
    ended: Callable[[float], str]
    start: float = 0.0
    stop: float = 1.0
    steps: StepRule = STEPS
    sealed_pressure: float = 0.0
    method: str = "newton"
    corrector: Corrector | None = None
    on_point: Callable[[Point], None] | None = None

    def fraction(self, parameter: float) -> float:
        """Share of the way, 0 to 1."""
        length = self.stop - self.start
        return (parameter - self.start) / length if length else 1.0


@dataclass(eq=False)
class StageError(Exception):
    """A stage that did not reach its end. records: what all stages have cost; it grows."""

    load_stage: Stage
    branch: Branch
    records: Sequence[StageRecord] = ()

    def __str__(self) -> str:
        """Words on how far the stage came, and what may help."""
        return self.load_stage.ended(self.reached)

    @property
    def reached(self) -> float:
        """Parameter of the last state; of the beginning, if there is none."""
        points = self.branch.points
        return points[-1].parameter if points else self.load_stage.start


@dataclass
class PathDriver:
    """Follows stages, reports every step and keeps a record of each stage.

    newton: corrector of every step, but where a stage has its own. Only `records` changes, by one
    with each stage.
    """

    observer: Observer
    newton: Newton = field(default_factory=lambda: Newton(max_iterations=10))
    records: list[StageRecord] = field(default_factory=list)

    def follow(self, load_stage: Stage, x0: Array) -> Array:
        """Unknowns (n,) at the end of a stage that begins with a solution near x0 (n,).

        A wall's friction is that of the way since the step before, in the first one since x0.
        Raises StageError.
        """
        log = LoadStageLog(
            self, load_stage.name, load_stage.sealed_pressure, "both", load_stage.method
        )
        previous = [x0]

        def problem_at(parameter: float) -> NonlinearProblem:
            problem = load_stage.problem_at(parameter)
            return problem.since(previous[0]) if isinstance(problem, Problem) else problem

        def report(point: Point) -> None:
            log.step(point.solution, point.parameter, load_stage.fraction(point.parameter))
            previous[0] = point.solution.x
            if load_stage.on_point:
                load_stage.on_point(point)

        continuation = Continuation(
            load_stage.corrector or self.newton, load_stage.steps, name=load_stage.name
        )
        branch = continuation.follow(
            problem_at, load_stage.start, load_stage.stop, x0, on_point=report
        )
        failed = None if branch.converged else StageError(load_stage, branch, self.records)
        log.end(branch, f"; ended: {branch.message}" if failed else "")
        if failed:
            raise failed
        return branch.last.x


@dataclass(eq=False)
class LoadStageLog:
    """A stage while it is solved: the observer hears of its steps, and its cost is recorded.

    stroke: "both" where a contact state serves both. method: how it is solved.
    """

    driver: PathDriver
    name: str
    sealed_pressure: float
    stroke: str
    method: str
    parameters: list[float] = field(default_factory=list)
    histories: list[tuple[float, ...]] = field(default_factory=list)
    start_time: float = field(default_factory=time.perf_counter)

    def __post_init__(self) -> None:
        """Tell that it begins."""
        p_s, stroke = self.sealed_pressure, self.stroke
        self.driver.observer.stage(self.name, sealed_pressure=p_s, stroke=stroke, steps=None)

    def step(
        self, solution: Solution, parameter: float | None = None, fraction: float | None = None
    ) -> None:
        """A solution at a parameter, which counts them where there is none; share of the way."""
        at = len(self.parameters) + 1.0 if parameter is None else parameter
        self.parameters.append(at)
        self.histories.append(solution.residual_norms)
        self.driver.observer.step(
            label=self.name,
            parameter=at,
            iterations=solution.iterations,
            residuals=solution.residual_norms,
            fraction=fraction,
        )

    def end(self, spent: Branch | Solution, ended: str = "") -> None:
        """Record what was spent; ended: words on a stage that failed."""
        self.driver.records.append(
            StageRecord(
                name=self.name,
                seconds=time.perf_counter() - self.start_time,
                factorisations=spent.factorisations,
                iterations=spent.iterations,
                residual_histories=tuple(self.histories),
                parameters=tuple(self.parameters),
                where=operating_point(self.sealed_pressure, self.stroke),
                method=self.method + ended,
            )
        )
