"""The equations of a seal: the declared system on a section, its unknowns, and its problems."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from softehl.cases.seal.equations import scales
from softehl.cases.seal.equations.declared import Block, Field, Numbering
from softehl.cases.seal.equations.loads import ContactLoads, FilmLoads
from softehl.cases.seal.equations.system import (
    AIR_WALL,
    AXIAL,
    DISPLACEMENT,
    FIELDS,
    PRESSURE,
    ROD,
    ROTATION,
    VOID,
    WALLS,
    Values,
    blocks_of,
    contact_values,
    film_values,
    obstacles_of,
    values_at_rest,
    without_contact,
)
from softehl.cases.seal.equations.unknowns import SealUnknowns
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.section.layout import Layout
from softehl.cases.seal.section.section import SealSection, seal_section
from softehl.runtime.arrays import Array
from softehl.runtime.fem.assembly import Assembler, Memo
from softehl.runtime.fem.contact import Obstacle, contact_data, tributary_areas
from softehl.runtime.fem.guards import ChangesLittle, Guard, KeepsOrientation, StaysPositive
from softehl.runtime.fem.problem import Problem
from softehl.runtime.kernels import load_kernel

_STEP = 0.9  # of its thickness a film may lose in an iteration
_ROUGH_STEP = 0.7  # of its thickness that of a rough film may change, at least by sigma


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
    def of(
        cls,
        p: Seal,
        section: SealSection,
        fields: tuple[Field, ...] = FIELDS,
        blocks: tuple[Block, ...] | None = None,
    ) -> SealSystem:
        """The system of a case on a section."""
        numbering = Numbering.of(fields, p, section)
        present = tuple(b for b in blocks or blocks_of(p) if b.needed(p))
        constants = _contact_constants(p, section, present)
        elements = [numbering.element_block(b, p, constants.get(b.name)) for b in present]
        cells = section.coordinates("cells"), numbering.rows(DISPLACEMENT, "cells")
        problem = Problem(
            assembler=Assembler.build(numbering.layout.total, elements),
            layout=numbering.layout,
            parameters={},
            scales={name: u.field.scale(p) for name, u in numbering.unknowns.items()},
            absolute=True,
            guards=(KeepsOrientation(*cells),),
        )
        system = cls(p, section, numbering, present, obstacles_of(p), problem)
        return replace(system, problem=system._at_rest())

    def moved(self, p: Seal, section: SealSection) -> SealSystem:
        """The system of other numbers on the same mesh with its nodes moved; nothing is checked."""
        constants = _contact_constants(p, section, self.blocks)
        assembler, stays = self.problem.assembler, section is self.section
        placed = [
            section.coordinates(d.elements)
            if d.elements in section.elements and not stays
            else b.coordinates
            for b, d in zip(assembler.blocks, self.blocks, strict=True)
        ]
        elements = tuple(
            replace(b, coordinates=at, data=constants.get(b.name, b.data))
            for b, at in zip(assembler.blocks, placed, strict=True)
        )
        cells = section.coordinates("cells"), self.numbering.rows(DISPLACEMENT, "cells")
        problem = replace(
            self.problem,
            assembler=replace(assembler, blocks=elements, memo=Memo()),
            guards=(KeepsOrientation(*cells),),
        )
        system = replace(
            self, parameters=p, section=section, obstacles=obstacles_of(p), problem=problem
        )
        return replace(system, problem=system._at_rest())

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
        blocks = [block for block in self.blocks if block.group == "solid"]
        return np.concatenate(
            [
                np.full(
                    len(self.section.elements[b.elements]),
                    self.parameters.rubber(b.region).bulk_modulus,
                )
                for b in blocks
            ]
        )

    def reaction(self, name: str, x: Array) -> float:
        """Axial force of a wall on the section, the sum of normal forces on the bore, N."""
        if name == AIR_WALL and self.parameters.opens:
            block = self.problem.assembler.block(name)
            residual = block.residual(x, self.problem.parameters[name])
            return self.side * float(residual[:, 0].sum())
        nodes, segments = self.section.chains[WALLS[name]]
        areas = tributary_areas(self.mesh.points, segments, nodes)
        return float(self.pressing(name, x) @ areas)

    def columns(self, block: str, field: str) -> slice:
        """Columns of the unknowns of a field in the dof map of a block."""
        return self.numbering.columns(self._block(block), field)

    # --- loads ------------------------------------------------------------------------------------

    def contact_problem(self, loads: ContactLoads) -> Problem:
        """Frictionless contact (9)-(10) under a sealed pressure (8)."""
        values = self._present(contact_values(loads))
        problem = self.problem.with_parameters(**values)
        if loads.moment is not None:
            problem = problem.also_fixed(self.layout.dofs(ROTATION), loads.moment)
        if loads.place is not None:
            return problem
        return problem.also_fixed(self.layout.dofs(AXIAL), -self.side * loads.axial_force)

    def film_problem(self, film: FilmLoads) -> Problem:
        """Film forces (18) and the Reynolds equation (25); the contact with the rod is without."""
        contact = self.contact_problem(ContactLoads(film.sealed_pressure, place=film.place))
        problem = contact.with_parameters(
            **self._present(without_contact()), **self._film_parameters(film)
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
        fluxes = self.flux_scales(max(film.speed, film.least_speed), film.gap)
        return replace(
            problem.with_fixed(fixed, values),
            scales={**problem.scales, PRESSURE: fluxes},
            guards=(*problem.guards, self.film_guard()),
        )

    def squeeze_values(self, rate: float) -> dict[str, Values]:
        """Parameters of the block of what the film holds; rate: coefficient of d/dt, 1/s."""
        given = {"rod_radius": self.rod_radius, "rate": rate, **self.parameters.surfaces.values()}
        return {b.name: self._chosen(b, given) for b in self.blocks if b.group == "squeeze"}

    def film_guard(self) -> Guard:
        """Film thickness at the nodes of the arc: positive in every iterate between smooth
        surfaces; between rough ones, which may interpenetrate, it changes little at a time.
        """
        nodes = self.mesh.arc_nodes
        radii = self.layout.part(DISPLACEMENT).start + 2 * nodes + 1
        gaps = self.mesh.points[nodes, 1] - self.rod_radius
        if self.parameters.rough:
            return ChangesLittle(radii, gaps, _ROUGH_STEP, self.parameters.surfaces.sigma)
        return StaysPositive(radii, gaps, _STEP)

    def flux_scales(self, speed: float, gap: Array) -> Array:
        """Reference fluxes (n,), mm^2/s, of the equations of the pressure at |U| (mm/s).

        gap: (arc nodes,) film thickness, mm, near enough.
        """
        unknowns, arc = self.numbering.unknowns[PRESSURE], self.mesh.points[self.mesh.arc_nodes]
        h, dx = np.maximum(gap[1:], gap[:-1]), np.linalg.norm(np.diff(arc, axis=0), axis=1)
        driven = scales.pressure_flux(h, dx, unknowns.order, self.parameters.viscosity)
        largest = np.zeros(unknowns.count)
        np.maximum.at(largest, unknowns.rows["arc"], driven[:, None])
        return scales.film_flux(speed) + largest

    # --- inside -----------------------------------------------------------------------------------

    def _at_rest(self) -> Problem:
        """See `problem`."""
        given = {b: values_at_rest(b, self.parameters, self.section) for b in self.blocks}
        chosen = {b.name: self._chosen(b, values) for b, values in given.items() if values}
        problem = self.problem.with_parameters(**chosen)
        pressures = [field.name for field in self.film_fields()]
        return problem.with_fixed([self.layout.dofs(n) for n in pressures], [0.0] * len(pressures))

    def _film_parameters(self, film: FilmLoads) -> dict[str, Values]:
        """Parameters of every term of the film."""
        values = film_values(self.parameters, film)
        return {block.name: self._chosen(block, values) for block in self._film_blocks}

    def _present(self, values: Mapping[str, Values | None]) -> dict[str, Values | None]:
        """Values by block, of the blocks that there are."""
        names = {block.name for block in self.blocks}
        return {name: value for name, value in values.items() if name in names}

    def _chosen(self, block: Block, values: Values) -> Values:
        """Values that the kernel of a block asks for."""
        names = self.problem.assembler.block(block.name).kernel.parameters
        missing = [name for name in names if name not in values]
        if missing:
            raise KeyError(
                f"block {block.name!r} asks for {', '.join(missing)}; "
                f"cases/seal/equations/system.py gives {block.group} blocks {', '.join(values)}"
            )
        return {name: values[name] for name in names}

    @property
    def _film_blocks(self) -> list[Block]:
        return [block for block in self.blocks if block.group == "film"]

    def _block(self, name: str) -> Block:
        (found,) = [block for block in self.blocks if block.name == name]
        return found


def _contact_constants(
    p: Seal, section: SealSection, blocks: tuple[Block, ...]
) -> dict[str, Array]:
    """Constants (n, k) of the contact elements, by block; slip is counted from the start."""
    obstacles, found = obstacles_of(p), {}
    for block in (b for b in blocks if b.group == "contact"):
        chain = section.chains[block.elements]
        stiffness = section.node_moduli(p)[chain[0]]
        values = contact_data(obstacles[block.name], section.mesh.points, *chain, stiffness)
        known = dict(zip(("n_z", "n_r", "c", "area", "rho"), values.T, strict=True))
        names, none = load_kernel(block.kernel_of(p)).data, np.zeros(len(values))
        found[block.name] = np.stack([known.get(name, none) for name in names], axis=1)
    return found


def build_system(
    p: Seal, layout: Layout | None = None, density: Fraction | None = None
) -> SealSystem:
    """The system of a case on its section; see `seal_section`."""
    return SealSystem.of(p, seal_section(p, layout, density))
