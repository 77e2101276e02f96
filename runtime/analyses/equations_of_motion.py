"""Equations of motion of a study: its discrete equations with inertia."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.sparse import csc_array

from softehl.runtime.analyses.motion import EnergyRoles, Forces
from softehl.runtime.analyses.time_integrators import Affine, SecondOrderIntegrator
from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.contact.search import ContactProblem
from softehl.runtime.definition.problem_definition import Block, StudyError
from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.communicator import Communicator
from softehl.runtime.discretisation.discrete_gradient import (
    DiscreteGradientKernel,
    time_derivatives,
    with_old,
)
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.loads import Tie
from softehl.runtime.discretisation.mass import MassKernel, lumped
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.discretisation.reduced_tangent import is_motion
from softehl.runtime.equations.contact_setup import weighted
from softehl.runtime.equations.mass_matrix import Masses, mass_blocks, mass_matrix
from softehl.runtime.equations.system import Step, System
from softehl.runtime.solve.linear.krylov import conjugate_gradients
from softehl.runtime.suggestions import join_names

_BEFORE = "forces of the step before"
_EXACT, _MOST = 1e-14, 1000  # of accelerations at the start; the mass is well conditioned


@dataclass(frozen=True, eq=False)
class _ConstantForces:
    """Forces as a kernel, (n, 1): its data."""

    name = _BEFORE
    signature = "built in"
    parameters: tuple[str, ...] = ()
    fields: tuple[str, ...] = ()

    def residual(self, coordinates: Array, dofs: Array, **kernel_data: Any) -> Array:
        return np.asarray(kernel_data["data"])

    def tangent(self, coordinates: Array, dofs: Array, **kernel_data: Any) -> tuple[Array, Array]:
        return np.asarray(kernel_data["data"]), np.zeros((len(dofs), 1, 1))

    def fields_at(self, coordinates: Array, dofs: Array, **kernel_data: Any) -> Array:
        return np.empty((len(dofs), 0, 0))


@dataclass(frozen=True, eq=False)
class _ScaledKernel:
    """A kernel whose equations are multiplied by the last columns of its data."""

    kernel: Any

    def __getattr__(self, name: str) -> Any:
        """Everything else, names above all, is the kernel's."""
        if name == "kernel":
            raise AttributeError(name)
        return getattr(self.kernel, name)

    def residual(self, coordinates: Array, dofs: Array, **arguments: Any) -> Array:
        """Residuals (n, ndof)."""
        inner_arguments, factors = self._split_factors(dofs, arguments)
        return np.asarray(factors * self.kernel.residual(coordinates, dofs, **inner_arguments))

    def tangent(self, coordinates: Array, dofs: Array, **arguments: Any) -> tuple[Array, Array]:
        """Residuals and tangents (n, ndof, ndof)."""
        inner_arguments, factors = self._split_factors(dofs, arguments)
        r, K = self.kernel.tangent(coordinates, dofs, **inner_arguments)
        return factors * r, factors[:, :, None] * K

    def fields_at(self, coordinates: Array, dofs: Array, **arguments: Any) -> Array:
        """None, (n, 0, 0)."""
        return np.empty((len(dofs), 0, 0))

    def _split_factors(
        self, dofs: Array, arguments: dict[str, Any]
    ) -> tuple[dict[str, Any], Array]:
        inner_data, factors = np.split(arguments["data"], [-dofs.shape[1]], axis=1)
        data = np.ascontiguousarray(inner_data) if inner_data.shape[1] else None
        return {**arguments, "data": data}, factors


