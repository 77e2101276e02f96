"""Pseudo-transient continuation: from any state to a steady solution by implicit steps in time.

A problem R(x, s) = 0, whose load s grows from 0 to 1, is given a rate of change M. Each implicit
Euler step solves

    R(x, s) + M(x_n) (x - x_n) / tau = 0

from the state x_n before it. A short tau holds the state where it is, so that any start is near a
solution; as tau grows the steps become those of Newton's method for R(x, 1) = 0. Only steps that
change the state little are lengthened: they follow the physical transient where that matters, and
pass it quickly where it does not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf
from typing import Protocol, TypeAlias

from softehl.runtime.arrays import Array
from softehl.runtime.solve.continuation import (
    End,
    OnPoint,
    PathLog,
    StepAttempt,
    Stepper,
    StepRule,
    follow_path,
)
from softehl.runtime.solve.newton import Corrector, NonlinearProblem
from softehl.runtime.solve.solution import Branch, Solution, Status

Finish: TypeAlias = Callable[[Array], Solution]
"""Solves the steady equations from the last state (n,) of a path."""

_TINY = 1e-300  # no step and no change is less


class Transient(Protocol):
    """A problem with a rate of change. Times are in units that the problem chooses."""

    def step(self, previous: Array, tau: float, load: float) -> NonlinearProblem:
        """The implicit Euler step of length tau from the state before (n,)."""
        ...

    def change(self, previous: Array, current: Array) -> float:
        """Size of the change from one state (n,) to the next; inf if the latter is not admissible.

        1 is a change that a linearisation just bears.
        """
        ...


@dataclass(frozen=True, eq=False)
class TransientState:
    """A state x (n,) on the way: the next step has the length tau, and acts under this load."""

    x: Array
    tau: float
    load: float = 0.0


@dataclass(frozen=True)
class PseudoTransient:
    """The steps of pseudo-transient continuation; lengths are in units of the problem's time.

    corrector: solves a step. begin: length from which on the load is applied, in steps of
    `load_step` that double; the length stays meanwhile. last, settled: the state is steady after a
    step of this length that changes it by less than `settled`. target_change: change of a step; the
    next one is longer by target_change / change, within `shortest` and `longest`. cut: factor after
    a failed step.
    failures: failed steps that end the path, in a row and in all. max_steps: steps of a path.
    """

    corrector: Corrector
    begin: float = 1.0
    last: float = 1e4
    load_step: float = 0.25
    target_change: float = 0.7
    settled: float = 1e-3
    shortest: float = 0.5
    longest: float = 10.0
    cut: float = 0.25
    failures: tuple[int, int] = (3, 12)
    max_steps: int = 100

    def follow(
        self,
        transient: Transient,
        start: TransientState,
        on_point: OnPoint | None = None,
        finish: Finish | None = None,
    ) -> tuple[Branch, TransientState]:
        """To the steady state, and the last moment that was reached.

        finish: makes the last point of the branch, the state without a rate of change.
        """
        stepper = _PseudoTransientStepper(self, transient, start, self.load_step)
        rule, log = StepRule(start.tau, min(_TINY, start.tau)), PathLog("time", on_point=on_point)
        branch = follow_path(stepper, rule, log)
        if finish is None or not branch.converged:
            return branch, stepper.state
        end = log.count(finish(stepper.state.x))
        if end.converged:
            log.accept(stepper.time, end)
        else:
            log.refuse(stepper.time, end)
            log.end = end.status, f"steady state: {end.message}"
        return log.branch(), stepper.state


@dataclass(eq=False)
class _PseudoTransientStepper(Stepper):
    """Stepper in pseudo-time; its parameter is the time.

    state: last accepted one. step_length, change: of the last step. load_increment: of the last
    attempt. failed: numbers of failed attempts, in a row and in all. steps: number of steps.
    """

    rule: PseudoTransient
    transient: Transient
    state: TransientState
    load_step: float
    time: float = 0.0
    step_length: float = 0.0
    change: float = inf
    load_increment: float = 0.0
    failed: tuple[int, int] = (0, 0)
    steps: int = 0

    def start(self) -> StepAttempt:
        """See `Stepper`."""
        return StepAttempt.solved(0.0, self.state.x, self.state.tau)

    def attempt(self, step: float) -> StepAttempt:
        """See `Stepper`."""
        state, rule = self.state, self.rule
        self.load_increment = (
            min(self.load_step, 1.0 - state.load) if step >= rule.begin or state.load else 0.0
        )
        problem = self.transient.step(state.x, step, state.load + self.load_increment)
        solution = rule.corrector.solve(problem, state.x)
        change = self.transient.change(state.x, solution.x) if solution.converged else inf
        if solution.converged and change == inf:
            solution = replace(solution, status=Status.REFUSED, message="not admissible")
        if change < inf:
            self.change = change
            growth = min(max(rule.target_change / max(change, _TINY), rule.shortest), rule.longest)
            return StepAttempt(
                self.time + step, solution, step, step if self.load_increment else growth * step
            )
        self.load_step *= 0.5
        self.failed = self.failed[0] + 1, self.failed[1] + 1
        ended = self.failed[0] >= rule.failures[0] or self.failed[1] >= rule.failures[1]
        return StepAttempt(self.time + step, solution, step, 0.0 if ended else rule.cut * step)

    def accept(self, attempt: StepAttempt) -> None:
        """See `Stepper`."""
        if not attempt.step_length:
            return
        if self.load_increment:
            self.load_step *= 2.0
        self.steps += 1
        self.time, self.step_length, self.failed = (
            attempt.parameter,
            attempt.step_length,
            (0, self.failed[1]),
        )
        next_step = attempt.step_length if attempt.next_step is None else attempt.next_step
        self.state = TransientState(
            attempt.solution.x, next_step, self.state.load + self.load_increment
        )

    def end(self) -> End | None:
        """See `Stepper`."""
        settled = self.step_length >= self.rule.last and self.change < self.rule.settled
        if settled and self.state.load == 1.0:
            return Status.CONVERGED, "steady"
        if self.steps >= self.rule.max_steps:
            return Status.MAX_ITERATIONS, f"not steady after {self.steps} steps"
        return None
