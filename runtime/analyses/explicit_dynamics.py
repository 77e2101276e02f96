"""Central differences with lumped masses: steps without equations to solve, short ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from softehl.runtime.analyses.equations_of_motion import Body
from softehl.runtime.analyses.motion import (
    Forces,
    Ledger,
    Motion,
    MotionState,
    parameter_work,
    stored_energy,
)
from softehl.runtime.analyses.time_integrators import ROUNDING, CentralDifference
from softehl.runtime.arrays import Array
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.discretisation.communicator import ConstraintMap
from softehl.runtime.discretisation.constraints import symmetric
from softehl.runtime.discretisation.loads import Tie
from softehl.runtime.discretisation.problem import Problem
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
    body: Body
    here: MotionState
    free: ConstraintMap
    masses: Array
    integrator: CentralDifference

    @classmethod
    def of(
        cls, integrator: CentralDifference, dt: float, body: Body, state: MotionState
    ) -> ExplicitMarch:
        """From a state with velocities.  Raises StudyError where an unknown needs a mass."""
        problem = body.at_end(state.ended_step(dt), state.v)
        _require_lumped_masses(body, problem)
        free = body.comm.constraint_map(problem)
        march = cls(dt, body, state, free, free.gather(body.lumps), integrator)
        a = march._accelerations(Forces.of(problem, state.x, body.roles).total)
        march.here = replace(state, a=a)
        return march

    def run(self, until: float) -> Iterator[Motion]:
        """Results every dt until the end.  Raises StudyError, NotConverged."""
        ledger = Ledger(self.body.comm)
        begin = self.body.at_end(self.here.ended_step(self.dt), self.here.v)
        self._told(begin, ledger)
        end, stable = begin, self._stable(begin)
        count = max(int(np.ceil((until - self.here.t) / self.dt * (1.0 - ROUNDING))), 1)
        first = self.here.t
        for k in range(1, count + 1):
            t = min(first + k * self.dt, until)
            steps = int(np.ceil((t - self.here.t) / (SAFE * stable)))
            for goal in np.linspace(self.here.t, t, steps + 1)[1:]:
                end = self._step(end, float(goal), ledger)
            stable = self._stable(end)
            yield self._motion(end, ledger, steps, stable)

    def _step(self, before: Problem, t: float, ledger: Ledger) -> Problem:
        """Velocity Verlet: the equations at the end of a step."""
        here, body = self.here, self.body
        dt = t - here.t
        half = self.integrator.half_step(dt, here.v, here.a)
        x = here.x + dt * half
        end = body.at_end(here.step(t), half)
        x[end.fixed] = end.values
        half[end.fixed] = (x - here.x)[end.fixed] / dt
        forces = Forces.of(end, x, body.roles)
        if self.body.comm.max(float(not np.isfinite(forces.total).all())):
            where = body.comm.distribute(end).where_not_finite(x)
            words = f"t = {t:.6g}: the forces are not finite{where}"
            state = Solution(here.x, Status.NOT_FINITE, words, (), 0, 0)
            raise NotConverged(Branch((Point(here.t, state),), Status.NOT_FINITE, words))
        a = self._accelerations(forces.total)
        moved = x - here.x
        old = Forces.of(before, here.x, body.roles)
        supports = np.zeros(len(x))
        total = 0.5 * (old.total + forces.total)
        inertia = self.body.lumps * (half - here.v) / dt
        supports[end.fixed] = (total + inertia)[end.fixed]
        ledger.add(old.mean(forces), supports, moved)
        ledger.external += parameter_work(before, end, body.roles, (here.x, x), None)
        v = self.integrator.half_step(dt, half, a)
        histories = body.plain.committed(end, x, here.histories)
        self.here = MotionState(t, x, v, a, histories)
        return end

    def _accelerations(self, forces: Array) -> Array:
        """Accelerations (n,) of free unknowns; tied ones move as one."""
        return self.free.spread(-self.free.gather(forces) / self.masses)

    def _stable(self, problem: Problem) -> float:
        """2 over the highest frequency about the present state."""
        K = symmetric(problem.assembler.linearise(self.here.x, problem.parameters)[1])
        free, root, comm = self.free, 1.0 / np.sqrt(self.masses), self.body.comm

        def scaled(z: Array) -> Array:
            forces: Array = K @ free.spread(root * z)
            return root * free.gather(forces)

        begin = np.random.default_rng(comm.rank_and_size[0]).uniform(-1.0, 1.0, len(root))
        found = highest(scaled, begin, comm.dot, _ACCURATE)
        return self.integrator.stable_step(found) if found > 0.0 else self.dt / SAFE

    def _told(self, end: Problem, ledger: Ledger) -> dict[str, float]:
        kinetic = 0.5 * float(self.body.lumps @ self.here.v**2)
        stored = stored_energy(end, self.here.x, self.body.roles)
        forces = Forces.of(end, self.here.x, self.body.roles)
        return ledger.told(self.here.t, kinetic, stored, forces, self.here.x)

    def _motion(self, end: Problem, ledger: Ledger, steps: int, stable: float) -> Motion:
        here, size = self.here, float(np.ptp(self.body.plain.mesh.points, axis=0).max())
        for block in end.assembler.blocks:
            if isinstance(block.kernel, Tie):
                r = block.residual(here.x, end.parameters[block.name])[:, 2]
                apart = self.body.comm.max(float(np.abs(r).max(initial=0.0)))
                if apart > _APART * size:
                    raise StudyError(
                        f'{block.name}: opens by {apart:.3g}; method = "explicit" holds '
                        "ties of a constant offset, on no side of which a support moves"
                    )
        solution = Solution(here.x, Status.CONVERGED, f"{steps} steps", (), 0, 0)
        posed = self.body.comm.distribute(end)
        return Motion(
            *(self.body.plain, posed, Point(here.t, solution), here.histories),
            v=here.v, a=here.a, energy=self._told(end, ledger), stable_step=stable,
        )  # fmt: skip


def _require_lumped_masses(body: Body, problem: Problem) -> None:
    """Raise StudyError where an unknown has no mass that needs one."""
    system, comm = body.plain, body.comm
    without = comm.sum_shared(body.lumps) <= 0.0
    for block in problem.assembler.blocks:
        if isinstance(block.kernel, Tie):
            without[block.dofs[:, 2]] = False
    layout = system.numbering.layout
    touches = [] if system.statement is None else system.statement.contacts
    internal = {n for b in system.blocks.values() for n in getattr(b.kernel, "internal", ())}
    for name in layout.names:
        if comm.max(float(without[layout.part(name)].any())):
            if any(name == touch.unknown(m) for touch in touches for m in ("lambda", "tau")):
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