@dataclass(frozen=True, eq=False)
class EquationsOfMotion:
    """Equations of motion of a study.

    static_system: without inertia. dynamic_system: with elements of mass, and initial or averaged
    forces. M: consistent masses (n, n) at the start. lumped_masses: (n,), of the explicit scheme;
    both are what elements of this process add. has_mass: unknowns with mass. roles: of its blocks.
    weight: of the forces at the end of a step in `dynamic_system`; ties and contacts act through
    the whole step, so that their unknowns there are those of the study over the weight. mass:
    densities by block. factors: (n,) of equations in `dynamic_system`: the forces of ties and
    contacts on unknowns without mass, too, are those of the study over the weight. constrained:
    (n,) multipliers of ties, contacts and pages.
    """

    static_system: System
    dynamic_system: System
    M: csc_array
    lumped_masses: Array
    has_mass: Flags
    roles: EnergyRoles
    weight: float = 1.0
    mass: Masses | None = None
    factors: Array = field(default_factory=lambda: np.empty(0))
    constrained: Flags = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))

    @classmethod
    def of(
        cls, system: System, mass: Masses | None, integrator: SecondOrderIntegrator | None, at: Step
    ) -> EquationsOfMotion:
        """Return the equations at a step.  Raises StudyError without mass."""
        problem, blocks = system.local_problem(at), mass_blocks(system, mass)
        comm, M = system.comm, mass_matrix(system, problem, at.old, mass)
        heavy = comm.sum_shared(M.diagonal()) > 0.0
        for block in system.blocks.values():
            for slot in block.rates.values():
                dofs = system.numbering.nodal[slot.name]
                if comm.max(float(not heavy[dofs[dofs >= 0]].all())):
                    raise StudyError(
                        f"{block.name!r} has a rate of {slot.name}, which has no mass everywhere: "
                        'give it one, or march by "euler" or "bdf2"'
                    )
        roles, weight = (
            EnergyRoles.in_system(system),
            1.0 if integrator is None else integrator.final_weight,
        )
        element_blocks = list(system.assembler.blocks)
        massless = _multipliers(system, problem, at.old, heavy, roles)
        if integrator is not None and integrator.averages_forces:
            free = [b for b in element_blocks if roles.of[b.name] not in ("tie", "contact")]
            changed = {b.name: _averaged(b, system.blocks.get(b.name), massless) for b in free}
            element_blocks = [changed.get(b.name, b) for b in element_blocks]
        elif integrator is not None and not integrator.damps and comm.max(float(massless.any())):
            raise StudyError(
                f"{names_of(system, massless)} is a multiplier, whose error grows in steps of "
                'method = "newmark" or of rho_inf = 1, which damp nothing: take '
                '"generalised-alpha" with rho_inf below 1, or "midpoint"'
            )
        contacts, stiffer = weighted(system, 1.0 / weight)
        element_blocks = [stiffer.get(b.name, b) for b in element_blocks]
        factors = np.ones(system.size)
        factors[roles.bound[~heavy[roles.bound]]] = 1.0 / weight
        element_blocks = [
            b if roles.of[b.name] in ("tie", "contact") else _scaled(b, factors)
            for b in element_blocks
        ]
        rows = comm.owned(system.size)
        rows = rows[heavy[rows]][:, None]
        force_block = ElementBlock(
            _BEFORE, _ConstantForces(), np.empty((0, 0)), rows, check_orientation=False
        )
        assembler = Assembler.build(system.size, [*element_blocks, *blocks, force_block])
        lumps = _lumped(system, M, blocks) if integrator is None else M.diagonal()
        moving = replace(
            system, assembler=assembler, contacts=contacts, comm=comm.with_other_elements()
        )
        constrained = massless.copy()
        constrained[roles.multipliers] = True
        return cls(system, moving, M, lumps, heavy, roles, weight, mass, factors, constrained)

    @property
    def comm(self) -> Communicator:
        """Distribution of its unknowns over processes."""
        return self.static_system.comm

    def problem(self, step: Step, load_time: float, initial_forces: Array) -> Problem:
        """Equations of a step that ends at step.t: loads of a place in it, supports of its end.

        initial_forces: (n,) forces that are added where there is mass.
        """
        initial_forces = self.comm.sum_shared(initial_forces)
        problem = self.dynamic_system.local_problem(
            replace(step, t=step.t - (1.0 - load_time) * step.dt)
        )
        end = problem if load_time == 1.0 else self.static_system.local_problem(step)
        remainder = (
            np.zeros(len(initial_forces))
            if step.acceleration_offset is None
            else step.acceleration_offset
        )
        blocks, parameters = [], dict(problem.parameters)
        for block in problem.assembler.blocks:
            changed = block
            if isinstance(block.kernel, DiscreteGradientKernel):
                changed = with_old(block, step.old)
            elif isinstance(block.kernel, MassKernel):
                changed = replace(block, data=np.ascontiguousarray(remainder[block.dofs]))
            elif isinstance(block.kernel, _ConstantForces):
                changed = replace(block, data=initial_forces[block.dofs])
            elif isinstance(block.kernel, Tie):
                parameters[block.name] = end.parameters[block.name]
            if isinstance(block.kernel, _ScaledKernel):
                columns = self.factors[block.dofs]
                data = [columns] if block.data is None else [block.data, columns]
                changed = replace(block, data=np.ascontiguousarray(np.concatenate(data, axis=1)))
            blocks.append(changed)
        assembler = replace(problem.assembler, blocks=tuple(blocks))
        return replace(
            problem,
            assembler=assembler,
            parameters=parameters,
            fixed=end.fixed,
            values=end.values,
        )

    def algebraic(self, problem: Problem) -> Flags:
        """Free unknowns (n,) without mass, which follow from the others without rates."""
        massless = ~self.has_mass
        massless[problem.fixed] = False
        return massless

    def highest_frequency(self, at: Step) -> float:
        """Highest angular frequency of the mesh, estimated by the diagonals of the tangent."""
        problem = self.static_system.local_problem(at)
        with np.errstate(all="ignore"):
            K = problem.assembler.linearise(at.old, problem.parameters)[1]
        stiff, mass = (self.comm.sum_shared(A.diagonal()) for A in (K, self.M))
        has_mass = (mass > 0.0) & np.isfinite(stiff)
        ratio = float((np.abs(stiff[has_mass]) / mass[has_mass]).max(initial=0.0))
        return float(np.sqrt(max(self.comm.max(ratio), np.finfo(np.float64).tiny)))

    def weighted(self, x: Array, weight: float) -> Array:
        """Unknowns (n,) with those of ties and contacts times a number."""
        scaled = x.copy()
        scaled[self.roles.multipliers] *= weight
        return scaled

    def friction_work(self, problem: Problem, x: Array, displacement: Array) -> float:
        """Work of friction at the end x of a step in which the unknowns moved (n,)."""
        if not any(contact.friction for contact in self.static_system.contacts):
            return 0.0
        assert isinstance(problem, ContactProblem)
        smooth = tuple(replace(c, friction=0.0) for c in self.static_system.contacts)  # type: ignore[type-var]
        other = replace(problem, contacts=smooth, latest=[])
        total, normal = (Forces.of(p, x, self.roles).contact for p in (problem, other))
        return float((total - normal) @ displacement)

    def at_end(self, step: Step, v: Array) -> Problem:
        """The plain equations at the end of a step, with velocities v, (n,)."""
        return self.static_system.local_problem(
            replace(step, rate=0.0, rate_offset=v, acceleration=0.0, acceleration_offset=None)
        )

    def initial_accelerations(self, problem: Problem, x: Array, moved: Array) -> Array:
        """Initial accelerations (n,): M a = -f on free unknowns.  Raises StudyError.

        moved: (n,) those of supports, zero elsewhere.
        """
        forces = Forces.of(problem, x, self.roles)
        free = self.comm.constraints(problem)
        diagonal = free.gather(self.M.diagonal())
        inverse = 1.0 / np.where(diagonal > 0.0, diagonal, np.inf)
        solution = conjugate_gradients(
            lambda z: free.gather(self.M @ free.expand(z)),
            lambda r: inverse * r,
            np.where(
                diagonal > 0.0,
                -free.gather(forces.total + forces.constraints + self.M @ moved),
                0.0,
            ),
            tolerance=_EXACT,
            max_iterations=_MOST,
            dot=self.comm.dot,
        )
        if not solution.converged:
            raise StudyError("the mass is not positive: no accelerations at the start are found")
        return free.expand(solution.x) + moved

    def masked(self, values: Affine) -> Affine:
        """Zero in unknowns without mass, for their velocities and accelerations."""
        return Affine(values.c, np.where(self.has_mass, values.constant, 0.0))


