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
from softehl.runtime.solve.continuation import End, OnPoint, Record, StepRule, Trial, Way, followed
from softehl.runtime.solve.newton import Corrector, NonlinearProblem
from softehl.runtime.solve.solution import Branch, Solution, Status

Finish: TypeAlias = Callable[[Array], Solution]
"""Solves the steady equations from the last state (n,) of a path."""

_LEAST = 1e-300  # no step and no change is less


class Transient(Protocol):
    """A problem with a rate of change. Times are in units that the problem chooses."""

    def step(self, before: Array, tau: float, load: float) -> NonlinearProblem:
        """The implicit Euler step of length tau from the state before (n,)."""
        ...

    def change(self, before: Array, after: Array) -> float:
        """Size of the change from one state (n,) to the next; inf if the latter is not admissible.

        1 is a change that a linearisation just bears.
        """
        ...


@dataclass(frozen=True, eq=False)
class Moment:
    """A state x (n,) on the way: the next step has the length tau, and acts under this load."""

    x: Array
    tau: float
    load: float = 0.0


@dataclass(frozen=True)
class PseudoTransient:
    """The steps of pseudo-transient continuation; lengths are in units of the problem's time.

    corrector: solves a step. begin: length from which on the load is applied, in steps of
    `load_step` that double; the length stays meanwhile. last, settled: the state is steady after a
    step of this length that changes it by less than `settled`. wanted: change of a step; the next
    one is longer by wanted / change, within `shortest` and `longest`. cut: of a step that fails.
    failures: failed steps that end the path, in a row and in all. most: steps of a path.
    """

    corrector: Corrector
    begin: float = 1.0
    last: float = 1e4
    load_step: float = 0.25
    wanted: float = 0.7
    settled: float = 1e-3
    shortest: float = 0.5
    longest: float = 10.0
    cut: float = 0.25
    failures: tuple[int, int] = (3, 12)
    most: int = 100

    def follow(
        self,
        transient: Transient,
        start: Moment,
        on_point: OnPoint | None = None,
        finish: Finish | None = None,
    ) -> tuple[Branch, Moment]:
        """To the steady state, and the last moment that was reached.

        finish: makes the last point of the branch, the state without a rate of change.
        """
        way = _Steps(self, transient, start, self.load_step)
        rule, log = StepRule(start.tau, min(_LEAST, start.tau)), Record("time", on_point=on_point)
        branch = followed(way, rule, log)
        if finish is None or not branch.converged:
            return branch, way.now
        end = log.count(finish(way.now.x))
        if end.converged:
            log.accept(way.time, end)
        else:
            log.refuse(way.time, end)
            log.end = end.status, f"steady state: {end.message}"
        return log.branch(), way.now


@dataclass(eq=False)
class _Steps(Way):
    """The way of the steps; its parameter is the time.

    now: where it stands. taken, change: length and change of the last step. more: load of the last
    attempt. failed: numbers of failed attempts, in a row and in all. steps: that were taken.
    """

    rule: PseudoTransient
    transient: Transient
    now: Moment
    load_step: float
    time: float = 0.0
    taken: float = 0.0
    change: float = inf
    more: float = 0.0
    failed: tuple[int, int] = (0, 0)
    steps: int = 0

    def start(self) -> Trial:
        """See `Way`."""
        return Trial.known(0.0, self.now.x, self.now.tau)

    def attempt(self, step: float) -> Trial:
        """See `Way`."""
        now, rule = self.now, self.rule
        self.more = min(self.load_step, 1.0 - now.load) if step >= rule.begin or now.load else 0.0
        problem = self.transient.step(now.x, step, now.load + self.more)
        solution = rule.corrector.solve(problem, now.x)
        change = self.transient.change(now.x, solution.x) if solution.converged else inf
        if solution.converged and change == inf:
            solution = replace(solution, status=Status.REFUSED, message="not admissible")
        if change < inf:
            self.change = change
            growth = min(max(rule.wanted / max(change, _LEAST), rule.shortest), rule.longest)
            return Trial(self.time + step, solution, step, step if self.more else growth * step)
        self.load_step *= 0.5
        self.failed = self.failed[0] + 1, self.failed[1] + 1
        ended = self.failed[0] >= rule.failures[0] or self.failed[1] >= rule.failures[1]
        return Trial(self.time + step, solution, step, 0.0 if ended else rule.cut * step)

    def accept(self, trial: Trial) -> None:
        """See `Way`."""
        if not trial.taken:
            return
        if self.more:
            self.load_step *= 2.0
        self.steps += 1
        self.time, self.taken, self.failed = trial.parameter, trial.taken, (0, self.failed[1])
        following = trial.taken if trial.following is None else trial.following
        self.now = Moment(trial.solution.x, following, self.now.load + self.more)

    def end(self) -> End | None:
        """See `Way`."""
        settled = self.taken >= self.rule.last and self.change < self.rule.settled
        if settled and self.now.load == 1.0:
            return Status.CONVERGED, "steady"
        if self.steps >= self.rule.most:
            return Status.MAX_ITERATIONS, f"not steady after {self.steps} steps"
        return None
