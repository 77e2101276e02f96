"""The meshes of the dry contact, each made for the contact that was seen on the one before.

A path from rest is followed on a coarse mesh with equal segments, unless another run has left a
state there. Graded meshes follow, and finer ones of the same layout. At high pressures the path
goes on in legs, each with a graded mesh of its own.

Runs leave contact states for each other, as the contact stage knows neither speed nor film. A state
is a file, named by all that it depends on. It is never trusted: it is where Newton's method starts
on the section's own equations, which a state that belongs to them fulfils already. A wrong or
damaged file costs a few iterations and cannot change a result. Files are written atomically;
processes that need the same state at the same time each find it for themselves.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from math import ceil
from pathlib import Path

import numpy as np

from softehl.cases.seal.equations.definition import contact_kernels
from softehl.cases.seal.equations.system import SealSystem, build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records import Numerics, Oil
from softehl.cases.seal.gland.surfaces import Surfaces
from softehl.cases.seal.solve.arc_meshing import CYCLES, DENSITY, contact_layout, on_wall
from softehl.cases.seal.solve.contact_solver import LEG, ContactSolver, State
from softehl.cases.seal.solve.contact_stages import contact_problem, correction_stage
from softehl.cases.seal.solve.load_stages import Stage, StageError
from softehl.cases.seal.states.contacts import contact_edges, unsealed
from softehl.runtime.arrays import Array
from softehl.runtime.io import read_arrays, write_arrays
from softehl.runtime.kernels.kernel import load_kernel

WITHOUT_INFLUENCE = (
    *(*Seal.names, "ogden_terms", "glass_transition"),  # values of others follow
    *(*Oil.model_fields, *Surfaces.model_fields, *Numerics.model_fields),
    *("cavitation", "cavitation_pressure", "cavitation_penalty", "shear_traction"),
    "heating",
    *("stroke", "speeds", "travel", "service", "error_estimate", "tolerance", "upwinding"),
    *("pressure_order", "reynolds", "quadrature", "quadrature_points"),
)
"""Parameters that the contact stage does not know."""

COARSE = 1
"""Density of the mesh on which the path from rest is followed."""


MISPLACED = 2.5
"""Misplacement above which a mesh is made again, after a path of several legs: at p_s / mu = 6.5
one more mesh took it from 6.3 to 1.5, and an outstroke without a film then had one. Of sections
that are not round after any path: of four X-rings one edge of four was misplaced by 5.5 to 10, one
more mesh (2 s) took three of them below 2."""


FIRST_LEG = 2.0
"""Largest end of the first leg of the pressure, over the shear modulus. A first leg to 2.4 on the
coarse mesh could not be carried to a graded one, and its path was followed again from rest; from
1.9 it could."""


def legs_of(p: Seal) -> list[float]:
    """Pressures (MPa) at which a path to the contact of a case gets a new mesh; the last is p_s.

    With friction one leg: what slips remembers its path.
    """
    end = p.load_ratio(p.sealed_pressure)
    if p.rubs or end <= FIRST_LEG:
        return [p.sealed_pressure]
    count = ceil((end - FIRST_LEG) / LEG - 1e-9)
    ratios = [end - LEG * k for k in range(count, 0, -1)]
    return [*(ratio / end * p.sealed_pressure for ratio in ratios), p.sealed_pressure]


def misplacement(system: SealSystem, x: Array) -> float:
    """Longest segment at an edge of the contact x (n,), over that which its slope asks for.

    The finest segment of the mesh is meant for the steepest edge, others grow as K^-1.2.
    """
    positions = system.section.positions
    segments, edges = np.diff(positions), contact_edges(system, x)
    steepest = max((edge.rise for edge in edges), default=1.0)
    ratios = [1.0]
    for edge in edges:
        k = int(np.clip(np.searchsorted(positions, edge.position) - 1, 0, len(segments) - 1))
        required = segments.min() * (edge.rise / steepest) ** -0.6
        ratios.append(float(segments[max(0, k - 1) : k + 2].max() / required))
    return max(ratios)


def contact_key(parameters: Seal) -> str:
    """Name of a contact state: all parameters but those without influence, and the kernels."""
    kernels = contact_kernels(parameters)
    values = parameters.model_dump(exclude=set(WITHOUT_INFLUENCE))
    if parameters.outline is not None:
        values["outline"] = hashlib.sha256(Path(parameters.outline).read_bytes()).hexdigest()
    values["kernels"] = {name: load_kernel(name).signature for name in kernels}
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:32]


@dataclass(frozen=True)
class ContactStore:
    """Contact states in a folder; without a folder there are none."""

    folder: Path | None = None

    def densities(self, parameters: Seal, among: Sequence[int]) -> list[int]:
        """Densities of which there is a state, good or not; finest first."""
        if self.folder is None:
            return []
        sections = [parameters.model_copy(update={"density": d}) for d in among]
        return sorted((p.density for p in sections if self._path(p).exists()), reverse=True)

    def read(self, system: SealSystem) -> Array:
        """Unknowns to start from; nan, which Newton's method rejects, where no file fits."""
        stored = read_arrays(self._path(system.parameters)) or {}
        x, layout = system.at_rest(), system.layout
        for name in _fields(system):
            part = stored.get(name)
            fits = part is not None and part.shape == (layout.count(name),)
            x[layout.part(name)] = part if fits else np.nan
        return x

    def keep(self, system: SealSystem, x: Array) -> None:
        """Leave the contact state x for others; a folder that cannot be written to is no error."""
        if self.folder is None:
            return
        parts = {name: x[system.layout.part(name)] for name in _fields(system)}
        with suppress(OSError):
            self.folder.mkdir(parents=True, exist_ok=True)
            write_arrays(self._path(system.parameters), parts)

    def _path(self, parameters: Seal) -> Path:
        assert self.folder is not None
        return self.folder / f"{contact_key(parameters)}.npz"


