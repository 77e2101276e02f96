"""The meshes of the dry contact, each made for the contact that was seen on the one before.

A path from rest is followed on a coarse mesh with equal segments, unless another run has left a
state there. Graded meshes follow, and finer ones of the same layout.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field

from softehl.cases.seal.equations.equations import SealSystem, build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.solve.contact_layout import contact_layout, on_wall
from softehl.cases.seal.solve.contact_solver import ContactSolver, State
from softehl.cases.seal.solve.contact_store import ContactStore, stored_contact
from softehl.cases.seal.solve.path import StageError
from softehl.cases.seal.states.contact_results import unsealed
from softehl.runtime.arrays import Array

COARSE = 1
"""Density of the mesh on which the path from rest is followed."""

GUIDE = 2
"""Density of the last graded mesh; finer ones have its layout."""

SEALS = 3
"""Meshes, at most, until the sealed pressure ends where something touches and the arc off walls."""


@dataclass(frozen=True, eq=False)
class ContactMeshes:
    """Finds the contact of a case on a mesh that fits it.

    store: states of meshes with equal segments that runs leave for each other.
    """

    solver: ContactSolver
    store: ContactStore = field(default_factory=ContactStore)

    def contact(self, p: Seal) -> State:
        """The system of a case and its unknowns (n,) in contact under p_s.  Raises StageError."""
        graded = p.mesh == "graded" or (p.mesh == "uniform" and p.given_arc is None)
        return self._graded(p) if graded else self._uniform(p)

    def _uniform(self, p: Seal) -> State:
        """On equal segments: the path on the coarsest mesh, then finer ones."""
        first = p.density if p.solver != "auto" else COARSE
        densities = list(_doublings(first, p.density))
        kept = self.store.densities(p, densities) if p.solver == "auto" else []
        system = build_system(_at(p, (*kept, first)[0]))
        return self._finer(system, self._begun(system), p.density)

    def _graded(self, p: Seal) -> State:
        """On meshes that the contact places, the last of which is finer."""
        # what sticks keeps the rotation of the mesh on which it began to
        guide = min(GUIDE, p.density)
        coarse = guide if p.rubs else COARSE
        uniform = build_system(_at(p.model_copy(update={"mesh": "uniform"}), coarse))
        seen = self._next((uniform, self._begun(uniform)), _at(p, coarse))
        return self._finer(*self._sealed(_at(p, guide), seen), p.density)

    def _sealed(self, p: Seal, state: State) -> State:
        """On the last of the graded meshes; on more where its arc or the pressure ends badly."""
        for _ in range(SEALS):
            state = self._next(state, p)
            if p.given_arc or not (unsealed(*state) or on_wall(*state)):
                break
        return state

    def _next(self, state: State, p: Seal) -> State:
        """On a mesh that is made for the contact on another one."""
        system = build_system(p, contact_layout(*state, p))
        return self.solver.from_mesh(*state, system, "contact on a graded mesh")

    def _begun(self, system: SealSystem) -> Array:
        """Unknowns (n,) on the first mesh: a stored state if there is a good one, else the path."""
        p = system.parameters
        if p.solver == "auto" and self.store.densities(p, (p.density,)):
            with suppress(StageError):
                return self.solver.driver.follow(stored_contact(system), self.store.read(system))
        x = self.solver.from_rest(system)
        self.store.keep(system, x)
        return x

    def _finer(self, system: SealSystem, x: Array, density: int) -> State:
        """On meshes of the same layout up to a density, doubling by doubling."""
        while (p := system.parameters).density < density:
            finer = build_system(_at(p, 2 * p.density), system.section.layout)
            system, x = self.solver.from_mesh(system, x, finer)
            if p.mesh != "graded":
                self.store.keep(system, x)
        return system, x


def _doublings(first: int, last: int) -> Iterator[int]:
    """first, 2 first, ... up to last."""
    while first <= last:
        yield first
        first *= 2


def _at(p: Seal, density: int) -> Seal:
    return p.model_copy(update={"density": density})
