"""Time: backward Euler and BDF2 over the steps of a study, adaptive, with history, restartable."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from hashlib import sha256
from itertools import chain
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from softehl.runtime.analyses.initial_state import SMALLEST, beginning
from softehl.runtime.arrays import Array
from softehl.runtime.definition.contact_sides import MULTIPLIERS
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.discretisation.communicator import Share
from softehl.runtime.discretisation.loads import Tie
from softehl.runtime.equations.rigid_body_modes import require_held
from softehl.runtime.equations.system import Step, System
from softehl.runtime.io import read_arrays, write_arrays
from softehl.runtime.results.result import Result
from softehl.runtime.sensitivity.tape import Trail
from softehl.runtime.solve.continuation import (
    End,
    PathLog,
    StepAttempt,
    Stepper,
    StepRule,
    path_points,
    polynomial_value,
)
from softehl.runtime.solve.differences import differences
from softehl.runtime.solve.linear.factorisation_cache import iterating
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.singularity_check import LastFactorisation, SupportCheck
from softehl.runtime.solve.solution import NotConverged, Point, Status

Method: TypeAlias = Literal["euler", "bdf2"]

_ORDER = {"euler": 1, "bdf2": 2}
_GROWTH, _CUT, _SAFETY = 2.0, 0.2, 0.9
ROUNDING = 1e-12  # of the whole time: a step is not cut to less than that before the end


@dataclass(frozen=True, eq=False)
class Clock:
    """Everything that passes from one step to the next.

    times: of the last states, latest first, at most three. states: (k, n) their unknowns.
    histories: block -> point data after the last step. dt: length of the next step.
    """

    times: tuple[float, ...]
    states: Array
    histories: Mapping[str, Array]
    dt: float

    @property
    def t(self) -> float:
        """The present time."""
        return self.times[0]

    @classmethod
    def begin(cls, system: System, start: Result | None, dt: float) -> Clock:
        """At time 0, or where `start` stands."""
        t, x, histories = beginning(system, start)
        return cls((t,), x[None], histories, dt)

    def require_before(self, until: float) -> None:
        """Raise StudyError where the end is not after the start."""
        if until - self.t <= ROUNDING * abs(until):
            raise StudyError(f"until = {until:g}: must be after the start, which is t = {self.t:g}")

    def save(self, path: Path, share: Share, asked: float, marks: Mapping[str, Array]) -> None:
        """Write what a restart needs, on any number of processes, atomically.

        asked: length of step that the march was asked for. marks: see `marks_of`.
        """
        state, states = share.whole_state(self.histories), share.whole(self.states)
        parts = {f"history {name}": values for name, values in state.items()}
        steps = {"dt": np.array(self.dt), "asked": np.array(asked)}
        if share.first:
            arrays = {"times": np.array(self.times), "states": states, **steps, **parts}
            write_arrays(path, {**arrays, **marks})

    @classmethod
    def load(cls, path: Path, system: System, asked: float) -> Clock:
        """Clock that `save` wrote.  Raises StudyError if it does not belong to the study.

        If another length of step is asked for than at that time, the next step has it.
        """
        found = read_arrays(path)
        if found is None:
            raise StudyError(f"restart: {str(path)!r} is missing or damaged")
        for mark, value in marks_of(system.everywhere).items():
            if not np.array_equal(found.get(mark, ()), value):
                raise StudyError(f"restart: {str(path)!r} is of another study: other {mark}")
        histories = {n[8:]: v for n, v in found.items() if n.startswith("history ")}
        states, times = system.share.own(found["states"]), tuple(found["times"].tolist())
        dt = float(found["dt"]) if found["asked"] == asked else asked
        return cls(times, states, system.share.own_state(histories), dt)


def marks_of(system: System) -> dict[str, Array]:
    """Marks of the study that a checkpoint belongs to: part -> digest."""
    nodal, layout = system.numbering.nodal, system.numbering.layout
    parts: dict[str, list[object]] = {
        "nodes or cells": [system.mesh.points, *chain(*sorted(system.mesh.cells.items()))],
        "pages or elements": [
            item
            for block in system.blocks.values()
            for item in (block.name, block.kernel.signature, sorted(block.shared), block.nodes)
        ],
        "unknowns": [layout.counts, *(name for name in layout.names if name in nodal)],
    }
    return {name: _digest(items) for name, items in parts.items()}


def _digest(items: Iterable[object]) -> Array:
    """The bytes of a hash, as numbers."""
    found = sha256()
    for item in items:
        found.update(item.tobytes() if isinstance(item, np.ndarray) else repr(item).encode())
    return np.frombuffer(found.digest(), dtype=np.uint8).astype(np.float64)


@dataclass(frozen=True)
class March:
    """Settings of a march.

    method: "euler" (backward, order 1) or "bdf2" (order 2, of variable steps). tolerance: largest
    local error of a step relative to the largest value of each unknown; None for equal steps.
    dt: length of step that is asked for. record: whether results keep the steps before them.
    before: what the first goes on from.
    """

    method: Method
    tolerance: float | None
    dt: float
    newton: Newton
    record: bool = False
    before: Trail | None = None

    def run(
        self, system: System, clock: Clock, until: float, checkpoint: Path | None
    ) -> Iterator[Result]:
        """Every converged step until the end.  Raises NotConverged."""
        length = until - clock.t
        if length <= 0.0:
            return
        shortest = min(length, SMALLEST * self.dt)  # longer ones may be cut
        with np.errstate(all="ignore"):
            posed = system.problem(self.posed(system, clock, shortest))
            require_held(system, posed, clock.states[0])
        first_step, over = SupportCheck(self.newton), ROUNDING * length
        kept = first_step.memory if self.record else None
        way = _ByTime(self, first_step, system, clock, until, over, kept)
        log = PathLog("t")
        marks = {} if checkpoint is None else marks_of(system.everywhere)
        for _ in path_points(way, StepRule(self.dt, SMALLEST * self.dt), log):
            log.points = log.points[-1:]  # a march may be long
            if way.result is None:
                continue  # it stands at the start
            if checkpoint is not None:
                way.clock.save(checkpoint, system.share, self.dt, marks)
            yield way.result
        if not log.branch().converged:
            raise NotConverged(log.branch(), way.result)

    def posed(self, system: System, clock: Clock, dt: float) -> Step:
        """The step of length dt: du/dt = rate u + rest."""
        steps = [dt]
        if self.method == "bdf2" and len(clock.times) > 1:
            steps.append(clock.times[0] - clock.times[1])
        rate, *weights = differences(steps).tolist()
        rest = np.einsum("k,kn->n", weights, clock.states[: len(weights)])
        old, history = clock.states[0], clock.histories
        return Step(clock.t + dt, 1.0, old, rate, rest, dt, history, weights=tuple(weights))

    def factor(self, system: System, clock: Clock, step: Step, problem: Any, x: Array) -> float:
        """By how much the next step may be longer; below 1 where the error is too large.

        Components of a vector are one field. A field whose error Newton's method does not see in
        the equations, beside their loads, has none. Nor have forces of contacts and ties, which
        follow from the motion and jump where bodies meet.
        """
        order = _ORDER[self.method] if len(clock.times) > 1 else 1
        if self.tolerance is None or len(clock.times) <= order:
            return 1.0
        difference = x - _extrapolated(clock, step.t, order + 1)
        # of the difference from the polynomial through the states before, which has its own error
        share = 2.0 / 11.0
        if order == 1:
            share = step.dt / (step.dt + clock.times[0] - clock.times[1])
        worst = 0.0
        rated = {slot.name for block in system.blocks.values() for slot in block.rates.values()}
        layout, forces = system.numbering.layout, _constraint_forces(system)
        for names, part in zip(layout.vectors, layout.fields, strict=True):
            if (rated and rated.isdisjoint(names)) or not forces.isdisjoint(names):
                continue  # it follows from the others, and its start may be anything
            size, off = (_largest(system, values[part]) for values in (x, difference))
            error = share * off / max(size, 1e-300)
            if error > self.tolerance:
                wrong = x.copy()
                wrong[part] -= share * difference[part]
                with np.errstate(all="ignore"):
                    seen = problem.measure(wrong, problem.linearise(x)[1])
                error = error if seen > self.newton.tolerance else 0.0
            worst = max(worst, error)
        if worst == 0.0:
            return _GROWTH
        return float(_SAFETY * math.pow(self.tolerance / worst, 1.0 / (order + 1)))


@dataclass(eq=False)
class _ByTime(Stepper):
    """clock: where it stands; over: time left before the end that is none; kept: the linear solver
    of a march that is recorded; result: of the last step, None at the start; again: the last
    attempt failed, so that the next one is as long as it is told.
    """

    march: March
    first_step: SupportCheck
    system: System
    clock: Clock
    until: float
    over: float
    kept: LastFactorisation | None = None
    result: Result | None = None
    again: bool = False
    _tried: tuple[Step, Any] | None = None

    def start(self) -> StepAttempt:
        """See `Stepper`."""
        return StepAttempt.solved(self.clock.t, self.clock.states[0], self.clock.dt)

    def attempt(self, step: float) -> StepAttempt:
        """A step in time; refused where its error is too large."""
        left = self.until - self.clock.t
        dt = step if self.again else towards(left, step)
        posed = self.march.posed(self.system, self.clock, dt)
        problem = self.system.problem(posed)
        with np.errstate(all="ignore"):
            guess = _extrapolated(self.clock, posed.t)
            solution = self.first_step.newton.solve(problem, guess)
        self._tried = posed, problem
        next_step = 0.5 * dt
        if solution.converged:
            factor = self.march.factor(self.system, self.clock, posed, problem, solution.x)
            next_step = self._next_step(dt, step, factor)
            if factor < 1.0:
                words = "the local error is above its tolerance"
                solution = replace(solution, status=Status.REFUSED, message=words)
        self.again = not solution.converged
        return StepAttempt(posed.t, solution, dt, next_step)

    def accept(self, attempt: StepAttempt) -> None:
        """Commit what points remember, and set the clock."""
        if self._tried is None:
            return
        (posed, problem), solution, system = self._tried, attempt.solution, self.system
        self.first_step.check(problem, solution)
        after = system.committed(problem, solution.x, self.clock.histories)
        states = np.vstack([solution.x, self.clock.states])[:3]
        times = (posed.t, *self.clock.times)[:3]
        assert attempt.next_step is not None
        self.clock = Clock(times, states, after, attempt.next_step)
        problem = problem.at(solution.x)
        before = self.result.trail if self.result else self.march.before
        known = before if self.kept else None, self.kept, iterating(self.march.newton.linear)
        trail = Trail(system, posed, problem, solution.x, *known)
        self.result = Result(system, problem, Point(posed.t, solution), after, trail)

    def end(self) -> End | None:
        """See `Stepper`."""
        if self.until - self.clock.t > self.over:
            return None
        return Status.CONVERGED, f"reached t = {self.clock.t:.9g}"

    def _next_step(self, dt: float, step: float, factor: float) -> float:
        """Length of the next step after one of length dt, when `step` was offered."""
        if self.march.tolerance is not None:
            return min(max(factor, _CUT), _GROWTH) * dt
        wanted = dt if self.again else max(step, dt)
        return min(_GROWTH * wanted, self.march.dt) if wanted < self.march.dt else wanted


def _constraint_forces(system: System) -> set[str]:
    """Names of the unknowns of contacts and ties."""
    if system.statement is None:
        return set()
    found = {f.label for f in system.statement.forces if isinstance(f.kernel, Tie)}
    for touch in system.statement.contacts:
        found.update(map(touch.unknown, MULTIPLIERS[system.mesh.dimension]))
    return found


def _largest(system: System, values: Array) -> float:
    return system.share.largest(float(np.abs(values).max(initial=0.0)))


def towards(left: float, dt: float) -> float:
    """A step of about dt that does not leave a sliver before the end."""
    if left <= dt * (1.0 + 1e-9):
        return left
    return min(dt, 0.5 * left) if left < 2.0 * dt and left > dt * (1.0 + 1e-9) else dt


def _extrapolated(clock: Clock, t: float, count: int = 2) -> Array:
    """Unknowns at t on the polynomial through the last states, at most `count` of them."""
    return polynomial_value(clock.times[:count], clock.states[:count], t)
