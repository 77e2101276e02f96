"""Motion: a result with velocities and accelerations, and the balance of its energies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np

from softehl.errors import UnknownNameError
from softehl.log import warn
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation.communicator import Communicator
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.loads import DeadLoad, NodalForce, Pressure, Spring, Tie
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.equations.contact_setup import contact_blocks
from softehl.runtime.equations.mass_matrix import Masses
from softehl.runtime.equations.system import Step, System
from softehl.runtime.kernels.kernel import Kernel
from softehl.runtime.results.result import Result
from softehl.runtime.suggestions import did_you_mean, join_names

GAIN = 0.05
"""Of the largest sum of energies so far: a motion that has gained more by its scheme, in so many
steps on end, warns."""
LASTS = 3
_EMPTY = np.empty(0)


@dataclass(frozen=True, eq=False, repr=False)
class Motion(Result):
    """Result with velocities and accelerations.

    Attributes
    ----------
    v : array (n,)
        Velocities of the unknowns; zero without mass.
    a : array (n,)
        Accelerations; zero without mass.
    energy : mapping of str to float
        "kinetic"; "internal": energies of pages and springs, or the work of forces of pages
        without energy and of friction; "external": the work of loads, pressures, moving supports
        and ties, and parameters that depend on time; "balance": the gain of kinetic and internal
        energy above the external work since the beginning, which is the error and the damping of
        the integrator.
    stable_step : float
        Largest stable step of central differences [s]; nan for other methods.
    scheme : optional
        Time integrator.
    mass : mapping, optional
        Densities of `Study.march`.
    holding : array (n,)
        Forces of supports, ties and springs in the equation of the step, inertia included; on
        several processes what the elements of this one add.
    """

    v: Array = field(default_factory=lambda: _EMPTY)
    a: Array = field(default_factory=lambda: _EMPTY)
    energy: Mapping[str, float] = field(default_factory=dict)
    stable_step: float = float("nan")
    scheme: object = None
    mass: Masses | None = None
    holding: Array = field(default_factory=lambda: _EMPTY)

    @cached_property
    def _forces(self) -> Array:
        """Forces of supports, ties and springs, (n,), of all processes."""
        return self.system.comm.gather_forces(self.holding)

    def velocity(self, name: str) -> Array:
        """Return the velocities of an unknown at every node.

        Parameters
        ----------
        name : str
            Name of the unknown.

        Returns
        -------
        array (points,)
            nan where there is none.

        Raises
        ------
        UnknownNameError
            There is no such unknown at nodes; a KeyError.
        """
        return self._nodal(name, self.v)

    def acceleration(self, name: str) -> Array:
        """Return the accelerations of an unknown at every node.

        Parameters
        ----------
        name : str
            Name of the unknown.

        Returns
        -------
        array (points,)
            nan where there is none.

        Raises
        ------
        UnknownNameError
            There is no such unknown at nodes; a KeyError.
        """
        return self._nodal(name, self.a)

    def _nodal(self, name: str, values: Array) -> Array:
        nodal, values = self._global_system.numbering.nodal, self.system.comm.gather(values)
        if name not in nodal:
            raise UnknownNameError(
                f"no unknown {name!r}{did_you_mean(name, nodal)}; at nodes: {join_names(nodal)}"
            )
        return np.where(nodal[name] >= 0, values[nodal[name]], np.nan)


@dataclass(frozen=True, eq=False)
class MotionState:
    """Time, unknowns x, velocities v, accelerations a (n,) of a motion, and its point data."""

    t: float
    x: Array
    v: Array
    a: Array
    histories: Mapping[str, Array]

    def step(self, t: float) -> Step:
        """A step to t in which nothing moves yet."""
        return Step(t, 1.0, self.x, 0.0, self.v, t - self.t, self.histories)

    def ended_step(self, dt: float) -> Step:
        """The present, as the end of a step of length dt with the present velocities."""
        return Step(self.t, 1.0, self.x - dt * self.v, 0.0, self.v, dt, self.histories)


Role: TypeAlias = Literal["load", "energy", "work", "tie", "contact", "none"]
"""Of a block in the account of energies: "energy": it has one, of the present state alone; "work":
it has none, only the work of its forces counts.
"""


@dataclass(frozen=True, eq=False)
class EnergyRoles:
    """Roles of the blocks of a system in the account of energies.

    of: block -> its role. multipliers: numbers of the unknowns of ties and contacts. bound: of the
    unknowns on which these act.
    """

    of: Mapping[str, Role]
    multipliers: Integers
    bound: Integers

    @classmethod
    def in_system(cls, system: System) -> EnergyRoles:
        """Of the equations without inertia."""
        names = contact_blocks(system)
        roles: dict[str, Role] = {}
        multipliers = [c.multipliers[c.multipliers >= 0] for c in system.contacts]
        bound = [c.bound for c in system.contacts]
        for block in system.assembler.blocks:
            kernel, page = block.kernel, system.blocks.get(block.name)
            if block.name in names:
                roles[block.name] = "contact"
            elif isinstance(kernel, Tie):
                roles[block.name] = "tie"
                multipliers.append(block.dofs[:, 2])
                bound.append(block.dofs[:, :2].ravel())
            elif isinstance(kernel, DeadLoad | NodalForce | Pressure):
                roles[block.name] = "load"
            else:
                past = page is not None and page.previous
                roles[block.name] = "energy" if has_energy(kernel) and not past else "work"
        none = np.empty(0, dtype=np.int64)
        return cls(
            of=roles,
            multipliers=np.unique(np.concatenate([none, *multipliers])),
            bound=np.unique(np.concatenate([none, *bound])),
        )


@dataclass(frozen=True, eq=False)
class Forces:
    """Forces on all unknowns, (n,) each: of loads, of what has an energy, of other pages, of ties
    and of contacts. conditions: the equations of the multipliers of contacts, zero elsewhere.
    springs: those among `stored`.

    On several processes: the contribution of the elements of this one.
    """

    loads: Array
    stored: Array
    others: Array
    ties: Array
    contact: Array
    conditions: Array
    springs: Array

    @classmethod
    def of(cls, problem: Problem, x: Array, roles: EnergyRoles) -> Forces:
        """Return the forces without inertia; ties and contacts without their own equations."""
        problem = problem.at(x)
        size = problem.assembler.size
        parts = {name: np.zeros(size) for name in ("load", "energy", "work", "tie", "contact")}
        springs = np.zeros(size)
        for block in problem.assembler.blocks:
            part = parts.get(roles.of.get(block.name, "none"))
            if part is not None and block.name in problem.parameters:
                local = block.residual(x, problem.parameters[block.name])
                np.add.at(part, block.dofs.ravel(), local.ravel())
                if isinstance(block.kernel, Spring):
                    np.add.at(springs, block.dofs.ravel(), local.ravel())
        conditions = np.zeros(size)
        conditions[roles.multipliers] = parts["contact"][roles.multipliers]
        for name in ("tie", "contact"):
            parts[name][roles.multipliers] = 0.0
        load, energy, work, tie, contact = parts.values()
        return cls(load, energy, work, tie, contact, conditions, springs)

    @property
    def total(self) -> Array:
        """Sum of all but those of ties and contacts."""
        return self.loads + self.stored + self.others

    @property
    def constraints(self) -> Array:
        """Of ties and contacts."""
        return self.ties + self.contact

    @property
    def unheld(self) -> Array:
        """Sum of all but those of ties, contacts and springs."""
        return self.total - self.springs

    def mean(self, other: Forces) -> Forces:
        """Mean of both; of ties and contacts those of the other, which are means of its step."""
        averaged = ("loads", "stored", "others", "springs")
        return replace(other, **{n: 0.5 * (getattr(self, n) + getattr(other, n)) for n in averaged})


def has_energy(kernel: object) -> bool:
    """True for a spring, and for a page with an energy of the present state alone."""
    if isinstance(kernel, Spring):
        return True
    if not isinstance(kernel, Kernel):
        return False
    timed = {"rate", "acceleration", "dt"} & set(kernel.parameters)
    return "energy" in kernel.tasks and not timed and not kernel.history


def stored_energy(problem: Problem, x: Array, roles: EnergyRoles | None = None) -> float:
    """Energies of springs and pages of this process at unknowns x, (n,)."""
    energy = 0.0
    for block in problem.assembler.blocks:
        if has_energy(block.kernel) if roles is None else roles.of.get(block.name) == "energy":
            energy += _energy(block, x, problem.parameters[block.name])
    return energy


def _energy(block: ElementBlock, x: Array, parameters: Array) -> float:
    """Energy of a block at unknowns x, (n,)."""
    kernel, u = block.kernel, x[block.dofs]
    if isinstance(kernel, Spring):
        return float(0.5 * kernel.stiffness * np.sum(u**2))
    assert isinstance(kernel, Kernel)
    values = kernel.energy(block.coordinates, np.ascontiguousarray(u), **block.given(parameters))
    return float(values.sum())


def parameter_work(
    initial: Problem,
    end: Problem,
    roles: EnergyRoles,
    xs: tuple[Array, Array],
    middle: Problem | None,
) -> float:
    """Work of parameters that changed in a step: on unknowns xs, those of its ends.

    middle: with whose parameters the forces of the step were averaged; None: forces are means of
    those at both ends.
    """
    work = 0.0
    for block in end.assembler.blocks:
        if roles.of.get(block.name) != "energy":
            continue
        old, new = (p.parameters[block.name] for p in (initial, end))
        mean = new if middle is None else middle.parameters[block.name]
        if np.array_equal(old, new) and np.array_equal(mean, new):
            continue
        W = [[_energy(block, x, p) for p in (old, mean, new)] for x in xs]
        if middle is None:
            work += 0.5 * (W[0][2] - W[0][0] + W[1][2] - W[1][0])
        else:
            work += W[0][1] - W[0][0] + W[1][2] - W[1][1]
    return work


class EnergyGain(RuntimeWarning):
    """The time integrator adds energy to a motion."""


@dataclass
class EnergyBalance:
    """Energies of a march: work of loads and of forces without an energy, since the beginning.

    comm: of the processes, of which each knows the work of its elements. largest: sum of the
    sizes of kinetic, internal and external energy so far. latest: what the last steps have gained;
    less counts where a motion begins from nothing, or is damped at once. remedy: against a gain.
    """

    comm: Communicator
    first: float = float("nan")
    external: float = 0.0
    others: float = 0.0
    largest: float = 0.0
    latest: list[float] = field(default_factory=list)
    warned: bool = False
    remedy: str = (
        'take a shorter dt, or method = "midpoint", which conserves energy, or "generalised-alpha" '
        "with rho_inf = 0, which damps most"
    )

    def add(self, forces: Forces, supports: Array, displacement: Array) -> None:
        """Work of forces, mean of a step, and of supports (n,), as the unknowns moved (n,).

        Ties work where their offset moves. Frictionless contact does no work.
        """
        self.external += float((supports - forces.loads - forces.ties) @ displacement)
        self.others += float(forces.others @ displacement)

    def balance(
        self, t: float, kinetic: float, stored: float, forces: Forces, x: Array
    ) -> dict[str, float]:
        """Energies at time t, of all processes; warns of a gain that has no source.

        forces: at the unknowns x, (n,): half of their product is the size of the energy of pages
        that have none.
        """
        size = 0.5 * float((forces.stored + forces.others) @ x)
        local_energies = np.array([kinetic, stored, self.external, self.others, size])
        kinetic, stored, external, others, size = self.comm.sum(local_energies).tolist()
        internal = stored + others
        if np.isnan(self.first):
            self.first = kinetic + internal
        balance = kinetic + internal - self.first - external
        present = kinetic + max(abs(internal), abs(size)) + abs(external)
        self.largest = max(self.largest, present)
        self.latest = [*self.latest[1 - LASTS :], balance]
        lasts = len(self.latest) == LASTS and min(self.latest) > GAIN * self.largest
        if lasts and not self.warned and self.comm.is_root:
            self.warned = True
            warn(
                f"t = {t:.6g}: {balance / self.largest:.0%} of the energy of the motion come from "
                f"the scheme, not from loads: {self.remedy}",
                EnergyGain,
                stacklevel=2,
            )
        return {
            **{"kinetic": kinetic, "internal": internal},
            **{"external": external, "balance": balance},
        }
