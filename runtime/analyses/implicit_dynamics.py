"""Implicit steps of a body in motion: generalised-alpha, Newmark's rule, the midpoint rule."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from softehl.runtime.analyses.equations_of_motion import Body
from softehl.runtime.analyses.initial_state import SMALLEST
from softehl.runtime.analyses.motion import (
    Forces,
    Ledger,
    Motion,
    parameter_work,
    stored_energy,
)
from softehl.runtime.analyses.time_integrators import Scheme
from softehl.runtime.analyses.time_stepping import ROUNDING, towards
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.equations.system import Step
from softehl.runtime.solve.continuation import (
    End,
    PathLog,
    StepAttempt,
    Stepper,
    StepRule,
    path_points,
)
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import NotConverged, Point, Solution, Status


@dataclass(frozen=True, eq=False)
class Phase:
    """State of a motion: time, unknowns, velocities, accelerations (n,), point data."""

    t: float
    x: Array
    v: Array
    a: Array
    histories: Mapping[str, Array]

    def step(self, t: float) -> Step:
        """A step to t in which nothing moves yet."""
        return Step(t, 1.0, self.x, 0.0, self.v, t - self.t, self.histories)

    def standing(self, dt: float) -> Step:
        """The present, as the end of a step of length dt with the present velocities."""
        return Step(self.t, 1.0, self.x - dt * self.v, 0.0, self.v, dt, self.histories)


@dataclass(frozen=True)
class Implicit:
    """Settings: scheme, length of step, Newton's method."""

    scheme: Scheme
    dt: float
    newton: Newton

    def run(
        self, body: Body, begin: Phase, until: float, end: Problem | None = None
    ) -> Iterator[Motion]:
        """Every converged step until the end.  Raises NotConverged.

        end: equations without inertia of a step that ended at the beginning, if there was one.
        """
        log, way = PathLog("t"), _Way(self, body, begin, until, Ledger(body.share), plain=end)
        for _ in path_points(way, StepRule(self.dt, SMALLEST * self.dt), log):
            log.points = log.points[-1:]
            if way.result is not None:
                yield way.result
        if not log.branch().converged:
            raise NotConverged(log.branch(), way.result)


@dataclass(frozen=True, eq=False)
class _Tried:
    """A step that was solved, and its equations."""

    step: Step
    problem: Problem


@dataclass(eq=False)
class _Way(Stepper):
    """last: where it stands; plain: its equations without inertia; forces, supports: there, (n,),
    without ties and contacts, and but for averaged ones.
    """

    settings: Implicit
    body: Body
    last: Phase
    until: float
    ledger: Ledger
    result: Motion | None = None
    plain: Problem | None = None
    forces: Forces | None = None
    supports: Array = field(default_factory=lambda: np.empty(0))
    tried: _Tried | None = None

    def start(self) -> StepAttempt:
        """See `Stepper`."""
        here = self.last
        end = self.plain or self.body.at_end(here.standing(self.settings.dt), here.v)
        self._stand(end, here, Forces.of(end, here.x, self.body.roles))
        self._energies(end)
        return StepAttempt.solved(here.t, here.x, self.settings.dt)

    def attempt(self, step: float) -> StepAttempt:
        """A step in time."""
        here, scheme = self.last, self.settings.scheme
        dt = towards(self.until - here.t, step)
        state = (dt, here.x, here.v, here.a)
        rate, inertial = scheme.rate(*state), self.body.masked(scheme.inertial(*state))
        posed = replace(
            here.step(here.t + dt),
            rate=rate.c,
            rest=rate.rest,
            acceleration=inertial.c,
            remainder=inertial.rest,
        )
        assert self.forces is not None
        problem = self.body.problem(posed, scheme.place(), scheme.before() * self.forces.total)
        newton, asked = self.settings.newton, self.body.moving.share.posed(problem)
        x = self.body.weighted(here.x, 1.0 / self.body.weight)
        with np.errstate(all="ignore"):
            solution = newton.solve(asked, x + dt * here.v)
            if not solution.converged:  # it may be beyond what the body admits
                solution = newton.solve(asked, x)
        solution = replace(solution, x=self.body.weighted(solution.x, self.body.weight))
        self.tried = _Tried(posed, problem)
        next_step = min(2.0 * dt, self.settings.dt) if solution.converged else 0.5 * dt
        return StepAttempt(posed.t, solution, dt, next_step)

    def accept(self, attempt: StepAttempt) -> None:
        """Commit what points remember, and move on."""
        if self.tried is None:
            return
        here, scheme, tried, x = self.last, self.settings.scheme, self.tried, attempt.solution.x
        state = (tried.step.dt, here.x, here.v, here.a)
        heavy = self.body.heavy
        v = np.where(heavy, scheme.velocity(*state).at(x), 0.0)
        a = np.where(heavy, scheme.acceleration(*state).at(x), 0.0)
        end = self.body.at_end(tried.step, v)
        histories = self.body.plain.committed(end, x, here.histories)
        after = Phase(tried.step.t, x, v, a, histories)
        before, held, plain = self.forces, self.supports, self.plain
        self._stand(end, after, Forces.of(end, x, self.body.roles))
        assert before is not None
        assert plain is not None
        assert self.forces is not None
        middle = None
        if scheme.averaged:
            still = replace(tried.step, acceleration=0.0, remainder=None)
            middle = self.body.problem(still, scheme.place(), 0.0 * x)
            mean = Forces.of(middle, x, self.body.roles)
            held = _at(end, mean.total + self.body.M @ scheme.acceleration(*state).at(x))
        else:
            mean = before.mean(self.forces)
            held = 0.5 * (held + self.supports)
        held = held + _at(end, mean.constraints)
        moved = x - here.x
        self.ledger.add(mean, held, moved)
        self.ledger.others += self.body.friction(end, x, moved)
        self.ledger.external += parameter_work(plain, end, self.body.roles, (here.x, x), middle)
        self.result = self._motion(end, after, attempt.solution)

    def end(self) -> End | None:
        """See `Stepper`."""
        if self.until - self.last.t > ROUNDING * abs(self.until):
            return None
        return Status.CONVERGED, f"reached t = {self.last.t:.9g}"

    def _stand(self, end: Problem, phase: Phase, forces: Forces) -> None:
        self.last, self.plain, self.forces = phase, end, forces
        self.supports = _at(end, forces.total + self.body.M @ phase.a)

    def _energies(self, end: Problem) -> dict[str, float]:
        v, x = self.last.v, self.last.x
        kinetic = 0.5 * float(v @ (self.body.M @ v))
        stored = stored_energy(end, x, self.body.roles)
        assert self.forces is not None
        return self.ledger.told(self.last.t, kinetic, stored, self.forces, x)

    def _motion(self, end: Problem, phase: Phase, solution: Solution) -> Motion:
        point, energy = Point(phase.t, solution), self._energies(end)
        system, end = self.body.plain, self.body.share.posed(end.at(phase.x))
        return Motion(
            *(system, end, point, phase.histories),
            v=phase.v, a=phase.a, energy=energy, scheme=self.settings.scheme,
            mass=self.body.mass,
        )  # fmt: skip


def _at(problem: Problem, forces: Array) -> Array:
    """Forces (n,) of supports: those on prescribed unknowns."""
    found = np.zeros_like(forces)
    found[problem.fixed] = forces[problem.fixed]
    return found
