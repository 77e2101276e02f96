"""System of a seal: the defined equations on a section, its unknowns, and its problems."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import pi
from typing import Any

import numpy as np

from softehl.cases.seal.correctors.perturbed_lagrangian import element_pressures
from softehl.cases.seal.equations import scales
from softehl.cases.seal.equations.definition import (
    AIR_WALL,
    AXIAL,
    BORE,
    DISPLACEMENT,
    FIELDS,
    FILM,
    MOVED,
    PRESSURE,
    ROD,
    ROTATION,
    SHEAR,
    VOID,
    WALLS,
    Field,
    Group,
    Place,
    SealBlock,
    Values,
    blocks_of,
    contact_values,
    film_values,
    obstacles_of,
    values_at_rest,
)
from softehl.cases.seal.equations.loads import ContactLoads, FilmLoads
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records import Discretisation
from softehl.cases.seal.meshing.section_mesh import SectionMesh
from softehl.cases.seal.section.layout import Layout
from softehl.cases.seal.section.section import SealSection, seal_section
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.contact.rigid_obstacles import Obstacle, contact_data, tributary_areas
from softehl.runtime.discretisation.dofmap import DofLayout, Numbering, chain_dofs, separate_dofs
from softehl.runtime.discretisation.element_blocks import ElementKernel
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.discretisation.step_bounds import (
    ChangesLittle,
    Guard,
    KeepsOrientation,
    StaysPositive,
)
from softehl.runtime.kernels.kernel import load_kernel
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.study import Study


@dataclass(frozen=True, eq=False)
class SealUnknowns:
    """A section and its unknowns: what stands where in a vector of them, and what it means."""

    parameters: Seal
    section: SealSection
    numbering: Numbering

    @property
    def mesh(self) -> SectionMesh:
        """The undeformed mesh."""
        return self.section.mesh

    @property
    def rod_radius(self) -> float:
        """Place r of the surface that slides, mm: radius of a rod, less that of a bore."""
        return 0.5 * self.parameters.rod_diameter

    @property
    def side(self) -> float:
        """1 for a rod seal, -1 for a piston seal, whose forces have the other sign."""
        return -1.0 if self.parameters.piston else 1.0

    @property
    def around(self) -> float:
        """Circumference of the surface that slides, mm."""
        return pi * abs(self.parameters.rod_diameter)

    @property
    def rod_areas(self) -> Array:
        """Tributary areas (arc nodes,) of the rod multipliers, mm^2."""
        return self.areas("arc_nodes")

    def areas(self, on: Place) -> Array:
        """Tributary areas (n,) of the nodes that may meet the rod, the housing or a wall, mm^2."""
        nodes, segments = self.section.chains[on]
        return tributary_areas(self.mesh.points, segments, nodes)

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
        return self.numbering.rows(FILM, field)

    def pressures(self, x: Array) -> Array:
        """All pressure unknowns, MPa."""
        return x[self.layout.part(PRESSURE)]

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
            total[self.section.chains[on][0]] += self.pressing(name, x) * self.areas(on)
        return total

    def pressing(self, name: str, x: Array) -> Array:
        """Nominal pressures (n,) of an obstacle on the nodes that may touch it, MPa, >= 0."""
        return np.maximum(-x[self.layout.part(name)], 0.0)

    def housing_friction(self, x: Array) -> float:
        """Axial force of friction of the housing on the section, to the air side, N."""
        if not self.parameters.rubs:
            return 0.0
        return float(x[self.layout.part(SHEAR[BORE])] @ self.areas(WALLS[BORE]))

    def axial_force(self, x: Array) -> float:
        """Force that the hold exerts on the section, to the air side, N."""
        return 0.0 - self.side * float(x[self.layout.part(AXIAL)][0])

    @property
    def film_ends(self) -> Integers:
        """Pressure unknowns at the sealed and the air end of the film, (15), for "fe" and "dg"."""
        return self._end_dofs(PRESSURE)

    def contact_fields(self) -> tuple[Field, ...]:
        """The fields that contact knows: film pressures are all zero in it."""
        return tuple(field for field in self._fields if field.on != "film")

    def film_fields(self) -> tuple[Field, ...]:
        """The fields that the film alone has."""
        return tuple(field for field in self._fields if field.on == "film")

    @property
    def _fields(self) -> tuple[Field, ...]:
        return tuple(field for field in FIELDS if field.name in self.layout.names)

    def _end_dofs(self, field: str) -> Integers:
        return self.layout.dofs(field)[[0, -1]]


NUMBERED = {field.name: field.unknowns for field in FIELDS}
"""Fields with the names of their unknowns, in the order of the vector."""

_ON = {field.name: field.on for field in FIELDS}

_STEP = 0.9
"""Share of its thickness that a film may lose in an iteration. Nine seals take 1.5 % more of them
with 0.7, 2 % fewer with 0.97; a rough film, which may change by sigma in any case, none."""


def seal_study(p: Seal, section: SealSection, blocks: Sequence[SealBlock]) -> Study:
    """The study of a section: nothing moves, nothing presses, no unknown is prescribed.

    Raises KeyError for a kernel that asks for a value that nobody gives.
    """
    positions = _film_places(p, section)
    at_rest = film_values(p, FilmLoads(0.0, "out", 0.0, np.empty(0)))
    elements = {
        **section.elements,
        "film_nodes": np.empty((len(positions["film_nodes"]), 0), np.int64),
    }
    study = Study(Mesh(section.mesh.points, {"quad4": section.mesh.quads}), "axisymmetric")
    for block in blocks:
        kernel = load_kernel(block.kernel_of(p))
        field_names = [name for name, node in kernel.places if node is None]
        values = kernel_values(block, kernel, values_at_rest(block, p, section) or at_rest)
        by_steps = {"rate"} if any("_rate" in name for name in kernel.data) else set()
        arguments: dict[str, Any] = {n: v for n, v in values.items() if n not in by_steps}
        study.add(
            block.name,
            kernel,
            on=elements[block.elements],
            shared=[
                u for u, f in zip(field_names, block.fields, strict=False) if _ON[f] == "section"
            ],
            called=dict(zip(field_names, block.fields, strict=False)),
            along={f: positions[block.elements] for f in block.fields if _ON[f] == "film"},
            rule=block.rule(p) if block.rule else None,
            constant=block.constant,
            **arguments | _contact_constants(p, section, block, kernel.data),
        )
    return study


def _film_places(p: Discretisation, section: SealSection) -> Mapping[str, Integers]:
    """Places (n, k) of film pressures on the sets of elements that know them.

    m_p a segment and one more where pressures are continuous, m_p + 1 a segment in (22).
    """
    number = chain_dofs if p.reynolds == "fe" else separate_dofs
    arc = number(section.mesh.arc, p.pressure_order, 0)
    facets = np.concatenate([arc[:-1], arc[1:]], axis=1)
    return {"arc": arc, "facets": facets, "film_nodes": np.arange(arc.max() + 1)[:, None]}


def _contact_constants(
    p: Seal, section: SealSection, block: SealBlock, names: Sequence[str]
) -> dict[str, Array]:
    """Constants (n,) of contact elements by these names; none of other blocks."""
    if block.group != "contact":
        return {}
    nodes, segments = section.chains[block.elements]
    values = contact_data(
        obstacles_of(p)[block.name],
        section.mesh.points,
        nodes=nodes,
        segments=segments,
        stiffness=section.node_moduli(p)[nodes],
    )
    constants = dict(zip(("n_z", "n_r", "c", "area", "rho"), values.T, strict=True))
    return {name: value for name, value in constants.items() if name in names}


def kernel_values(block: SealBlock, kernel: ElementKernel, values: Values) -> Values:
    """Values that the kernel of a block asks for.  Raises KeyError for one that is not there."""
    missing = [name for name in kernel.parameters if name not in values]
    if missing:
        raise KeyError(
            f"block {block.name!r} asks for {', '.join(missing)}; "
            f"cases/seal/equations/definition.py gives {block.group} blocks {', '.join(values)}"
        )
    return {name: values[name] for name in kernel.parameters}


@dataclass(frozen=True, eq=False)
class SealSystem(SealUnknowns):
    """A section with its unknowns and equations: everything that does not change while loads do.

    blocks: those that the case has. obstacles: by block name. problem: the contact problem at
    p_s = 0 with the film switched off and its pressures prescribed to be zero; mean rotation is
    held in it, even if a later stage lets it go.
    """

    blocks: tuple[SealBlock, ...]
    obstacles: Mapping[str, Obstacle]
    problem: Problem

    @classmethod
    def of(cls, p: Seal, section: SealSection) -> SealSystem:
        """The system of a case on a section."""
        present = blocks_of(p)
        built = seal_study(p, section, present).system(NUMBERED)
        numbering = built.numbering
        corners, dofs = section.coordinates("cells"), numbering.at(MOVED, section.mesh.quads)
        at_rest = replace(
            built.resting(),
            scales={f.name: f.scale(p) for f in FIELDS if f.name in numbering.layout.names},
            absolute=True,
            guards=(KeepsOrientation(corners, dofs),),
        )
        switched_off = {block.name: None for block in present if block.of_film}
        system = cls(
            p, section, numbering, present, obstacles_of(p), at_rest.with_parameters(**switched_off)
        )
        films = [system.layout.dofs(field.name) for field in system.film_fields()]
        return replace(system, problem=system.problem.with_fixed(films, [0.0] * len(films)))

    def moved(self, p: Seal, section: SealSection) -> SealSystem:
        """The system of other numbers on the same mesh with its nodes moved."""
        system = SealSystem.of(p, section)
        structure = self.problem.assembler.structure  # what is known of its pattern stays
        assembler = replace(system.problem.assembler, structure=structure)
        return replace(system, problem=replace(system.problem, assembler=assembler))

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

    def element_pressures(self, x: Array) -> Array:
        """Mean stress (elements,) of the section x (n,), MPa, positive in tension."""
        return element_pressures(self.problem, self.solids, x)

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
        if loads.position is not None:
            return problem
        return problem.also_fixed(self.layout.dofs(AXIAL), -self.side * loads.axial_force)

    def film_problem(self, film: FilmLoads) -> Problem:
        """Film forces (18) and the Reynolds equation (25); the contact with the rod is without."""
        contact = self.contact_problem(ContactLoads(film.sealed_pressure, position=film.position))
        problem = contact.with_parameters(
            **{ROD: None, "sealed_arc": {"pressure": 0.0}},  # the film bears the arc
            **self._group_values("film", film_values(self.parameters, film)),
        )
        fixed = [self.film_ends, self.layout.dofs(ROD)]
        values: list[Array | float] = [film.end_pressures, 0.0]
        if self.parameters.conserving:
            fixed.append(self._end_dofs(VOID))
            values.append(np.array(film.inflow))
        if film.position is None:
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
        return self._group_values("squeeze", values)

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

    def _group_values(self, group: Group, values: Values) -> dict[str, Values]:
        """Values that the blocks of a group ask for, by block."""
        return {
            block.name: kernel_values(
                block, self.problem.assembler.block(block.name).kernel, values
            )
            for block in self.blocks
            if block.group == group
        }


def build_system(
    p: Seal, layout: Layout | None = None, density: Fraction | None = None
) -> SealSystem:
    """The system of a case on its section; see `seal_section`."""
    return SealSystem.of(p, seal_section(p, layout, density))
