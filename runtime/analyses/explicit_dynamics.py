"""Central differences with lumped masses: steps without equations to solve, short ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from softehl.runtime.analyses.equations_of_motion import EquationsOfMotion
from softehl.runtime.analyses.motion import (
    EnergyBalance,
    Forces,
    Motion,
    MotionState,
    parameter_work,
    stored_energy,
)
from softehl.runtime.analyses.time_integrators import ROUNDING, CentralDifference
from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.discretisation.constraints import Constraints
from softehl.runtime.discretisation.loads import Tie
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.discretisation.reduced_tangent import symmetric
from softehl.runtime.solve.eigen import highest
from softehl.runtime.solve.solution import Branch, NotConverged, Point, Solution, Status

SAFE = 0.9
"""Of the stable step, which is that of small motions about a state; strain stiffens."""
_ACCURATE = 1e-3  # relative error of the highest frequency, far below what SAFE leaves
_APART = 1e-9  # of the size of the mesh: a tie that opens by more does not hold


@dataclass(eq=False)
class ExplicitMarch:
    """Steps of at most SAFE times the stable one, which is looked at in each result.

    dt: from result to result. free: what supports and ties leave, and masses there.
    """

    dt: float
    body: EquationsOfMotion
    state: MotionState
    free: Constraints
    masses: Array
    integrator: CentralDifference

    @classmethod
    def of(
        cls, integrator: CentralDifference, dt: float, body: EquationsOfMotion, state: MotionState
    ) -> ExplicitMarch:
        """From a state with velocities.  Raises StudyError where an unknown needs a mass."""
        problem = body.at_end(state.ended_step(dt), state.v)
        _require_lumped_masses(body, problem)
        free = body.comm.constraints(problem)
        march = cls(dt, body, state, free, free.gather(body.lumped_masses), integrator)
        a = march._accelerations(Forces.of(problem, state.x, body.roles).total)
        march.state = replace(state, a=a)
        return march

    def run(self, until: float) -> Iterator[Motion]:
        """Results every dt until the end.  Raises StudyError, NotConverged."""
        ledger = EnergyBalance(self.body.comm)
        begin = self.body.at_end(self.state.ended_step(self.dt), self.state.v)
        self._energies(begin, ledger)
        end, stable = begin, self._stable(begin)
        count = max(int(np.ceil((until - self.state.t) / self.dt * (1.0 - ROUNDING))), 1)
        first = self.state.t
        for k in range(1, count + 1):
            t = min(first + k * self.dt, until)
            steps = int(np.ceil((t - self.state.t) / (SAFE * stable)))
            for goal in np.linspace(self.state.t, t, steps + 1)[1:]:
                end = self._step(end, float(goal), ledger)
            stable = self._stable(end)
            yield self._motion(end, ledger, steps, stable)

    def _step(self, initial_equations: Problem, t: float, ledger: EnergyBalance) -> Problem:
        """Velocity Verlet: the equations at the end of a step."""
        initial, body = self.state, self.body
        dt = t - initial.t
        half = self.integrator.half_step(dt, initial.v, initial.a)
        x = initial.x + dt * half
        end = body.at_end(initial.step(t), half)
        x[end.fixed] = end.values
        half[end.fixed] = (x - initial.x)[end.fixed] / dt
        forces = Forces.of(end, x, body.roles)
        if self.body.comm.max(float(not np.isfinite(forces.total).all())):
            where = body.comm.distribute(end).where_not_finite(x)
            place = where and f": {where}"
            message = f"t = {t:.6g}: the forces are not finite{place}"
            state = Solution(initial.x, Status.NOT_FINITE, message, (), 0, 0)
            raise NotConverged(Branch((Point(initial.t, state),), Status.NOT_FINITE, message))
        a = self._accelerations(forces.total)
        displacement = x - initial.x
        old = Forces.of(initial_equations, initial.x, body.roles)
        supports = np.zeros(len(x))
        total = 0.5 * (old.total + forces.total)
        inertia = self.body.lumped_masses * (half - initial.v) / dt
        supports[end.fixed] = (total + inertia)[end.fixed]
        ledger.add(old.mean(forces), supports, displacement)
        ledger.external += parameter_work(initial_equations, end, body.roles, (initial.x, x), None)
        v = self.integrator.half_step(dt, half, a)
        histories = body.static_system.committed(end, x, initial.histories)
        self.state = MotionState(t, x, v, a, histories)
        return end

    def _accelerations(self, forces: Array) -> Array:
        """Accelerations (n,) of free unknowns; tied ones move as one."""
        return self.free.expand(-self.free.gather(forces) / self.masses)

    def _stable(self, problem: Problem) -> float:
        """2 over the highest frequency about the present state."""
        K = symmetric(problem.assembler.linearise(self.state.x, problem.parameters)[1])
        free, root, comm = self.free, 1.0 / np.sqrt(self.masses), self.body.comm

        def scaled(z: Array) -> Array:
            forces: Array = K @ free.expand(root * z)
            return root * free.gather(forces)

        begin = np.random.default_rng(comm.rank_and_size[0]).uniform(-1.0, 1.0, len(root))
        frequency_squared = highest(scaled, begin, comm.dot, _ACCURATE)
        return (
            self.integrator.stable_step(frequency_squared)
            if frequency_squared > 0.0
            else self.dt / SAFE
        )

    def _energies(self, end: Problem, ledger: EnergyBalance) -> dict[str, float]:
        kinetic = 0.5 * float(self.body.lumped_masses @ self.state.v**2)
        stored = stored_energy(end, self.state.x, self.body.roles)
        forces = Forces.of(end, self.state.x, self.body.roles)
        return ledger.balance(self.state.t, kinetic, stored, forces, self.state.x)

    def _motion(self, end: Problem, ledger: EnergyBalance, steps: int, stable: float) -> Motion:
        state, size = self.state, float(np.ptp(self.body.static_system.mesh.points, axis=0).max())
        for block in end.assembler.blocks:
            if isinstance(block.kernel, Tie):
                r = block.residual(state.x, end.parameters[block.name])[:, 2]
                opening = self.body.comm.max(float(np.abs(r).max(initial=0.0)))
                if opening > _APART * size:
                    raise StudyError(
                        f'{block.name}: opens by {opening:.3g}; method = "explicit" holds '
                        "ties of a constant offset, on no side of which a support moves"
                    )
        solution = Solution(state.x, Status.CONVERGED, f"{steps} steps", (), 0, 0)
        distributed = self.body.comm.distribute(end)
        return Motion(
            self.body.static_system,
            distributed,
            Point(state.t, solution),
            state.histories,
            v=state.v,
            a=state.a,
            energy=self._energies(end, ledger),
            stable_step=stable,
        )


def _require_lumped_masses(body: EquationsOfMotion, problem: Problem) -> None:
    """Raise StudyError where an unknown has no mass that needs one."""
    system, comm = body.static_system, body.comm
    without = comm.sum_shared(body.lumped_masses) <= 0.0
    for block in problem.assembler.blocks:
        if isinstance(block.kernel, Tie):
            without[block.dofs[:, 2]] = False
    layout = system.numbering.layout
    touches = [] if system.definition is None else system.definition.contacts
    internal = {n for b in system.blocks.values() for n in getattr(b.kernel, "internal", ())}
    for name in layout.names:
        if comm.max(float(without[layout.part(name)].any())):
            if any(name == request.unknown(m) for request in touches for m in ("lambda", "tau")):
                raise StudyError(
                    'method = "explicit" takes no contact: take "generalised-alpha", which damps '
                    'what impacts leave, or "newmark" or "midpoint"'
                )
            if name in internal:
                raise StudyError(
                    f'method = "explicit": {name} belongs to elements (m.internal), whose '
                    "equations every step would have to solve; an implicit method does"
                )
            raise StudyError(
                f'method = "explicit": {name} has no mass everywhere, and explicit steps are '
                "force over mass; an implicit method can do without"
            )
