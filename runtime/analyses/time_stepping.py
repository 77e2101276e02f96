"""Time stepping: a march by any integrator; steps of first order adapt, commit history, restart."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from softehl.runtime.analyses.callbacks import Series
from softehl.runtime.analyses.dynamics import march_with_inertia
from softehl.runtime.analyses.initial_state import SMALLEST, initial_state
from softehl.runtime.analyses.solver_options import SolverOptions
from softehl.runtime.analyses.time_integrators import (
    INTEGRATORS,
    ROUNDING,
    FirstOrderIntegrator,
    MethodName,
    TimeIntegrator,
    integrator_of,
    require_arguments,
    step_before_end,
)
from softehl.runtime.arrays import Array
from softehl.runtime.definition.argument_checks import finite, writable
from softehl.runtime.definition.contact_sides import MULTIPLIERS
from softehl.runtime.definition.problem_definition import ProblemDefinition, StudyError
from softehl.runtime.discretisation.loads import Tie
from softehl.runtime.equations.rigid_body_modes import require_supported
from softehl.runtime.equations.system import Step, System
from softehl.runtime.results.checkpoint import TimeLevels, digests_of
from softehl.runtime.results.result import Result
from softehl.runtime.sensitivity.tape import Tape, continued_tape
from softehl.runtime.solve.continuation import (
    End,
    PathLog,
    StepAttempt,
    Stepper,
    StepRule,
    path_points,
    polynomial_value,
)
from softehl.runtime.solve.linear.factorisation_cache import iterative_part
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.singularity_check import LastFactorisation, SupportCheck
from softehl.runtime.solve.solution import NotConverged, Point, Status

_GROWTH, _CUT, _SAFETY = 2.0, 0.2, 0.9


def march(
    definition: ProblemDefinition,
    *,
    dt: float,
    until: float,
    method: MethodName | TimeIntegrator = "euler",
    rho_inf: float | None = None,
    options: SolverOptions,
    **arguments: Any,
) -> Iterator[Result]:
    """Return the results of time steps; see `Study.march`.

    arguments: of `march_of_first_order` or `march_with_inertia`; None if left out.
    """
    integrator = integrator_of(method, rho_inf=rho_inf)
    for name, value in (("dt", dt), ("until", until), ("tolerance", arguments.get("tolerance"))):
        if value is not None and finite(name, value) <= 0.0:
            raise StudyError(f"{name} = {value}: must be positive")
    if arguments.get("start") is not None and arguments.get("restart") is not None:
        raise StudyError("start and restart: give one of them, a result or a checkpoint")
    if isinstance(integrator, FirstOrderIntegrator):
        family_arguments = require_arguments(integrator, march_of_first_order, arguments)
        return march_of_first_order(
            definition, integrator, dt=dt, until=until, options=options, **family_arguments
        )
    if options.record:
        raise StudyError(
            f'record = True: a march by "{integrator.name}" has no derivatives, which also fit, '
            f"objective and in_jax need: allowed are {_methods(of_first_order=True)}"
        )
    family_arguments = require_arguments(integrator, march_with_inertia, arguments)
    return march_with_inertia(
        definition, integrator, dt=dt, until=until, options=options, **family_arguments
    )


def march_of_first_order(
    definition: ProblemDefinition,
    integrator: FirstOrderIntegrator,
    *,
    dt: float,
    until: float,
    options: SolverOptions,
    tolerance: float | None = None,
    start: Result | None = None,
    checkpoint: str | Path | None = None,
    restart: str | Path | None = None,
) -> Iterator[Result]:
    """Return the results of steps without inertia.  Raises StudyError, NotConverged."""
    prepared = options.prepare(definition)
    system = prepared.system
    if checkpoint is not None or restart is not None:
        system.mesh.require_whole("checkpoint and restart")
    _require_no_inertia(integrator, system)
    if restart is None:
        initial = initial_state(system, start)
        levels = TimeLevels((initial.t,), initial.x[None], initial.histories, dt)
    else:
        levels = TimeLevels.load(Path(restart), system, dt)
    if until - levels.t <= ROUNDING * abs(until):
        raise StudyError(f"until = {until:g}: must be after the start, which is t = {levels.t:g}")
    settings = AdaptiveMarch(
        integrator,
        tolerance,
        dt,
        prepared.newton,
        record=options.record,
        previous=continued_tape(system, start.trail if start else None),
    )
    file = series = None
    if checkpoint is not None:
        file = writable(f"checkpoint = {str(checkpoint)!r}", Path(checkpoint))
    if isinstance(options.write, str | Path):
        series = Series(Path(options.write), levels.t if levels.t > 0.0 else None)
    callbacks = prepared.callbacks("t", levels.t, until, series=series)
    return callbacks.around(settings.run(system, levels, until, file))


def _require_no_inertia(integrator: TimeIntegrator, system: System) -> None:
    """Raise StudyError where a page has accelerations."""
    for block in system.blocks.values():
        if block.accelerations:
            raise StudyError(
                f'{block.name!r} has accelerations, method = "{integrator.name}" has none: allowed '
                f"are {_methods(of_first_order=False)}"
            )


def _methods(*, of_first_order: bool) -> str:
    """Short names of the integrators of an order, for messages."""
    kinds = INTEGRATORS.items()
    return ", ".join(
        f'"{name}"'
        for name, kind in kinds
        if isinstance(kind(), FirstOrderIntegrator) is of_first_order
    )


@dataclass(frozen=True)
class AdaptiveMarch:
    """March of first order with adaptive steps.

    tolerance: largest local error of a step relative to the largest value of each unknown; None for
    equal steps. dt: requested length of a step. record: results have the tape of the previous
    steps. previous: tape before the first step.
    """

    integrator: FirstOrderIntegrator
    tolerance: float | None
    dt: float
    newton: Newton
    record: bool = False
    previous: Tape | None = None

    def run(
        self, system: System, levels: TimeLevels, until: float, checkpoint: Path | None
    ) -> Iterator[Result]:
        """Yield each converged step.  Raises NotConverged."""
        length = until - levels.t
        if length <= 0.0:
            return
        shortest = min(length, SMALLEST * self.dt)  # longer ones may be cut
        with np.errstate(all="ignore"):
            problem = system.problem(self.step(system, levels, shortest))
            require_supported(system, problem, levels.states[0])
        first_step = SupportCheck(self.newton)
        stepper = _TimeStepper(
            march=self,
            first_step=first_step,
            system=system,
            levels=levels,
            until=until,
            rounding=ROUNDING * length,
            memory=first_step.memory if self.record else None,
        )
        log = PathLog("t")
        digests = {} if checkpoint is None else digests_of(system.everywhere)
        for _ in path_points(stepper, StepRule(self.dt, SMALLEST * self.dt), log):
            log.points = log.points[-1:]  # a march may be long
            if stepper.result is None:
                continue  # the initial state
            if checkpoint is not None:
                stepper.levels.save(checkpoint, system.comm, self.dt, digests)
            yield stepper.result
        if not log.branch().converged:
            raise NotConverged(log.branch(), stepper.result)

    def step(self, system: System, levels: TimeLevels, dt: float) -> Step:
        """The step of length dt: du/dt = rate u + rest."""
        times = levels.times[: self.integrator.order]
        lengths = [dt, *(newer - older for newer, older in pairwise(times))]
        rate, *weights = self.integrator.weights(lengths).tolist()
        rate_offset = np.einsum("k,kn->n", weights, levels.states[: len(weights)])
        return Step(
            t=levels.t + dt,
            factor=1.0,
            old=levels.states[0],
            rate=rate,
            rate_offset=rate_offset,
            dt=dt,
            histories=levels.histories,
            weights=tuple(weights),
        )

    def growth(
        self, system: System, levels: TimeLevels, step: Step, problem: Any, x: Array
    ) -> float:
        """Factor by which the next step may be longer; below 1 where the error is too large.

        Components of a vector are one field. A field whose error Newton's method does not see in
        the equations, beside their loads, has none. Nor have forces of contacts and ties, which
        follow from the motion and jump where bodies meet.
        """
        order = self.integrator.order
        if self.tolerance is None or len(levels.times) <= order:
            return 1.0
        difference = x - _extrapolated(levels, step.t, order + 1)
        two_steps = step.dt + levels.times[0] - levels.times[1]
        fraction = self.integrator.error_fraction(step.dt, two_steps)
        worst = 0.0
        rated = {slot.name for block in system.blocks.values() for slot in block.rates.values()}
        layout, forces = system.numbering.layout, _constraint_forces(system)
        for names, part in zip(layout.vectors, layout.fields, strict=True):
            if (rated and rated.isdisjoint(names)) or not forces.isdisjoint(names):
                continue  # it follows from the others, and its start may be anything
            size, change = (_largest(system, values[part]) for values in (x, difference))
            error = fraction * change / max(size, 1e-300)
            if error > self.tolerance:
                perturbed = x.copy()
                perturbed[part] -= fraction * difference[part]
                with np.errstate(all="ignore"):
                    residual = problem.measure(perturbed, problem.linearise(x)[1])
                error = error if residual > self.newton.tolerance else 0.0
            worst = max(worst, error)
        if worst == 0.0:
            return _GROWTH
        return float(_SAFETY * math.pow(self.tolerance / worst, 1.0 / (order + 1)))


@dataclass(eq=False)
class _TimeStepper(Stepper):
    """Stepper of a march; holds the last time levels.

    rounding: remaining time that counts as none. memory: linear solver of a march that is recorded.
    result: of the last step, None at the start. again: the last attempt failed, so that the next
    one has the length that is offered.
    """

    march: AdaptiveMarch
    first_step: SupportCheck
    system: System
    levels: TimeLevels
    until: float
    rounding: float
    memory: LastFactorisation | None = None
    result: Result | None = None
    again: bool = False
    _attempt: tuple[Step, Any] | None = None

    def start(self) -> StepAttempt:
        """See `Stepper`."""
        return StepAttempt.solved(self.levels.t, self.levels.states[0], self.levels.dt)

    def attempt(self, step: float) -> StepAttempt:
        """A step in time; refused where its error is too large."""
        remaining = self.until - self.levels.t
        dt = step if self.again else step_before_end(remaining, step)
        time_step = self.march.step(self.system, self.levels, dt)
        problem = self.system.problem(time_step)
        with np.errstate(all="ignore"):
            guess = _extrapolated(self.levels, time_step.t)
            solution = self.first_step.newton.solve(problem, guess)
        self._attempt = time_step, problem
        next_step = 0.5 * dt
        if solution.converged:
            growth = self.march.growth(self.system, self.levels, time_step, problem, solution.x)
            next_step = self._next_step(dt, step, growth)
            if growth < 1.0:
                message = "the local error is above its tolerance"
                solution = replace(solution, status=Status.REFUSED, message=message)
        self.again = not solution.converged
        return StepAttempt(time_step.t, solution, dt, next_step)

    def accept(self, attempt: StepAttempt) -> None:
        """Commit history and the time level."""
        if self._attempt is None:
            return
        (step, problem), solution, system = self._attempt, attempt.solution, self.system
        self.first_step.check(problem, solution)
        histories = system.committed(problem, solution.x, self.levels.histories)
        states = np.vstack([solution.x, self.levels.states])[:3]
        times = (step.t, *self.levels.times)[:3]
        assert attempt.next_step is not None
        self.levels = TimeLevels(times, states, histories, attempt.next_step)
        problem = problem.at(solution.x)
        previous = self.result.trail if self.result else self.march.previous
        tape = Tape(
            system,
            step,
            problem,
            solution.x,
            previous=previous if self.memory else None,
            last_factors=self.memory,
            linear=iterative_part(self.march.newton.linear),
        )
        self.result = Result(system, problem, Point(step.t, solution), histories, tape)

    def end(self) -> End | None:
        """See `Stepper`."""
        if self.until - self.levels.t > self.rounding:
            return None
        return Status.CONVERGED, f"reached t = {self.levels.t:.9g}"

    def _next_step(self, dt: float, step: float, growth: float) -> float:
        """Length of the next step after one of length dt, when `step` was offered."""
        if self.march.tolerance is not None:
            return min(max(growth, _CUT), _GROWTH) * dt
        target = dt if self.again else max(step, dt)
        return min(_GROWTH * target, self.march.dt) if target < self.march.dt else target


def _constraint_forces(system: System) -> set[str]:
    """Names of the unknowns of contacts and ties."""
    if system.definition is None:
        return set()
    names = {f.label for f in system.definition.forces if isinstance(f.kernel, Tie)}
    for contact in system.definition.contacts:
        names.update(map(contact.unknown, MULTIPLIERS[system.mesh.dimension]))
    return names


def _largest(system: System, values: Array) -> float:
    return system.comm.max(float(np.abs(values).max(initial=0.0)))


def _extrapolated(levels: TimeLevels, t: float, count: int = 2) -> Array:
    """Unknowns at t on the polynomial through the last states, at most `count` of them."""
    return polynomial_value(levels.times[:count], levels.states[:count], t)
