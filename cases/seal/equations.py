"""The equations of a seal: the declared system on a section, its unknowns, and its problems."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from softehl.cases.seal import scales
from softehl.cases.seal.declared import Block, Field, Numbering
from softehl.cases.seal.layout import Layout
from softehl.cases.seal.loads import ContactLoads, FilmLoads
from softehl.cases.seal.parameters import ORing
from softehl.cases.seal.section import SealSection, seal_section
from softehl.cases.seal.system import (
    AIR_WALL,
    AXIAL,
    BORE,
    DISPLACEMENT,
    FIELDS,
    FILM,
    PRESSURE,
    ROD,
    ROTATION,
    SEALED_WALL,
    SHEAR,
    VOID,
    WALLS,
    Values,
    blocks_of,
    contact_values,
    faded_values,
    film_values,
    obstacles_of,
    values_at_rest,
)
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.fem.assembly import Assembler, Memo
from softehl.runtime.fem.contact import Obstacle, contact_data, tributary_areas
from softehl.runtime.fem.dofs import DofLayout
from softehl.runtime.fem.guards import ChangesLittle, Guard, KeepsOrientation, StaysPositive
from softehl.runtime.fem.layered import Layer
from softehl.runtime.fem.problem import Problem
from softehl.runtime.kernels import load_kernel
from softehl.runtime.mesh.sections import SectionMesh

_STEP = 0.9  # of its thickness a film may lose in an iteration
_AT_WALL = 0.02  # of the section: as near to a wall it may come to touch it
_ROUGH_STEP = 0.7  # of its thickness that of a rough film may change, at least by sigma


@dataclass(frozen=True, eq=False)
class SealSystem:
    """A section with its unknowns and equations: everything that does not change while loads do.

    blocks: those that the case has. obstacles: by block name. problem: the contact problem at
    p_s = 0 with the film switched off and its pressures prescribed to be zero; mean rotation is
    held in it, even if a later stage lets it go. groove: share of the sealed pressure that contact
    has in the groove between two lobes.
    """

    parameters: ORing
    section: SealSection
    numbering: Numbering
    blocks: tuple[Block, ...]
    obstacles: Mapping[str, Obstacle]
    problem: Problem
    groove: float = 1.0

    @classmethod
    def of(
        cls,
        p: ORing,
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

    def moved(self, p: ORing, section: SealSection) -> SealSystem:
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
    def dam(self) -> int:
        """Index of the arc node at which the sealed pressure of the contact ends."""
        section = self.section
        return section.lowest if self.groove else section.layout.before_groove(section.mesh)

    # --- the section ----------------------------------------------------------------------------

    @property
    def mesh(self) -> SectionMesh:
        """The undeformed mesh."""
        return self.section.mesh

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

    @property
    def rod_radius(self) -> float:
        """Radius of the rod, mm."""
        return 0.5 * self.parameters.rod_diameter

    @property
    def rod_areas(self) -> Array:
        """Tributary areas (arc nodes,) of the rod multipliers, mm^2."""
        return tributary_areas(self.mesh.points, self.mesh.arc_segments, self.mesh.arc_nodes)

    # --- what a vector of unknowns holds ----------------------------------------------------------

    @property
    def layout(self) -> DofLayout:
        """The vector of unknowns, one for all stages."""
        return self.numbering.layout

    def at_rest(self) -> Array:
        """Unknowns of the undeformed section: all zero."""
        return np.zeros(self.layout.total)

    def displacements(self, x: Array) -> Array:
        """Displacements (V, 2) in (z, r), mm."""
        return x[self.layout.part(DISPLACEMENT)].reshape(-1, 2)

    def deformed(self, x: Array) -> Array:
        """Deformed nodes (V, 2) in (z, r), mm."""
        return np.asarray(self.mesh.points + self.displacements(x))

    def arc_film(self, x: Array) -> tuple[Array, Array]:
        """Positions z and distances h from the rod of the deformed arc nodes, (arc nodes,), mm."""
        z, r = self.deformed(x)[self.mesh.arc_nodes].T
        return z, r - self.rod_radius

    def rod_multipliers(self, x: Array) -> Array:
        """Contact multipliers (arc nodes,) of the rod, MPa; negative where it presses."""
        return x[self.layout.part(ROD)]

    def moment(self, x: Array) -> float:
        """Moment that holds the mean rotation of the section, N mm."""
        return float(x[self.layout.part(ROTATION)][0])

    def pressure_dofs(self, field: str = PRESSURE) -> Integers:
        """Numbers (segments, m_p + 1) of the pressure unknowns of each segment of the film."""
        return self.numbering.rows(field, "arc")

    def pressures(self, x: Array, field: str = PRESSURE) -> Array:
        """All pressure unknowns, MPa."""
        return x[self.layout.part(field)]

    @property
    def pressure_count(self) -> int:
        """Number of pressure unknowns."""
        return self.layout.count(PRESSURE)

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of unknowns, as a run records them."""
        return {"total": self.layout.total, PRESSURE: self.pressure_count}

    def wall_forces(self, x: Array) -> Array:
        """Normal forces (nodes,) of the housing and its walls on the nodes, N."""
        total = np.zeros(len(self.mesh.points))
        for name, on in WALLS.items():
            nodes, segments = self.section.chains[on]
            areas = tributary_areas(self.mesh.points, segments, nodes)
            total[nodes] += self.pressing(name, x) * areas
        return total

    def pressing(self, name: str, x: Array) -> Array:
        """Nominal pressures (n,) of an obstacle on the nodes that may touch it, MPa, >= 0."""
        return np.maximum(-x[self.layout.part(name)], 0.0)

    def reaction(self, name: str, x: Array) -> float:
        """Axial force of a wall on the section, the sum of normal forces on the bore, N."""
        if name == AIR_WALL and self.parameters.opens:
            block = self.problem.assembler.block(name)
            return float(block.residual(x, self.problem.parameters[name])[:, 0].sum())
        nodes, segments = self.section.chains[WALLS[name]]
        areas = tributary_areas(self.mesh.points, segments, nodes)
        return float(self.pressing(name, x) @ areas)

    def housing_friction(self, x: Array) -> float:
        """Axial force of friction of the housing on the section, to the air side, N."""
        if not self.parameters.rubs:
            return 0.0
        nodes, segments = self.section.chains[WALLS[BORE]]
        areas = tributary_areas(self.mesh.points, segments, nodes)
        return float(x[self.layout.part(SHEAR[BORE])] @ areas)

    def axial_force(self, x: Array) -> float:
        """Force that the hold exerts on the section, to the air side, N."""
        return 0.0 - float(x[self.layout.part(AXIAL)][0])

    @property
    def film_ends(self) -> Integers:
        """Pressure unknowns at the sealed and the air end of the film, (15), for "fe" and "dg"."""
        return self._ends(PRESSURE)

    def columns(self, block: str, field: str) -> slice:
        """Where the unknowns of a field stand in the dof map of a block."""
        return self.numbering.columns(self._block(block), field)

    def contact_fields(self) -> tuple[Field, ...]:
        """The fields that contact knows: film pressures are all zero in it."""
        return tuple(field for field in self._fields if field.on != "film")

    def film_fields(self) -> tuple[Field, ...]:
        """The fields that the film alone has."""
        return tuple(field for field in self._fields if field.on == "film")

    # --- loads ------------------------------------------------------------------------------------

    def contact_problem(self, loads: ContactLoads) -> Problem:
        """Frictionless contact (9)-(10) under a sealed pressure (8)."""
        values = self._present(contact_values(loads, self.groove))
        problem = self.problem.with_parameters(**values)
        if loads.moment is not None:
            problem = problem.also_fixed(self.layout.dofs(ROTATION), loads.moment)
        if loads.place is not None:
            return problem
        return problem.also_fixed(self.layout.dofs(AXIAL), -loads.axial_force)

    def film_problem(self, film: FilmLoads, shares: Mapping[str, float] | None = None) -> Problem:
        """Film forces (18) weighted by w, contact forces by 1 - w; Reynolds equation (25) in full.

        The rod multipliers are frozen, so their contact elements are springs of stiffness rho about
        the contact pressure: forces that fade without a constraint that would outlive them.
        shares: of the film forces by pressure field, where there are several.
        """
        p_s, fields = film.sealed_pressure, shares or {PRESSURE: 1.0}
        contact = self.contact_problem(ContactLoads(p_s, {ROD: film.rod_offset}, film.place))
        problem = contact.with_parameters(
            **self._present(faded_values(film, self.groove)),
            **self._film_parameters(film, fields),
        )
        fixed = [*map(self._ends, fields), self.layout.dofs(ROD)]
        values: list[Array | float] = [film.ends for _ in fields]
        values.append(film.multipliers)
        if self.parameters.conserving:
            fixed.append(self._ends(VOID))
            values.append(np.array(film.inflow))
        if film.place is None:
            fixed.append(self.layout.dofs(AXIAL))
            values.append(0.0)
        if film.moment is not None:
            fixed.append(self.layout.dofs(ROTATION))
            values.append(film.moment)
        fluxes = {
            name: self.flux_scales(max(film.speed, film.least_speed), film.gap, name)
            for name in fields
        }
        return replace(
            problem.with_fixed(fixed, values),
            scales={**problem.scales, **fluxes},
            guards=(*problem.guards, self.film_guard()),
        )

    def sheared(self, problem: Problem, film: FilmLoads) -> Problem:
        """A contact problem with the shear stress of a film of the gap that there is, without its
        pressure.
        """
        values = film_values(self.parameters, film, 1.0)
        return problem.with_parameters(**{FILM: self._chosen(self._block(FILM), values)})

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

    def flux_scales(self, speed: float, gap: Array, field: str = PRESSURE) -> Array:
        """Reference fluxes (n,), mm^2/s, of the equations of a pressure field at |U| (mm/s).

        gap: (arc nodes,) film thickness, mm, near enough.
        """
        unknowns, arc = self.numbering.unknowns[field], self.mesh.points[self.mesh.arc_nodes]
        h, dx = np.maximum(gap[1:], gap[:-1]), np.linalg.norm(np.diff(arc, axis=0), axis=1)
        driven = scales.pressure_flux(h, dx, unknowns.order, self.parameters.viscosity)
        largest = np.zeros(unknowns.count)
        np.maximum.at(largest, unknowns.rows["arc"], driven[:, None])
        return scales.film_flux(speed) + largest

    # --- other systems on the same section --------------------------------------------------------

    def film_layer(self, x: Array) -> Layer:
        """The film as the layer of the modified Newton iteration, near the state x.

        Displacements of the arc and the moment are shared with the section; the pressures but
        those at the ends are the film's own, whatever else its blocks know is prescribed. Where
        the arc is at a wall, its multipliers are shared too: without the displacements of these
        nodes nothing would determine them.
        """
        start, nodes = self.layout.part(DISPLACEMENT).start, self.mesh.arc_nodes
        moment = self.layout.dofs(ROTATION)
        shared = np.concatenate(
            [start + 2 * nodes, start + 2 * nodes + 1, moment, self._walls_of_arc(x)]
        )
        own = [self.layout.dofs(field.name) for field in self.film_fields()]
        inner = np.concatenate(own)
        if self.parameters.conserving:  # side by side along the film: their matrix is a band
            inner = np.stack([pressures[1:-1] for pressures in own], axis=1).ravel()
        inner = inner[~np.isin(inner, self.film_ends)]
        names = [block.name for block in self.blocks if block.layer]
        return Layer.of(self.problem.assembler, names, shared, inner)

    def contact_layer(self, x: Array) -> Layer:
        """The contact with the rod as the layer, near the state x: see `film_layer`."""
        start, nodes = self.layout.part(DISPLACEMENT).start, self.mesh.arc_nodes
        others = self.layout.dofs(ROTATION), self.layout.dofs(ROD), self._walls_of_arc(x)
        shared = np.concatenate([start + 2 * nodes, start + 2 * nodes + 1, *others])
        loads = [block.name for block in self.blocks if block.group == "load" and block.layer]
        return Layer.of(self.problem.assembler, [ROD, *loads], shared, np.empty(0, np.int64))

    def with_pressure(self, name: str, order: int) -> SealSystem:
        """The system with another pressure of this order on the same film thickness, last of all
        fields; its blocks are called after it.
        """
        film = [
            replace(
                block,
                name=f"{name}_{block.name}",
                fields=tuple(name if field == PRESSURE else field for field in block.fields),
            )
            for block in self._film_blocks
        ]
        (pressure,) = [field for field in self._fields if field.name == PRESSURE]
        fields = (*self._fields, replace(pressure, name=name, order=order))
        return SealSystem.of(self.parameters, self.section, fields, (*self.blocks, *film))

    def _walls_of_arc(self, x: Array) -> Integers:
        """Multipliers (n,) of the walls at those nodes of the arc that touch them or are near."""
        found = []
        for name in (SEALED_WALL, AIR_WALL):
            nodes = self.section.chains[WALLS[name]][0]
            gap = self.obstacles[name].gap(self.deformed(x)[nodes])
            near = np.isin(nodes, self.mesh.arc_nodes)
            near &= gap < _AT_WALL * self.parameters.section_diameter
            found.append(self.layout.dofs(name)[near])
        return np.concatenate(found)

    # --- inside -----------------------------------------------------------------------------------

    def _at_rest(self) -> Problem:
        """See `problem`."""
        given = {b: values_at_rest(b, self.parameters, self.section) for b in self.blocks}
        chosen = {b.name: self._chosen(b, values) for b, values in given.items() if values}
        problem = self.problem.with_parameters(**chosen)
        pressures = [field.name for field in self.film_fields()]
        return problem.with_fixed([self.layout.dofs(n) for n in pressures], [0.0] * len(pressures))

    def _film_parameters(self, film: FilmLoads, shares: Mapping[str, float]) -> dict[str, Values]:
        """Parameters of every term of the film, each with the share of its pressure field."""
        found = {}
        for block in self._film_blocks:
            (share,) = [shares[name] for name in block.fields if name in shares]
            found[block.name] = self._chosen(block, film_values(self.parameters, film, share))
        return found

    def _present(self, values: Mapping[str, Values | None]) -> dict[str, Values | None]:
        """Those of the values by block whose block there is."""
        names = {block.name for block in self.blocks}
        return {name: value for name, value in values.items() if name in names}

    def _chosen(self, block: Block, values: Values) -> Values:
        """Those of the values that the kernel of a block asks for."""
        names = self.problem.assembler.block(block.name).kernel.parameters
        missing = [name for name in names if name not in values]
        if missing:
            raise KeyError(
                f"block {block.name!r} asks for {', '.join(missing)}; cases/seal/system.py gives "
                f"{block.group} blocks {', '.join(values)}"
            )
        return {name: values[name] for name in names}

    @property
    def _fields(self) -> tuple[Field, ...]:
        return tuple(unknowns.field for unknowns in self.numbering.unknowns.values())

    @property
    def _film_blocks(self) -> list[Block]:
        return [block for block in self.blocks if block.group == "film"]

    def _block(self, name: str) -> Block:
        (found,) = [block for block in self.blocks if block.name == name]
        return found

    def _ends(self, field: str) -> Integers:
        return self.layout.dofs(field)[[0, -1]]


def _contact_constants(
    p: ORing, section: SealSection, blocks: tuple[Block, ...]
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
    p: ORing, layout: Layout | None = None, density: Fraction | None = None
) -> SealSystem:
    """The system of a case on its section; see `seal_section`."""
    return SealSystem.of(p, seal_section(p, layout, density))
