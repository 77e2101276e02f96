"""The equations of a seal: the declared system on a section, its unknowns, and its problems."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from softehl.cases.seal.equations import scales
from softehl.cases.seal.equations.loads import ContactLoads, FilmLoads
from softehl.cases.seal.equations.study import NUMBERED, chosen, seal_study
from softehl.cases.seal.equations.system import (
    AIR_WALL,
    AXIAL,
    FIELDS,
    MOVED,
    PRESSURE,
    ROD,
    ROTATION,
    VOID,
    WALLS,
    Block,
    Group,
    Values,
    blocks_of,
    contact_values,
    film_values,
    obstacles_of,
    without_contact,
)
from softehl.cases.seal.equations.unknowns import SealUnknowns
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.section.layout import Layout
from softehl.cases.seal.section.section import SealSection, seal_section
from softehl.runtime.arrays import Array
from softehl.runtime.fem.contact import Obstacle
from softehl.runtime.fem.guards import ChangesLittle, Guard, KeepsOrientation, StaysPositive
from softehl.runtime.fem.problem import Problem

_STEP = 0.9
"""Share of its thickness that a film may lose in an iteration. Nine seals take 1.5 % more of them
with 0.7, 2 % fewer with 0.97; a rough film, which may change by sigma in any case, none."""


@dataclass(frozen=True, eq=False)
class SealSystem(SealUnknowns):
    """A section with its unknowns and equations: everything that does not change while loads do.

    blocks: those that the case has. obstacles: by block name. problem: the contact problem at
    p_s = 0 with the film switched off and its pressures prescribed to be zero; mean rotation is
    held in it, even if a later stage lets it go.
    """

    blocks: tuple[Block, ...]
    obstacles: Mapping[str, Obstacle]
    problem: Problem

    @classmethod
    def of(cls, p: Seal, section: SealSection) -> SealSystem:
        """The system of a case on a section."""
        present = blocks_of(p)
        posed = seal_study(p, section, present).system(NUMBERED)
        numbering = posed.numbering
        cells = section.coordinates("cells"), numbering.at(MOVED, section.mesh.quads)
        still = replace(
            posed.resting(),
            scales={f.name: f.scale(p) for f in FIELDS if f.name in numbering.layout.names},
            absolute=True,
            guards=(KeepsOrientation(*cells),),
        )
        off = {block.name: None for block in present if block.of_film}
        system = cls(p, section, numbering, present, obstacles_of(p), still.with_parameters(**off))
        films = [system.layout.dofs(field.name) for field in system.film_fields()]
        return replace(system, problem=system.problem.with_fixed(films, [0.0] * len(films)))

    def moved(self, p: Seal, section: SealSection) -> SealSystem:
        """The system of other numbers on the same mesh with its nodes moved."""
        found = SealSystem.of(p, section)
        structure = self.problem.assembler.structure  # what is known of its pattern stays
        assembler = replace(found.problem.assembler, structure=structure)
        return replace(found, problem=replace(found.problem, assembler=assembler))

    @property
    def pressure_boundary(self) -> int:
        """Index of the arc node at which the sealed pressure of the contact ends."""
        return self.section.lowest

    # --- blocks -----------------------------------------------------------------------------------

    @property
    def solids(self) -> tuple[str, ...]:
        """Names of the blocks of the solid; their elements in order are those of the mesh."""
        return tuple(block.name for block in self.blocks if block.group == "solid")

    @property
    def bulk_moduli(self) -> Array:
        """Bulk modulus (elements,) of each element, MPa."""
        solids = [block for block in self.blocks if block.group == "solid"]
        moduli = [self.parameters.rubber(block.region).bulk_modulus for block in solids]
        return np.repeat(moduli, [len(self.section.elements[b.elements]) for b in solids])

    def reaction(self, name: str, x: Array) -> float:
        """Axial force of a wall on the section, the sum of normal forces on the bore, N."""
        if name == AIR_WALL and self.parameters.opens:
            block = self.problem.assembler.block(name)
            residual = block.residual(x, self.problem.parameters[name])
            return self.side * float(residual[:, 0].sum())
        return float(self.pressing(name, x) @ self.areas(WALLS[name]))

    # --- loads ------------------------------------------------------------------------------------

    def contact_problem(self, loads: ContactLoads) -> Problem:
        """Frictionless contact (9)-(10) under a sealed pressure (8)."""
        problem = self.problem.with_parameters(**contact_values(loads))
        if loads.moment is not None:
            problem = problem.also_fixed(self.layout.dofs(ROTATION), loads.moment)
        if loads.place is not None:
            return problem
        return problem.also_fixed(self.layout.dofs(AXIAL), -self.side * loads.axial_force)

    def film_problem(self, film: FilmLoads) -> Problem:
        """Film forces (18) and the Reynolds equation (25); the contact with the rod is without."""
        contact = self.contact_problem(ContactLoads(film.sealed_pressure, place=film.place))
        problem = contact.with_parameters(
            **without_contact(), **self._given("film", film_values(self.parameters, film))
        )
        fixed = [self.film_ends, self.layout.dofs(ROD)]
        values: list[Array | float] = [film.ends, 0.0]
        if self.parameters.conserving:
            fixed.append(self._ends(VOID))
            values.append(np.array(film.inflow))
        if film.place is None:
            fixed.append(self.layout.dofs(AXIAL))
            values.append(0.0)
        if film.moment is not None:
            fixed.append(self.layout.dofs(ROTATION))
            values.append(film.moment)
        fluxes = self.flux_scales(film.speed, film.gap)
        return replace(
            problem.with_fixed(fixed, values),
            scales={**problem.scales, PRESSURE: fluxes},
            guards=(*problem.guards, self.film_guard()),
        )

    def squeeze_values(self, rate: float) -> dict[str, Values]:
        """Parameters of the block of what the film holds; rate: coefficient of d/dt, 1/s."""
        values = {"rod_radius": self.rod_radius, "rate": rate, **self.parameters.surfaces.values()}
        return self._given("squeeze", values)

    def film_guard(self) -> Guard:
        """Film thickness at the nodes of the arc: positive in every iterate between smooth
        surfaces; between rough ones, which may interpenetrate, it changes little at a time.
        """
        nodes = self.mesh.arc_nodes
        radii = self.numbering.nodal["u_r"][nodes]
        gaps = self.mesh.points[nodes, 1] - self.rod_radius
        if self.parameters.rough:
            return ChangesLittle(radii, gaps, _STEP, self.parameters.surfaces.sigma)
        return StaysPositive(radii, gaps, _STEP)

    def flux_scales(self, speed: float, gap: Array) -> Array:
        """Reference fluxes (n,), mm^2/s, of the equations of the pressure at |U| (mm/s).

        gap: (arc nodes,) film thickness, mm, near enough.
        """
        p, arc = self.parameters, self.mesh.points[self.mesh.arc_nodes]
        h, dx = np.maximum(gap[1:], gap[:-1]), np.linalg.norm(np.diff(arc, axis=0), axis=1)
        driven = scales.pressure_flux(h, dx, p.pressure_order, p.viscosity)
        largest = np.zeros(self.pressure_count)
        np.maximum.at(
            largest, self.pressure_dofs() - self.layout.part(PRESSURE).start, driven[:, None]
        )
        return scales.film_flux(speed) + largest

    def _given(self, group: Group, values: Values) -> dict[str, Values]:
        """Values that the blocks of a group ask for, by block."""
        return {
            block.name: chosen(block, self.problem.assembler.block(block.name).kernel, values)
            for block in self.blocks
            if block.group == group
        }


def build_system(
    p: Seal, layout: Layout | None = None, density: Fraction | None = None
) -> SealSystem:
    """The system of a case on its section; see `seal_section`."""
    return SealSystem.of(p, seal_section(p, layout, density))
