"""Dynamics: a march with inertia, its consistent initial state, and implicit steps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from softehl.log import warn
from softehl.runtime.analyses.equations_of_motion import EquationsOfMotion, names_of
from softehl.runtime.analyses.explicit_dynamics import ExplicitMarch
from softehl.runtime.analyses.initial_state import SMALLEST, initial_state
from softehl.runtime.analyses.motion import (
    EnergyBalance,
    Forces,
    Motion,
    MotionState,
    parameter_work,
    stored_energy,
)
from softehl.runtime.analyses.solver_options import SolverOptions
from softehl.runtime.analyses.time_integrators import (
    ROUNDING,
    Affine,
    BackwardEulerDynamics,
    CentralDifference,
    SecondOrderIntegrator,
    step_before_end,
)
from softehl.runtime.arrays import Array
from softehl.runtime.contact.pair_law import LawContact
from softehl.runtime.contact.penalty import with_penalty
from softehl.runtime.definition.argument_checks import datum, require_names
from softehl.runtime.definition.problem_definition import Datum, ProblemDefinition, StudyError
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.equations.mass_matrix import Masses
from softehl.runtime.equations.system import Step, System
from softehl.runtime.results.result import Result
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


class UnbalancedStart(RuntimeWarning):
    """A motion starts with unknowns without mass, such as pressures, that are in no equilibrium."""


_SUPPORT_STEP, _SUPPORT_STEP_OF_RATES = 1e-6, 1e-3
"""Of a step: initial velocities of supports are differences over the first, their accelerations
second ones over the other, which rounding spoils in shorter steps."""
_CONSISTENT_STEP = 0.1  # of a step: shorter ones find a consistent start, with this error
_SLOW = 0.01
"""Of the time 1 / w of the fastest motion of the mesh: such short steps move nodes by an error of
the square of that, relative to what accelerations do. At 0.1 a slow load on a stiff body began with
1e-2 of the accelerations in error; smaller ones lose digits.
"""


def march_with_inertia(
    definition: ProblemDefinition,
    integrator: SecondOrderIntegrator | CentralDifference,
    *,
    dt: float,
    until: float,
    options: SolverOptions,
    mass: Masses | None = None,
    velocity: Mapping[str, Datum] | None = None,
    start: Result | None = None,
) -> Iterator[Result]:
    """Return the motions of steps with inertia.  Raises StudyError, NotConverged."""
    prepared = options.prepare(definition)
    system, newton = prepared.system, prepared.newton
    for contact in system.contacts:
        if isinstance(contact, LawContact):
            raise StudyError(
                f"{contact.name!r}: a contact by law=... has no march with inertia: march by "
                '"euler" or "bdf2", solve in steps, or take the contact without law='
            )
    if isinstance(integrator, CentralDifference):
        contacts = tuple(with_penalty(contact) for contact in system.contacts)  # type: ignore[arg-type]
        system = replace(system, contacts=contacts)
    initial = initial_state(system, start)
    if until <= initial.t:
        raise StudyError(f"until = {until:g}: must be after the start, which is t = {initial.t:g}")
    v = _initial_velocities(system, start, velocity or {})
    state = MotionState(initial.t, initial.x, v, np.zeros_like(initial.x), initial.histories)
    at_rest = Step(state.t, 1.0, state.x, 0.0, v, dt, state.histories)
    implicit = None if isinstance(integrator, CentralDifference) else integrator
    body = EquationsOfMotion.of(system, mass, implicit, at_rest)
    if isinstance(integrator, CentralDifference):
        state = _with_supports(body, state, body.at_end(at_rest, v), dt)
        motions = ExplicitMarch.of(integrator, dt, body, state).run(until)
    elif isinstance(start, Motion) and not velocity and _continues(body, start, integrator):
        motions = _continued(ImplicitMarch(integrator, dt, newton), body, start, state, until)
    else:
        problem = body.at_end(at_rest, v)
        state = _with_supports(body, state, problem, dt)
        state = _consistent_state(body, state, problem, dt, newton)
        motions = ImplicitMarch(integrator, dt, newton).run(body, state, until)
    return prepared.callbacks("t", initial.t, until).around(motions)


def _initial_velocities(system: System, start: Result | None, values: Mapping[str, Datum]) -> Array:
    """Velocities at the start, (n,): those of `start`, and those that are given."""
    v, nodal = np.zeros(system.size), system.numbering.nodal
    if isinstance(start, Motion):
        v = _nodal_rates(system, start, start.velocity)
    require_names("unknown", values, nodal, "velocity")
    for name, dofs in nodal.items():
        mask = dofs >= 0
        if name in values:
            v[dofs[mask]] = datum("velocity", name, values[name], system.mesh.points[mask])
    return v


def _nodal_rates(system: System, start: Motion, rates: Callable[[str], Array]) -> Array:
    """Rates (n,) of the unknowns of a system, by their names at the nodes of a motion."""
    values = np.zeros(system.size)
    for name, dofs in system.numbering.nodal.items():
        if name in start.system.numbering.nodal:
            mask = dofs >= 0
            values[dofs[mask]] = np.nan_to_num(rates(name)[mask])
    return values


def _continues(body: EquationsOfMotion, start: Motion, integrator: SecondOrderIntegrator) -> bool:
    """True if the start is a motion of the same study by the same integrator: it continues as if
    it had not stopped.
    """
    system, previous = body.static_system, start.system
    if start.scheme != integrator:
        return False
    if start.mass is not body.mass and repr(start.mass) != repr(body.mass):
        return False
    same = (
        previous.definition is system.definition
        and previous.definition_size == system.definition_size
    )
    return same and system.definition is not None


def _continued(
    march: ImplicitMarch, body: EquationsOfMotion, start: Motion, state: MotionState, until: float
) -> Iterator[Motion]:
    """Continue a motion with its accelerations and forces."""
    system = body.static_system
    if system.comm.rank_and_size[1] > 1:  # of which each has its own unknowns
        a = _nodal_rates(system, start, start.acceleration)
        return march.run(body, replace(state, a=a), until)
    state = replace(state, x=start.x, v=start.v, a=start.a)
    return march.run(body, state, until, system.comm.local_problem(start.problem))


def _with_supports(
    body: EquationsOfMotion, state: MotionState, problem: Problem, dt: float
) -> MotionState:
    """The state with prescribed values and their velocities; massless unknowns have none."""
    x, v, step = problem.admissible(state.x), state.v.copy(), _SUPPORT_STEP * dt
    later = body.static_system.local_problem(
        Step(state.t + step, 1.0, x, 0.0, state.v, dt, state.histories)
    )
    v[problem.fixed] = (later.values - problem.values) / step
    v[~body.has_mass] = 0.0
    return replace(state, x=x, v=v)


def _consistent_state(
    body: EquationsOfMotion, state: MotionState, problem: Problem, dt: float, newton: Newton
) -> MotionState:
    """The state with unknowns without mass and multipliers in equilibrium, and accelerations.

    problem: equations without inertia at the state.
    """
    if body.comm.max(float(body.constrained.any())):
        state = _constrained_state(body, state, dt, newton)
    elif body.comm.max(float(body.algebraic(problem).any())):
        state = _with_massless_equilibrium(body, problem, state, newton)
    problem = body.at_end(state.ended_step(dt), state.v)
    moved = _support_accelerations(body, state, problem, dt)
    return replace(state, a=body.initial_accelerations(problem, state.x, moved))


def _support_accelerations(
    body: EquationsOfMotion, state: MotionState, problem: Problem, dt: float
) -> Array:
    """Accelerations (n,) of prescribed values that begin to move, zero elsewhere."""
    a, step = np.zeros_like(state.x), _SUPPORT_STEP_OF_RATES * dt
    first, second = (
        body.static_system.local_problem(
            Step(state.t + k * step, 1.0, state.x, 0.0, state.v, dt, state.histories)
        ).values
        for k in (1, 2)
    )
    a[problem.fixed] = (second - 2.0 * first + problem.values) / step**2
    a[~body.has_mass] = 0.0
    return a


def _constrained_state(
    body: EquationsOfMotion, state: MotionState, dt: float, newton: Newton
) -> MotionState:
    """The state that supports, ties and contacts admit, with the unknowns without mass.

    Of three short steps of backward Euler the first finds the displacements, the second, again with
    the given velocities, the velocities, and the third the forces.
    """
    h = min(_CONSISTENT_STEP * dt, _SLOW / body.highest_frequency(state.ended_step(dt)))
    short = EquationsOfMotion.of(
        body.static_system, body.mass, BackwardEulerDynamics(), state.ended_step(dt)
    )
    first, _ = _backward_euler_step(short, state, h, newton)
    second, v = _backward_euler_step(short, replace(first, v=state.v), h, newton)
    third, later_v = _backward_euler_step(short, replace(second, v=v), h, newton)
    x = np.where(body.has_mass, first.x - h * v, third.x)
    return replace(state, x=x, v=2.0 * v - later_v)


def _with_massless_equilibrium(
    body: EquationsOfMotion, problem: Problem, state: MotionState, newton: Newton
) -> MotionState:
    """The state in which unknowns without mass satisfy their equations.

    Warns where none is found, and returns the state as it is.
    """
    x = state.x
    fixed = np.union1d(problem.fixed, np.flatnonzero(body.has_mass))
    massless = replace(problem, fixed=fixed, values=x[fixed])
    with np.errstate(all="ignore"):
        solution = newton.solve(body.comm.distribute(massless), x)
    if solution.converged:
        return replace(state, x=solution.x)
    names = names_of(body.static_system, body.algebraic(problem))
    if body.comm.is_root:
        warn(
            f"t = {state.t:.6g}: {names} has no mass, and no equilibrium of it was found at the "
            f"start ({solution.message}), so that it begins with the values of the start: begin "
            "with a solved state (start=study.solve(...)), or give the unknowns initial values "
            "near their equilibrium",
            UnbalancedStart,
            stacklevel=4,
        )
    return state


def _backward_euler_step(
    body: EquationsOfMotion, state: MotionState, h: float, newton: Newton
) -> tuple[MotionState, Array]:
    """The end of a step of length h, and the velocities there.  Raises StudyError."""
    integrator = BackwardEulerDynamics()
    step, velocity = _implicit_step(integrator, body, state, h)
    problem = body.dynamic_system.comm.distribute(body.problem(step, 1.0, 0.0 * state.x))
    with np.errstate(all="ignore"):
        solution = newton.solve(problem, state.x)
    if not solution.converged:
        raise StudyError(
            f"t = {state.t:.6g}: no accelerations at the start go with its supports, ties and "
            f"contacts: {solution.message}"
        )
    v = np.where(body.has_mass, velocity.at(solution.x), 0.0)
    return replace(state, t=state.t + h, x=solution.x), v


def _implicit_step(
    integrator: SecondOrderIntegrator, body: EquationsOfMotion, state: MotionState, dt: float
) -> tuple[Step, Affine]:
    """A step of length dt from a state, and the velocity in its equation."""
    velocity = integrator.equation_velocity(dt, state)
    acceleration = body.masked(integrator.equation_acceleration(dt, state))
    step = replace(
        state.step(state.t + dt),
        rate=velocity.c,
        rate_offset=velocity.constant,
        acceleration=acceleration.c,
        acceleration_offset=acceleration.constant,
    )
    return step, velocity


@dataclass(frozen=True)
class ImplicitMarch:
    """March by an implicit integrator: length of step, Newton's method."""

    integrator: SecondOrderIntegrator
    dt: float
    newton: Newton

    def run(
        self, body: EquationsOfMotion, state: MotionState, until: float, end: Problem | None = None
    ) -> Iterator[Motion]:
        """Yield each converged step.  Raises NotConverged.

        end: equations without inertia of the step that ended at the state, if there was one.
        """
        ledger, log = EnergyBalance(body.comm), PathLog("t")
        stepper = _ImplicitStepper(self, body, state, until, ledger, equations=end)
        for _ in path_points(stepper, StepRule(self.dt, SMALLEST * self.dt), log):
            log.points = log.points[-1:]
            if stepper.result is not None:
                yield stepper.result
        if not log.branch().converged:
            raise NotConverged(log.branch(), stepper.result)