def _fields(system: SealSystem) -> tuple[str, ...]:
    """Fields of a contact state: film pressures, whose number depends on m_p, are all zero."""
    return tuple(field.name for field in system.contact_fields())


def stored_contact(system: SealSystem) -> Stage:
    """A stage of one step that verifies a stored state, or corrects it in a few iterations."""
    problem = contact_problem(system, system.parameters.sealed_pressure)
    return correction_stage(system, problem, "newton, from a stored contact state")


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
        stored = self.store.densities(p, densities) if p.solver == "auto" else []
        system = build_system(_at(p, (*stored, first)[0]))
        return self._finer(system, self._first_state(system), p.density)

    def _graded(self, p: Seal) -> State:
        """On meshes that the contact places, the last of which is finer."""
        # what sticks keeps the rotation of the mesh on which it began to
        guide = min(DENSITY, p.density)
        coarse = guide if p.rubs else COARSE
        first, *legs = (p.model_copy(update={"sealed_pressure": end}) for end in legs_of(p))
        uniform = build_system(_at(first.model_copy(update={"mesh": "uniform"}), coarse))
        seen = self._next((uniform, self._first_state(uniform)), _at(first, coarse))
        state = self._next(seen, _at(first, guide))
        for leg in legs:
            state = self._leg(state, _at(leg, guide))
        return self._sealed(p, self._finer(*state, p.density))

    def _sealed(self, p: Seal, state: State) -> State:
        """On a mesh whose arc and whose sealed pressure end well, of a few that are made for it."""
        for _ in range(CYCLES - 1):
            system, x = state
            if p.given_arc or not (unsealed(system, x) or on_wall(system, x)):
                break
            state = self._next(state, p)
        judged = not p.round or len(legs_of(p)) > 1
        return self._placed(p, state) if judged else state

    def _placed(self, p: Seal, state: State) -> State:
        """On a mesh whose fine segments lie at the edges of the contact, of a few made for it."""
        for _ in range(CYCLES - 1):
            if p.given_arc or misplacement(*state) <= MISPLACED:
                break
            try:
                state = self._next(state, p)
            except StageError:  # a coarse edge is judged by its films
                break
        return state

    def _leg(self, state: State, p: Seal) -> State:
        """Under the pressure of p, on a mesh that is made for the contact under a lower one."""
        old, x = state
        return self.solver.leg(old, x, build_system(p, contact_layout(old, x, p)))

    def _next(self, state: State, p: Seal) -> State:
        """On a mesh that is made for the contact on another one."""
        old, x = state
        system = build_system(p, contact_layout(old, x, p))
        return self.solver.from_mesh(old, x, system, name="contact on a graded mesh")

    def _first_state(self, system: SealSystem) -> Array:
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
