"""Load stepping: the solution at a load factor, reached in steps that are cut where they fail."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from softehl.runtime.analyses.initial_state import SMALLEST, InitialState, initial_state
from softehl.runtime.analyses.solver_options import SolverOptions
from softehl.runtime.arrays import Array, count_of
from softehl.runtime.definition.argument_checks import finite, function
from softehl.runtime.definition.problem_definition import ProblemDefinition, StudyError
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.equations.rigid_body_modes import require_supported
from softehl.runtime.equations.stability import warn_unstable
from softehl.runtime.equations.system import Step, System
from softehl.runtime.results.result import Result
from softehl.runtime.sensitivity.tape import Tape, continued_tape, is_load_step
from softehl.runtime.solve.continuation import Continuation, StepRule
from softehl.runtime.solve.linear.factorisation_cache import iterative_part
from softehl.runtime.solve.linear.linear_solver import LinearSolver
from softehl.runtime.solve.singularity_check import LastFactorisation, SupportCheck
from softehl.runtime.solve.solution import Branch, NotConverged, Point

LOAD_FACTOR = "load factor"
_FEW_UNKNOWNS = 100_000
"""Unknowns: the factors of fewer take some 200 MB at most, and an adjoint then costs an eighth of a
nonlinear solution instead of a third."""


@dataclass(eq=False)
class LoadHistory:
    """Converged points of a path in the load factor; each commits history and calls `on_step`.

    x, histories: after the last point. results: all of them, or the last one. memory: linear
    solver with its last factors. previous: tape before the first step. record: results have the
    tape of the previous steps.
    """

    system: System
    x: Array
    histories: dict[str, Array]
    on_step: Callable[[Result], object]
    keep_all: bool = False
    memory: LastFactorisation | None = None
    previous: Tape | None = None
    record: bool = False
    linear: LinearSolver | None = None
    results: list[Result] = field(default_factory=list)

    @classmethod
    def begin(
        cls, system: System, initial: InitialState, on_step: Callable[[Result], object], **more: Any
    ) -> LoadHistory:
        """Return the history at an initial state."""
        return cls(system, initial.x, initial.histories, on_step, **more)

    def problem_at(self, t: float) -> Problem:
        """The problem at a load factor."""
        return self.system.problem(self._step(t))

    def commit(self, point: Point) -> None:
        """Commit a converged point."""
        step = self._step(point.parameter)
        problem = self.system.problem(step)
        previous = self.results[-1].trail if self.results else self.previous
        self.x = point.solution.x
        self.histories = self.system.committed(problem, self.x, self.histories)
        problem = problem.at(self.x)
        tape = Tape(
            self.system,
            step,
            problem,
            self.x,
            previous=previous if self.record else None,
            last_factors=self.memory,
            linear=None if self.linear is None else iterative_part(self.linear),
        )
        result = Result(self.system, problem, point, self.histories, tape)
        if not self.keep_all:
            self.results.clear()
        self.results.append(result)
        self.on_step(result)

    def begin_with(self, result: Result) -> None:
        """Take a result of the same study as the first point; nothing is committed again."""
        self.results.append(result)
        self.on_step(result)

    def _step(self, t: float) -> Step:
        return self.system.quasi_static_step(t, self.x, self.histories)

    def require_end(self, branch: Branch) -> None:
        """Raise NotConverged where the path did not reach its end."""
        if not branch.converged:
            raise NotConverged(branch, self.results[-1] if self.results else None)


def solve(
    definition: ProblemDefinition,
    *,
    steps: int = 1,
    until: float = 1.0,
    start: Result | None = None,
    on_step: Callable[[Result], object] | None = None,
    options: SolverOptions,
) -> Result:
    """Return the result at load factor `until`; see `Study.solve`."""
    count = count_of(steps)
    if count is None:
        raise StudyError(f"steps = {steps!r}: a whole number of at least 1 is needed")
    until = finite("until", until)
    if on_step is not None:
        function("on_step", on_step, "result")
    prepared = options.prepare(definition)
    system = prepared.system
    initial = initial_state(system, start)
    first_step = SupportCheck(prepared.newton)
    previous = continued_tape(system, start.trail if start else None)
    # another step here would let friction slip and histories with a given dt go on
    continued = previous is not None and is_load_step(previous) and until != initial.t
    with prepared.callbacks(LOAD_FACTOR, initial.t, until, on_step) as callbacks:
        history = LoadHistory.begin(
            system,
            initial,
            callbacks,
            memory=first_step.memory if options.record or system.size <= _FEW_UNKNOWNS else None,
            previous=previous,
            record=options.record,
            linear=prepared.newton.linear,
        )

        def commit(point: Point) -> None:
            if continued and start is not None and not history.results:
                history.begin_with(start)
                return
            first_step.check(history.problem_at(point.parameter), point.solution)
            history.commit(point)

        # without a way to go the equations are solved once
        first = abs(until - initial.t) / count or 1.0
        with np.errstate(all="ignore"):
            ahead = history.problem_at(initial.t + (until - initial.t) / count)
            require_supported(system, ahead, initial.x)
        rule = StepRule(first, min(SMALLEST, first), first)
        path = Continuation(first_step.newton, rule, name=LOAD_FACTOR)
        branch = path.follow(
            history.problem_at, initial.t, until, initial.x, on_point=commit, solved=continued
        )
        history.require_end(branch)
    end = history.results[-1]
    # the factors of a solution without iterations are those of the previous step
    factors = first_step.last if end.iterations else None
    if factors is not None or system.size <= _FEW_UNKNOWNS:  # for this alone they may be too large
        x = end.point.solution.x
        warn_unstable(end.problem, x, factors, f"{LOAD_FACTOR} {end.t:.4g}")
    return end
