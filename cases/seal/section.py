"""The discrete O-ring: mesh of the section, numbering of the unknowns, element blocks, problem.

Surfaces counterclockwise: the lubricated arc (bottom, sealed to air side), then the air side, the
crown and the sealed side. Sealed pressure acts from the sealed end of the arc round to the crown.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from math import pi

import numpy as np

from softehl.cases.seal.parameters import ORing
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.fem.assembly import Assembler, ElementBlock
from softehl.runtime.fem.contact import (
    Obstacle,
    contact_block,
    inner_cylinder,
    outer_cylinder,
    plane,
    tributary_areas,
)
from softehl.runtime.fem.dofs import (
    DofLayout,
    chain_dofs,
    displacement_dofs,
    gather_rows,
    separate_dofs,
)
from softehl.runtime.fem.problem import KeepsOrientation, Problem, StaysPositive
from softehl.runtime.fem.rules import facet_rule, film_rule
from softehl.runtime.kernels import load_kernel
from softehl.runtime.mesh.sections import Disc, SectionMesh, disc_mesh

HOUSING = ("housing", "sealed_wall", "air_wall")

# Reference sizes of residuals: 1 MPa on 1 mm of rod, a gap of 10 micrometres, 1 milliradian.
_REFERENCE_PRESSURE, _REFERENCE_GAP, _REFERENCE_ROTATION = 1.0, 0.01, 1e-3
_REFERENCE_DIFFERENCE = 1e-4  # MPa between the ends of a segment


@dataclass(frozen=True, eq=False)
class OringSection:
    """Everything that does not change while loads do.

    obstacles: rod, housing cylinder, sealed wall and air wall, by block name. problem: the contact
    problem at p_s = 0 with the film switched off and its pressures prescribed to be zero; mean
    rotation is held in it, even if a later stage lets it go.
    rod_areas: (arc nodes,) tributary areas of the rod multipliers, mm^2.
    """

    parameters: ORing
    disc: Disc
    mesh: SectionMesh
    layout: DofLayout
    obstacles: dict[str, Obstacle]
    problem: Problem
    rod_areas: Array

    @property
    def rod_radius(self) -> float:
        """Radius of the rod, mm."""
        return 0.5 * self.parameters.rod_diameter

    @property
    def film_ends(self) -> Integers:
        """Pressure unknowns at the sealed and the air end of the arc, (15), for "fe" and "dg"."""
        pressures = self.layout.dofs("pressure")
        return pressures[[0, -1]]

    @property
    def lowest(self) -> int:
        """Index of the arc node nearest to the rod in the reference configuration."""
        return _lowest(self.mesh)

    def at_rest(self) -> Array:
        """Unknowns of the undeformed section: all zero."""
        return np.zeros(self.layout.total)

    def deformed(self, x: Array) -> Array:
        """Deformed nodes (V, 2) in (z, r), mm."""
        return self.mesh.points + x[self.layout.part("displacement")].reshape(-1, 2)

    def arc_film(self, x: Array) -> tuple[Array, Array]:
        """Positions z and distances h from the rod of the deformed arc nodes, (arc nodes,), mm."""
        z, r = self.deformed(x)[self.mesh.arc_nodes].T
        return z, r - self.rod_radius


def uniform_disc(p: ORing) -> Disc:
    """The circular section with equal segments on its arc."""
    radius = 0.5 * p.section_diameter
    return Disc(0.0, 0.5 * p.inner_diameter + radius, radius, p.arc_start, p.arc_end)


def build_section(
    p: ORing, disc: Disc | None = None, density: Fraction | None = None
) -> OringSection:
    """Mesh, unknowns, blocks and the problem of a case.

    disc: how the mesh is laid out, with equal segments if left out. density: instead of the case's.
    """
    disc = disc or uniform_disc(p)
    mesh = disc_mesh(disc, density or p.density)
    layout = number_unknowns(mesh, p)
    obstacles = {o.name: o for o in _obstacles(p)}
    assembler = Assembler.build(layout.total, _blocks(p, mesh, layout, obstacles))
    problem = Problem(
        assembler=assembler,
        layout=layout,
        parameters={},
        scales=_scales(p),
        guards=(_orientation(mesh),),
    )
    areas = tributary_areas(mesh.points, mesh.arc_segments, mesh.arc_nodes)
    problem = _with_solid(p, problem, disc.centre_r, disc.radius)
    section = OringSection(p, disc, mesh, layout, obstacles, problem, areas)
    return replace(section, problem=problem.with_fixed([layout.dofs("pressure")], [0.0]))


def number_unknowns(mesh: SectionMesh, p: ORing) -> DofLayout:
    """Displacements, pressures, rod and housing multipliers, moment: one vector for all stages.

    Pressures: m_p a segment and one more where they are continuous, m_p + 1 a segment in (22).
    """
    outer, m_p = len(mesh.outer_nodes), p.pressure_order
    continuous = p.reynolds == "fe"
    return DofLayout.of(
        displacement=2 * len(mesh.points),
        pressure=m_p * mesh.arc + 1 if continuous else (m_p + 1) * mesh.arc,
        rod=mesh.arc + 1,
        housing=outer,
        sealed_wall=outer,
        air_wall=outer,
        rotation=1,
    )


def film_guard(section: OringSection, fraction: float = 0.9) -> StaysPositive:
    """Film thickness at the nodes of the arc, positive in every iterate."""
    nodes = section.mesh.arc_nodes
    return StaysPositive(
        2 * nodes + 1, section.mesh.points[nodes, 1] - section.rod_radius, fraction
    )


def film_scale(speed: float) -> float:
    """Reference flux (mm^2/s) of a film at |U| (mm/s): mean velocity times 10 micrometres."""
    return 0.5 * speed * _REFERENCE_GAP


def flux_scales(section: OringSection, speed: float, gap: Array, field: str = "pressure") -> Array:
    """Reference fluxes (n,), mm^2/s, of the equations of a pressure field at |U| (mm/s).

    In a film of micrometres that of `film_scale`. Where the film is thick, h^3 / (12 eta dx) turns
    the rounding of a pressure into a flux, so there it is what a small difference of pressure would
    drive. gap: (arc nodes,) film thickness, mm, near enough.
    """
    p, arc = section.parameters, section.mesh.points[section.mesh.arc_nodes]
    block = section.problem.assembler.block("film" if field == "pressure" else f"{field}_film")
    dofs = block.dofs[:, 4:] - section.layout.part(field).start
    h, dx = np.maximum(gap[1:], gap[:-1]), np.linalg.norm(np.diff(arc, axis=0), axis=1)
    order = dofs.shape[1] - 1
    conductance = order**2 * np.maximum(h, 0.0) ** 3 / (12.0 * p.viscosity * dx)
    largest = np.zeros(section.layout.count(field))
    np.maximum.at(largest, dofs, conductance[:, None])
    return film_scale(speed) + _REFERENCE_DIFFERENCE * largest


def _obstacles(p: ORing) -> tuple[Obstacle, ...]:
    half = 0.5 * p.groove_width
    return (
        inner_cylinder("rod", 0.5 * p.rod_diameter),
        outer_cylinder("housing", 0.5 * p.housing_diameter),
        plane("sealed_wall", p.groove_centre - half, faces=1),
        plane("air_wall", p.groove_centre + half, faces=-1),
    )


def _blocks(
    p: ORing, mesh: SectionMesh, layout: DofLayout, obstacles: dict[str, Obstacle]
) -> list[ElementBlock]:
    points = mesh.points
    quads = points[mesh.quads].reshape(-1, 8)
    quad_dofs = displacement_dofs(mesh.quads)
    moment = np.full(len(mesh.quads), layout.dofs("rotation")[0])
    arc = mesh.arc_segments
    number = chain_dofs if p.reynolds == "fe" else separate_dofs
    pressures = number(mesh.arc, p.pressure_order, layout.part("pressure").start)
    rule = film_rule(p.pressure_order, p.quadrature, p.quadrature_points)
    follower, contact = load_kernel("follower_pressure"), load_kernel("contact")
    outer = sealed_side(mesh)
    bottom = arc[: _lowest(mesh)]
    candidates = {"rod": (mesh.arc_nodes, arc, layout.dofs("rod"))}
    for name in HOUSING:
        candidates[name] = (mesh.outer_nodes, mesh.outer_segments, layout.dofs(name))
    film = ElementBlock(
        "film",
        load_kernel("film"),
        _flat(points, arc),
        gather_rows(displacement_dofs(arc), pressures),
        rule=rule,
    )
    return [
        ElementBlock("solid", load_kernel(f"solid_{p.solid}"), quads, quad_dofs),
        ElementBlock("sealed_side", follower, _flat(points, outer), displacement_dofs(outer)),
        ElementBlock("sealed_arc", follower, _flat(points, bottom), displacement_dofs(bottom)),
        *(
            contact_block(obstacles[n], contact, points, c, p.shear_modulus)
            for n, c in candidates.items()
        ),
        film,
        *([replace(film, name="upwind", kernel=load_kernel("film_upwind"))] if p.upwinding else []),
        *([_facets(p, mesh, pressures)] if p.reynolds == "dg" else []),
        ElementBlock(
            "rotation",
            load_kernel("mean_rotation"),
            quads,
            gather_rows(quad_dofs, moment),
            constant=True,
        ),
        ElementBlock("spring", load_kernel("axial_spring"), quads, quad_dofs, constant=True),
    ]


def _facets(p: ORing, mesh: SectionMesh, pressures: Integers) -> ElementBlock:
    """Interior facets (22): the nodes between two segments of the arc, with both neighbours."""
    nodes = mesh.arc_nodes
    triples = np.stack([nodes[:-2], nodes[1:-1], nodes[2:]], axis=1)
    return ElementBlock(
        "facet",
        load_kernel("film_facet"),
        _flat(mesh.points, triples),
        gather_rows(displacement_dofs(triples), pressures[:-1], pressures[1:]),
        rule=facet_rule(p.pressure_order),
    )


def _flat(points: Array, segments: Integers) -> Array:
    return np.ascontiguousarray(points[segments].reshape(len(segments), -1))


def sealed_side(mesh: SectionMesh) -> Integers:
    """Segments from the crown to the sealed end of the arc."""
    outer = mesh.outer_segments
    middle = mesh.points[outer].mean(axis=1)
    first = int(np.flatnonzero(middle[:, 0] < 0.0)[0])
    return outer[first:]


def _lowest(mesh: SectionMesh) -> int:
    """Index of the arc node nearest to the rod in the reference configuration."""
    return int(np.argmin(mesh.points[mesh.arc_nodes, 1]))


def _orientation(mesh: SectionMesh) -> KeepsOrientation:
    return KeepsOrientation(mesh.points[mesh.quads].reshape(-1, 8), displacement_dofs(mesh.quads))


def _scales(p: ORing) -> dict[str, float]:
    area = pi * p.rod_diameter * 1.0
    gap = area * _REFERENCE_GAP
    return {
        "displacement": area * _REFERENCE_PRESSURE,
        "pressure": film_scale(max(p.speeds)),
        "rod": gap,
        **dict.fromkeys(HOUSING, gap),
        "rotation": _REFERENCE_ROTATION,
    }


def _with_solid(p: ORing, problem: Problem, centre_r: float, radius: float) -> Problem:
    contact = {"offset": 0.0, "force_weight": 1.0}
    polar = 0.5 * pi * radius**4
    return problem.with_parameters(
        solid={"mu_1": p.mu_1, "mu_2": p.mu_2, "kappa": p.bulk_modulus},
        sealed_side={"pressure": 0.0},
        sealed_arc={"pressure": 0.0},
        rod=contact,
        rotation={"centre_z": 0.0, "centre_r": centre_r, "polar_moment": polar, "angle": 0.0},
        **dict.fromkeys(HOUSING, contact),
    )