def _scaled(block: ElementBlock, factors: Array) -> ElementBlock:
    """A block whose equations have these factors, (n,)."""
    if (factors[block.dofs] == 1.0).all():
        return block
    return replace(block, kernel=_ScaledKernel(block.kernel), constant=False)


def _multipliers(
    system: System, problem: Problem, x: Array, heavy: Flags, roles: EnergyRoles
) -> Flags:
    """Unknowns (n,) of pages without mass that stand in no equation without mass, at x, (n,).

    Unknowns of the motion of rigid bodies have no mass and are left out.
    """
    massless = ~heavy
    for name in filter(is_motion, system.numbering.layout.names):
        massless[system.numbering.layout.part(name)] = False
    massless[problem.fixed] = massless[roles.multipliers] = False
    if not system.comm.max(float(massless.any())):
        return massless
    contact_problem = problem.at(x)
    with np.errstate(all="ignore"):
        K = contact_problem.assembler.linearise(x, contact_problem.parameters)[1]
    among = system.comm.sum_shared(np.asarray(abs(K) @ massless.astype(np.float64)))
    multipliers: Flags = massless & (among == 0.0)
    return multipliers


def names_of(system: System, dofs: Flags) -> str:
    """Names of the unknowns among these, (n,), of all processes."""
    layout = system.numbering.layout
    present = [n for n in layout.names if system.comm.max(float(dofs[layout.part(n)].any()))]
    return join_names(list(map(repr, present)))


