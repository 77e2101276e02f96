"""Solver of the dry contact on one mesh: by its path from rest, or from the state of another mesh.

A loaded state of another mesh is carried over and corrected by Newton's method. If that fails, the
path is resumed at a checkpoint under less pressure, carried in the same way; if that does not lead
on either, at rest, which is the same on every mesh.

Above two or three shear moduli the section fills the corners of its groove but for pockets of a few
elements. Newton's method does not correct the errors that interpolation leaves there. Under less
pressure the pockets are wider: checkpoints are kept half a shear modulus apart. At 5.4 shear moduli
the pocket that stops a carry is that between housing and wall, whose mesh differs with the arc's.

Beyond the end of a load path the section creeps to its contact, by pseudo-transient continuation.
No step of the pressure is short enough for a section that snaps over, or for a node that is in
contact by neither of its two states. Implicit steps in time under the whole pressure go on from
there. A spring mu V / (d^2 tau) holds every node at its last place, with its volume V and the
section diameter d. A short tau makes the next state unique; a long one leaves the contact alone.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
from scipy.sparse import csc_array, diags_array

from softehl.cases.seal.correctors.proximal_term import Anchored
from softehl.cases.seal.equations.system import SealSystem, build_system
from softehl.cases.seal.solve.contact_stages import (
    approach_stage,
    at_air_wall,
    contact_problem,
    correction_stage,
    held_place,
    load_stage,
    release_stage,
)
from softehl.cases.seal.solve.correctors import PressureNewton
from softehl.cases.seal.solve.load_stages import PathDriver, Stage, StageError
from softehl.cases.seal.solve.transfer import carried_contact
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.mass import lumped, mass_matrices
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.pseudo_transient import PseudoTransient, TransientState
from softehl.runtime.solve.solution import Point, Solution

FIRST, LAST = 1e-4, 1e3
"""First step, and that from which on the contact is at rest. From 1e-2 the first step of a section
at 4.6 shear moduli fails; from 1e-4 it takes 11 steps, from 1e-6 14."""

MOVED = 0.02
"""Displacement of a step that a linearisation just bears, section diameters."""

_TOLERANCE = 1e-6
"""Residual of a step in time; the contact itself is solved afterwards."""


@dataclass(frozen=True, eq=False)
class Creeping:
    """A section that creeps to its contact under p_s; satisfies `Transient`."""

    system: SealSystem

    def step(self, previous: Array, tau: float, load: float) -> Anchored:
        """See `Transient`; the load is always whole."""
        problem = contact_problem(self.system, self.system.parameters.sealed_pressure)
        return Anchored(
            problem.since(previous), csc_array(diags_array(self._springs / tau)), previous
        )

    def change(self, previous: Array, after: Array) -> float:
        """Largest displacement of a node, over `MOVED`."""
        moved = self.system.displacements(after) - self.system.displacements(previous)
        return float(np.abs(moved).max() / (MOVED * self.system.parameters.section_diameter))

    @cached_property
    def _springs(self) -> Array:
        """Stiffness (n,) of the springs at tau = 1, N/mm; 0 of what is no displacement."""
        system, p = self.system, self.system.parameters
        springs = np.zeros(system.layout.total)
        for solid in system.solids:
            block = system.problem.assembler.block(solid)
            coordinates = block.coordinates.reshape(len(block.dofs), -1, 2)
            density = np.full(len(coordinates), p.shear_modulus / p.section_diameter**2)
            weights = lumped(mass_matrices(CELLS["quad4"], coordinates, density, ring=True))
            np.add.at(springs, block.dofs, np.repeat(weights, 2, axis=1))
        return springs


@dataclass(frozen=True, eq=False)
class CreepCorrector:
    """Contact under p_s from a state under any pressure: in time, then by Newton's method."""

    system: SealSystem
    newton: Newton

    def solve(self, problem: Problem, x0: Array) -> Solution:
        """See `Corrector`."""
        settings = replace(self.newton, tolerance=_TOLERANCE, stagnation=1.0)
        steps = PseudoTransient(PressureNewton(settings, self.system), last=LAST)
        branch, _ = steps.follow(
            Creeping(self.system),
            TransientState(x0, FIRST, 1.0),
            finish=lambda x: PressureNewton(self.newton, self.system).solve(problem, x),
        )
        made, spent = branch.factorisations, branch.iterations
        return replace(branch.end, factorisations=made, iterations=spent)


State: TypeAlias = tuple[SealSystem, Array]

LEG = 0.5
"""Length of a leg of the pressure, in shear moduli: a contact at 5.4 was carried from mesh to mesh
in all legs but one of 0.5, its pocket shrinks by a quarter in each."""