@dataclass(eq=False)
class _ImplicitStepper(Stepper):
    """Stepper of an implicit march; holds the last state.

    equations: at the state, without inertia. forces, supports: there, (n,), without ties and
    contacts, and without averaged ones. holding: there, (n,), of supports, ties and springs.
    """

    march: ImplicitMarch
    body: EquationsOfMotion
    state: MotionState
    until: float
    ledger: EnergyBalance
    result: Motion | None = None
    equations: Problem | None = None
    forces: Forces | None = None
    supports: Array = field(default_factory=lambda: np.empty(0))
    holding: Array = field(default_factory=lambda: np.empty(0))
    _attempt: Step | None = None

    def start(self) -> StepAttempt:
        """See `Stepper`."""
        state, dt = self.state, self.march.dt
        end = self.equations or self.body.at_end(state.ended_step(dt), state.v)
        self._set_state(end, state, Forces.of(end, state.x, self.body.roles))
        self._energies(end)
        return StepAttempt.solved(state.t, state.x, dt)

    def attempt(self, step: float) -> StepAttempt:
        """A step in time."""
        state, body, integrator = self.state, self.body, self.march.integrator
        dt = step_before_end(self.until - state.t, step)
        time_step, _ = _implicit_step(integrator, body, state, dt)
        assert self.forces is not None
        initial_forces = integrator.initial_weight * self.forces.total
        problem = body.problem(time_step, integrator.load_time, initial_forces)
        newton, distributed = self.march.newton, body.dynamic_system.comm.distribute(problem)
        x = body.weighted(state.x, 1.0 / body.weight)
        with np.errstate(all="ignore"):
            solution = newton.solve(distributed, x + dt * state.v)
            if not solution.converged:  # it may be beyond what the body admits
                solution = newton.solve(distributed, x)
        solution = replace(solution, x=body.weighted(solution.x, body.weight))
        self._attempt = time_step
        next_step = min(2.0 * dt, self.march.dt) if solution.converged else 0.5 * dt
        return StepAttempt(time_step.t, solution, dt, next_step)

    def accept(self, attempt: StepAttempt) -> None:
        """Commit history and the state, and add up the work of the step."""
        if self._attempt is None:
            return
        previous, body, step, x = self.state, self.body, self._attempt, attempt.solution.x
        integrator = self.march.integrator
        acceleration = integrator.acceleration(step.dt, previous).at(x)
        v = np.where(body.has_mass, integrator.velocity(step.dt, previous).at(x), 0.0)
        a = np.where(body.has_mass, acceleration, 0.0)
        end = body.at_end(step, v)
        histories = body.static_system.committed(end, x, previous.histories)
        initial_forces, supports, initial_equations = self.forces, self.supports, self.equations
        state = MotionState(step.t, x, v, a, histories)
        self._set_state(end, state, Forces.of(end, x, body.roles))
        assert initial_forces is not None
        assert initial_equations is not None
        assert self.forces is not None
        middle = None
        if integrator.averages_forces:
            without_inertia = replace(step, acceleration=0.0, acceleration_offset=None)
            middle = body.problem(without_inertia, integrator.load_time, 0.0 * x)
            mean = Forces.of(middle, x, body.roles)
            supports = _at_supports(end, mean.total + body.M @ acceleration)
            springs = 0.5 * (initial_forces.springs + self.forces.springs)
            holding = mean.total - springs + self.forces.contact + body.M @ acceleration
        else:
            holding = self.holding
            mean = initial_forces.mean(self.forces)
            supports = 0.5 * (supports + self.supports)
        supports = supports + _at_supports(end, mean.constraints)
        displacement = x - previous.x
        self.ledger.add(mean, supports, displacement)
        self.ledger.others += body.friction_work(end, x, displacement)
        self.ledger.external += parameter_work(
            initial_equations, end, body.roles, (previous.x, x), middle
        )
        self.result = self._motion(end, state, attempt.solution, holding)

    def end(self) -> End | None:
        """See `Stepper`."""
        if self.until - self.state.t > ROUNDING * abs(self.until):
            return None
        return Status.CONVERGED, f"reached t = {self.state.t:.9g}"

    def _set_state(self, end: Problem, state: MotionState, forces: Forces) -> None:
        self.state, self.equations, self.forces = state, end, forces
        inertia = self.body.M @ state.a
        self.supports = _at_supports(end, forces.total + inertia)
        self.holding = forces.unheld + forces.contact + inertia

    def _energies(self, end: Problem) -> dict[str, float]:
        v, x = self.state.v, self.state.x
        kinetic = 0.5 * float(v @ (self.body.M @ v))
        stored = stored_energy(end, x, self.body.roles)
        assert self.forces is not None
        return self.ledger.balance(self.state.t, kinetic, stored, self.forces, x)

    def _motion(
        self, end: Problem, state: MotionState, solution: Solution, holding: Array
    ) -> Motion:
        return Motion(
            self.body.static_system,
            self.body.comm.distribute(end.at(state.x)),
            Point(state.t, solution),
            state.histories,
            v=state.v,
            a=state.a,
            energy=self._energies(end),
            scheme=self.march.integrator,
            mass=self.body.mass,
            holding=holding,
        )


def _at_supports(problem: Problem, forces: Array) -> Array:
    """Forces (n,) of supports: those on prescribed unknowns."""
    reactions = np.zeros_like(forces)
    reactions[problem.fixed] = forces[problem.fixed]
    return reactions
