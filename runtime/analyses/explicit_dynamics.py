"""Central differences with lumped masses: steps without equations to solve, short ones.

Contact acts by a penalty (`softehl.runtime.contact.penalty`), its pairs searched in every step.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from softehl.log import warn
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
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.contact.penalty import frequency_squared, lumped_areas
from softehl.runtime.contact.rigid_contact import RigidContact
from softehl.runtime.contact.search import ContactProblem
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
_SAME = 1e-6  # of the largest pressure: pressures of a start that differ by less are its own
_REMEDY = (
    'give contacts a smaller stiffness=..., or take method = "midpoint", which conserves energy, '
    'or "generalised-alpha" with rho_inf = 0, which damps most'
)
_OVERLAP, _AT_REST, _SMALL = 0.1, 0.5, 0.1
"""Share of the penalty of contacts in the internal energy from which bodies overlap, not being
deformed: contact and bodies are springs in a row, so the same share of a force is missing. It is
looked at where the kinetic energy is at most half of the internal one, as waves pass a soft contact
without a loss of pressure, and the internal energy a tenth of its largest one or more."""
_SHORTER = 2.0  # times: a penalty that shortens stable steps by more is reported


@dataclass(eq=False)
class ExplicitMarch:
    """Steps of at most SAFE times the stable one, which is looked at in each result.

    dt: from result to result. free: what supports and ties leave, and masses there. forces: at the
    state. contact: its unknowns, if there are some. moved: (n,) accelerations of supports at the
    beginning of the last step, zero elsewhere. internal: largest internal energy so far.
    warned, soft: whether the user was told of short steps, and of overlap.
    """

    dt: float
    body: EquationsOfMotion
    state: MotionState
    free: Constraints
    masses: Array
    integrator: CentralDifference
    forces: Forces
    contact: _ContactUnknowns | None
    moved: Array = field(default_factory=lambda: np.empty(0))
    warned: bool = False
    soft: bool = False
    internal: float = 0.0

    @classmethod
    def of(
        cls, integrator: CentralDifference, dt: float, body: EquationsOfMotion, state: MotionState
    ) -> ExplicitMarch:
        """From a state with velocities.  Raises StudyError where an unknown needs a mass."""
        problem = body.at_end(state.ended_step(dt), state.v)
        _require_lumped_masses(body, problem)
        contact = _ContactUnknowns.of(body) if body.static_system.contacts else None
        if contact is not None:
            problem = replace(problem, old=state.x, latest=[])  # type: ignore[call-arg]
            contact.require_own_pressures(problem, state.x)
        free = body.comm.constraints(problem).without(body.roles.multipliers)
        forces = _with_friction(Forces.of(problem, state.x, body.roles), problem, state.x, body)
        masses = free.gather(body.lumped_masses)
        march = cls(dt, body, state, free, masses, integrator, forces, contact)
        march.state = replace(state, a=march._accelerations(forces.total + forces.contact))
        return march

    def run(self, until: float) -> Iterator[Motion]:
        """Results every dt until the end.  Raises StudyError, NotConverged."""
        ledger = EnergyBalance(self.body.comm, remedy=_REMEDY)
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
        if self.contact is None:
            forces = Forces.of(end, x, body.roles)
        else:
            end, x, forces = self.contact.at_end(end, x)
        if self.body.comm.max(float(not np.isfinite(forces.total + forces.contact).all())):
            where = body.comm.distribute(end).where_not_finite(x)
            suffix = where and f": {where}"
            message = f"t = {t:.6g}: the forces are not finite{suffix}"
            state = Solution(initial.x, Status.NOT_FINITE, message, (), 0, 0)
            raise NotConverged(Branch((Point(initial.t, state),), Status.NOT_FINITE, message))
        a = self._accelerations(forces.total + forces.contact)
        displacement, old = x - initial.x, self.forces
        supports, self.moved = np.zeros(len(x)), np.zeros(len(x))
        self.moved[end.fixed] = ((half - initial.v) / dt)[end.fixed]
        total = 0.5 * (old.total + old.contact + forces.total + forces.contact)
        inertia = self.body.lumped_masses * (half - initial.v) / dt
        supports[end.fixed] = (total + inertia)[end.fixed]
        ledger.add(old.mean(forces), supports, displacement)
        ledger.external += parameter_work(initial_equations, end, body.roles, (initial.x, x), None)
        v = self.integrator.half_step(dt, half, a)
        histories = body.static_system.committed(end, x, initial.histories)
        self.state, self.forces = MotionState(t, x, v, a, histories), forces
        return end

    def _accelerations(self, forces: Array) -> Array:
        """Accelerations (n,) of free unknowns; tied ones move as one."""
        return self.free.expand(-self.free.gather(forces) / self.masses)

    def _stable(self, problem: Problem) -> float:
        """2 over the highest frequency about the present state, and if all contacts were closed."""
        K = symmetric(problem.assembler.linearise(self.state.x, problem.parameters)[1])
        free, root, comm = self.free, 1.0 / np.sqrt(self.masses), self.body.comm

        def scaled(z: Array) -> Array:
            forces: Array = K @ free.expand(root * z)
            return root * free.gather(forces)

        begin = np.random.default_rng(comm.rank_and_size[0]).uniform(-1.0, 1.0, len(root))
        bodies = highest(scaled, begin, comm.dot, _ACCURATE)
        penalty = 0.0
        if self.contact is not None:
            penalty = self.contact.frequency_squared(problem)
            self._warn_of_short_steps(bodies, penalty)
        if bodies + penalty <= 0.0:
            return self.dt / SAFE
        return self.integrator.stable_step(bodies + penalty)

    def _warn_of_short_steps(self, bodies: float, penalty: float) -> None:
        """Warn once where the penalty of contacts, not the bodies, decides on the steps."""
        if self.warned or not 0.0 < (_SHORTER**2 - 1.0) * bodies < penalty:
            return
        self.warned = True
        alone, both = (self.integrator.stable_step(w) for w in (bodies, bodies + penalty))
        warn(
            f"contact: its stiffness shortens the stable step from {alone:.3g} to {both:.3g}, and "
            'so stiff impacts gain or lose energy, see energy["balance"]: give a smaller '
            "stiffness=..., which lets bodies overlap more",
            StiffContact,
            stacklevel=6,
        )

    def _warn_of_overlap(self, penalty: float, energies: dict[str, float]) -> None:
        """Warn once where the penalty of contacts, not the bodies, takes much of the energy."""
        internal = energies["internal"]
        self.internal = max(self.internal, internal)
        at_rest = energies["kinetic"] <= _AT_REST * internal >= _AT_REST * _SMALL * self.internal
        if self.soft or not at_rest or not penalty > _OVERLAP * internal:
            return
        self.soft = True
        warn(
            f"contact: t = {self.state.t:.6g}: its penalty holds {penalty / internal:.0%} of the "
            "internal energy, and as much of the force may be missing: bodies overlap instead of "
            "being deformed; give a larger stiffness=..., or finer cells, whose default is stiffer",
            SoftContact,
            stacklevel=6,
        )

    def _energies(self, end: Problem, ledger: EnergyBalance) -> dict[str, float]:
        kinetic = 0.5 * float(self.body.lumped_masses @ self.state.v**2)
        stored, penalty = stored_energy(end, self.state.x, self.body.roles), 0.0
        if self.contact is not None:
            penalty = self.contact.stored_energy(self.forces, self.state.x)
        state, forces = self.state, self.forces
        energies = ledger.balance(state.t, kinetic, stored + penalty, forces, state.x)
        if self.contact is not None:
            self._warn_of_overlap(self.body.comm.sum(np.array([penalty])).item(), energies)
        return energies

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
        a, forces = state.a + self.moved, self.forces
        distributed = self.body.comm.distribute(end.at(state.x))
        return Motion(
            self.body.static_system,
            distributed,
            Point(state.t, solution),
            state.histories,
            v=state.v,
            a=a,
            energy=self._energies(end, ledger),
            stable_step=stable,
            holding=forces.unheld + forces.contact + self.body.lumped_masses * a,
        )


def _require_lumped_masses(body: EquationsOfMotion, problem: Problem) -> None:
    """Raise StudyError where an unknown has no mass that needs one."""
    system, comm = body.static_system, body.comm
    without = comm.sum_shared(body.lumped_masses) <= 0.0
    for block in problem.assembler.blocks:
        if isinstance(block.kernel, Tie):
            without[block.dofs[:, 2]] = False
    without[body.roles.multipliers] = False
    layout = system.numbering.layout
    internal = {n for b in system.blocks.values() for n in getattr(b.kernel, "internal", ())}
    for name in layout.names:
        if comm.max(float(without[layout.part(name)].any())):
            if name in internal:
                raise StudyError(
                    f'method = "explicit": {name} belongs to elements (m.internal), whose '
                    "equations every step would have to solve; an implicit method does"
                )
            raise StudyError(
                f'method = "explicit": {name} has no mass everywhere, and explicit steps are '
                "force over mass; an implicit method can do without"
            )


class SoftContact(RuntimeWarning):
    """The penalty of a contact, not its bodies, takes much of the energy of explicit steps."""


class StiffContact(RuntimeWarning):
    """The penalty of a contact, not its bodies, decides how short explicit steps are."""


def _with_friction(forces: Forces, problem: Problem, x: Array, body: EquationsOfMotion) -> Forces:
    """Forces at unknowns x, (n,), with friction among those that only work."""
    if not _rubs(body):
        return forces
    assert isinstance(problem, ContactProblem)
    smooth = tuple(replace(c, friction=0.0) for c in problem.contacts)  # type: ignore[type-var]
    normal = Forces.of(replace(problem, contacts=smooth, latest=[]), x, body.roles).contact
    friction = forces.contact - normal
    return replace(forces, others=forces.others + friction, contact=normal)


def _rubs(body: EquationsOfMotion) -> bool:
    """True if a contact has friction."""
    return any(contact.friction for contact in body.static_system.contacts)


@dataclass(frozen=True, eq=False)
class _ContactUnknowns:
    """Pressures and shear stresses at the nodes of contacts, which follow from the displacements.

    pressures, all: their numbers. areas: (n,) of the nodes with them, over the penalty. reference:
    (n,) coordinates at rest of the unknowns that move the nodes.
    """

    body: EquationsOfMotion
    pressures: Integers
    all: Integers
    areas: Array
    reference: Array

    @classmethod
    def of(cls, body: EquationsOfMotion) -> _ContactUnknowns:
        system = body.static_system
        assert system.definition is not None
        requests = system.definition.contacts
        labels = [label for request in requests for label in request.labels]
        blocks = [system.assembler.block(label) for label in labels]
        numbers = [c.multipliers[c.multipliers[:, 0] >= 0] for c in system.contacts]
        pressures = np.concatenate([n[:, 0] for n in numbers])
        all_of = np.concatenate([n.ravel() for n in numbers])
        reference = np.zeros(system.size)
        for contact in system.contacts:
            moves = contact.displacements >= 0
            reference[contact.displacements[moves]] = system.mesh.points[moves]
        return cls(body, pressures, all_of, lumped_areas(blocks, system.size), reference)

    def at_end(self, problem: Problem, x: Array) -> tuple[Problem, Array, Forces]:
        """Equations at the end x of a step, x with the means there, and the forces.

        No slip of the step is left in the equations, so that a motion that continues from x has the
        same forces.
        """
        assert isinstance(problem, ContactProblem)
        x, forces = self._with_means(problem, x)
        problem = replace(problem, old=x, latest=[])
        if _rubs(self.body):
            forces = Forces.of(problem, x, self.body.roles)
            forces = _with_friction(forces, problem, x, self.body)
        return problem, x, forces

    def require_own_pressures(self, problem: Problem, x: Array) -> None:
        """Raise StudyError where pressures of the start are not those of its penetrations."""
        prescribed, computed = x[self.pressures], self._with_means(problem, x)[0][self.pressures]
        size = float(np.abs([*computed, *prescribed]).max(initial=0.0))
        if prescribed.any() and float(np.abs(prescribed - computed).max()) > _SAME * size:
            raise StudyError(
                f"explicit: the start has contact pressures up to {prescribed.max():.3g} "
                "MPa without penetration, which a penalty needs: start without contact, from a "
                'motion by "explicit", or march by "generalised-alpha"'
            )

    def stored_energy(self, forces: Forces, x: Array) -> float:
        """Energy of the penalties, p^2 / (2 rho) over the contact, at x, (n,).

        Forces p n and -p n at points that are g n apart, times their places, are p g per area.
        A point on a rigid surface has no partner.
        """
        forces_of_pairs, energy = forces.contact, 0.0
        for contact in self.body.static_system.contacts:
            if isinstance(contact, RigidContact):
                own_forces, own_energy = contact.penalty_forces(x)
                forces_of_pairs, energy = forces_of_pairs - own_forces, energy + own_energy
        return energy + 0.5 * float(forces_of_pairs @ (self.reference + x))

    def frequency_squared(self, problem: Problem) -> float:
        """Bound of that of the penalties."""
        fixed = np.zeros(self.body.static_system.size, dtype=bool)
        fixed[problem.fixed] = True
        contacts = self.body.static_system.contacts
        return frequency_squared(contacts, self.body.lumped_masses, fixed)  # type: ignore[arg-type]

    def _with_means(self, problem: Problem, x: Array) -> tuple[Array, Forces]:
        """x with pressures and shear stresses that are means about the nodes, and the forces."""
        x = x.copy()
        x[self.pressures] = 0.0
        forces = Forces.of(problem, x, self.body.roles)
        x[self.all] += forces.conditions[self.all] / self.areas[self.all]
        return x, forces