_SHARE = 0.5
"""Of the sealed pressure; going back to rest at once takes 1.4 times the work."""


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A contact state x (n,) on the mesh of a system, under a sealed pressure, MPa."""

    system: SealSystem
    pressure: float
    x: Array


@dataclass(eq=False)
class ContactSolver:
    """Finds contact states.

    driver: follows their paths. checkpoints: where the last path may be taken up again, the one
    under the highest pressure last; none where there is nothing but rest. They change with a path.
    """

    driver: PathDriver
    checkpoints: list[Checkpoint] = field(default_factory=list)

    def from_rest(self, system: SealSystem) -> Array:
        """The contact state (n,) by its path: rod approach, then the sealed pressure.

        Raises StageError.
        """
        x, position = self._follow(system, approach_stage(system), system.at_rest()), None
        if held_place(system.parameters) is not None:
            return x
        if system.parameters.sealed_pressure > 0.0:
            x, position = at_air_wall(system, x)
        if system.parameters.rubs:
            x, position = self._follow(system, release_stage(system, x), x), None
        return self._loaded(system, x, position=position)

    def from_mesh(self, old: SealSystem, x: Array, new: SealSystem, name: str = "") -> State:
        """The contact state x (n,) of one mesh on another; name: of the stage.

        Raises StageError.
        """
        p_s = new.parameters.sealed_pressure
        with suppress(StageError):
            return new, self._corrected(Checkpoint(old, p_s, x), new, name)
        for previous in reversed(self.checkpoints):
            with suppress(StageError):
                start = self._corrected(previous, new, _at(previous.pressure))
                return new, self._loaded(new, start, previous.pressure)
        return new, self.from_rest(new)

    def leg(self, old: SealSystem, x: Array, new: SealSystem) -> State:
        """The contact state x (n,) of one mesh on another, under the higher pressure of that.

        The old mesh is kept if its state is not found on the new one under its own pressure.
        Raises StageError.
        """
        begin = Checkpoint(old, old.parameters.sealed_pressure, x)
        try:
            start = self._corrected(begin, new, _at(begin.pressure))
        except StageError:
            new, start = build_system(new.parameters, old.section.layout), x
        return new, self._loaded(new, start, begin.pressure)

    def _corrected(self, state: Checkpoint, new: SealSystem, name: str) -> Array:
        """A state of another mesh on ours, (n,), under the same pressure."""
        path_stage, start = carried_contact(state.system, new, state.x, state.pressure, name)
        return self.driver.follow(path_stage, start)

    def _loaded(
        self, system: SealSystem, x: Array, begin: float = 0.0, position: float | None = None
    ) -> Array:
        """From the section x (n,) to the sealed pressure; begin, position: as of `load_stage`."""
        path_stage = load_stage(system, begin, position)
        self.checkpoints = [state for state in self.checkpoints if state.pressure < begin]
        path_stage = replace(path_stage, on_point=lambda point: self.keep(system, point, begin))
        try:
            return self._follow(system, path_stage, x)
        except StageError as failed:
            if not system.parameters.rubs:  # friction remembers its path
                last = failed.branch.last.x if failed.branch.points else x
                with suppress(StageError):
                    return self.driver.follow(self._creep(system), last)
            raise

    def keep(self, system: SealSystem, point: Point, begin: float = 0.0) -> None:
        """A state of a path of the pressure. With friction none: what slips remembers its path.

        begin: where the path was taken up, MPa. From rest one state is kept, else one a leg.
        """
        p, pressure = system.parameters, point.parameter
        leg = 0.9 * LEG * p.shear_modulus  # a step that ends just before a leg does counts
        highest = max(begin, p.sealed_pressure - leg) if begin else _SHARE * p.sealed_pressure
        if p.rubs or not 0.0 < pressure <= highest:
            return
        if not begin:
            self.checkpoints = []
        last = self.checkpoints[-1].pressure if self.checkpoints else -leg
        if pressure == begin or pressure >= last + leg:
            self.checkpoints.append(Checkpoint(system, pressure, point.solution.x))

    def _creep(self, system: SealSystem) -> Stage:
        """From a state under any pressure to the sealed pressure."""
        problem = contact_problem(system, system.parameters.sealed_pressure)
        method, name = "pseudo-transient continuation", "creep to the contact"
        path_stage = correction_stage(system, problem, method, name)
        return replace(path_stage, corrector=CreepCorrector(system, self.driver.newton))

    def _follow(self, system: SealSystem, path_stage: Stage, x: Array) -> Array:
        """To the end of a stage, by the corrector of paths."""
        p = system.parameters
        if p.solver == "auto" and not p.rubs:
            path_stage = replace(path_stage, corrector=PressureNewton(self.driver.newton, system))
        return self.driver.follow(path_stage, x)


def _at(pressure: float) -> str:
    """Name of the stage that corrects a state under a pressure."""
    return f"contact at {pressure:.4g} MPa"
