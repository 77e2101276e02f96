"""The dry contact beyond the end of its load path, by pseudo-transient continuation.

No step of the pressure is short enough for a section that snaps over, or for a node that is in
contact by neither of its two states. Implicit steps in time under the whole pressure go on from
there. A spring mu V / (d^2 tau) holds every node where it was, with its volume V and the section
diameter d. A short tau makes the next state unique; a long one leaves the contact alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csc_array, diags_array

from softehl.cases.seal.correctors.proximal_term import Anchored
from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.solve.contact import contact_problem
from softehl.cases.seal.solve.correctors import PressureNewton
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.mass import lumped, mass_matrices
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.pseudo_transient import PseudoTransient, TransientState
from softehl.runtime.solve.solution import Solution

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

    def step(self, before: Array, tau: float, load: float) -> Anchored:
        """See `Transient`; the load is always whole."""
        problem = contact_problem(self.system, self.system.parameters.sealed_pressure)
        return Anchored(problem.since(before), csc_array(diags_array(self._springs / tau)), before)

    def change(self, before: Array, after: Array) -> float:
        """Largest displacement of a node, over `MOVED`."""
        moved = self.system.displacements(after) - self.system.displacements(before)
        return float(np.abs(moved).max() / (MOVED * self.system.parameters.section_diameter))

    @cached_property
    def _springs(self) -> Array:
        """Stiffness (n,) of the springs at tau = 1, N/mm; 0 of what is no displacement."""
        system, p = self.system, self.system.parameters
        springs = np.zeros(system.layout.total)
        for solid in system.solids:
            block = system.problem.assembler.block(solid)
            places = block.coordinates.reshape(len(block.dofs), -1, 2)
            density = np.full(len(places), p.shear_modulus / p.section_diameter**2)
            shares = lumped(mass_matrices(CELLS["quad4"], places, density, ring=True))
            np.add.at(springs, block.dofs, np.repeat(shares, 2, axis=1))
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