def _averaged(block: ElementBlock, page: Block | None, multipliers: Flags) -> ElementBlock:
    """A block that is averaged along a step; multipliers: (n,) unknowns that are one in it."""
    timed: tuple[tuple[int, Integers, Integers], ...] = ()
    if page is not None:
        number = {slot: k for k, slot in enumerate(page.slots)}
        tables = {"rate": page.rates, "acceleration": page.accelerations}
        timed = time_derivatives(
            block.kernel,
            [(p, {d: number[s] for d, s in table.items()}) for p, table in tables.items()],
        )
    length = None
    if page is not None and "dt" in block.kernel.parameters and "dt" not in page.parameters:
        length = list(block.kernel.parameters).index("dt")
    columns = np.flatnonzero(multipliers[block.dofs].any(axis=0))
    averaged = DiscreteGradientKernel(block.kernel, timed, length, columns)
    return replace(block, kernel=averaged, constant=False)


def _lumped(system: System, M: csc_array, blocks: list[ElementBlock]) -> Array:
    """Masses (n,) at the nodes: of densities cell by cell, of pages unknown by unknown."""
    lumps, consistent = np.zeros(system.size), np.zeros(system.size)
    for block in blocks:
        assert isinstance(block.kernel, MassKernel)
        m, components = block.kernel.matrices, block.kernel.components
        np.add.at(lumps, block.dofs, np.tile(lumped(m), (1, components)))
        np.add.at(consistent, block.dofs, np.tile(np.einsum("naa->na", m), (1, components)))
    comm, page_mass = system.comm, M.diagonal() - consistent
    largest = comm.max(float(np.abs(M.diagonal()).max(initial=0.0)))
    if comm.max(float(np.abs(page_mass).max(initial=0.0))) <= 1e-12 * largest:
        return lumps
    total = np.asarray(M.sum(axis=1)).ravel()
    if blocks:
        raise StudyError("explicit: give all masses as mass=..., or all in pages, not both")
    for name in system.numbering.layout.names:
        part = system.numbering.layout.part(name)
        row_sum, diagonal_sum = comm.sum(
            np.array([total[part].sum(), page_mass[part].sum()])
        ).tolist()
        if diagonal_sum:
            lumps[part] = page_mass[part] * row_sum / diagonal_sum
    return lumps
