"""Definition of the coupled system: fields, element blocks, obstacles, parameters.

Another field, obstacle or term of the film is one line of `FIELDS` or `BLOCKS`; a kernel is given
those of the values below that it names. `cases.seal.equations.system` makes equations of it on a
section, and nobody else knows how fields are called and where their unknowns stand.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import copysign
from typing import Literal, TypeAlias

from softehl.cases.seal.equations import scales
from softehl.cases.seal.equations.loads import ContactLoads, FilmLoads
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records import Discretisation, Gland
from softehl.cases.seal.gland.surfaces import void_values
from softehl.cases.seal.section.section import BODY, SealSection
from softehl.runtime.contact.rigid_obstacles import Obstacle, inner_cylinder, outer_cylinder, plane
from softehl.runtime.discretisation.quadrature import (
    content_rule,
    facet_rule,
    film_rule,
    rupture_rule,
)
from softehl.runtime.kernels.kernel_call import Rule

Values: TypeAlias = Mapping[str, float]
"""Parameters of a kernel by their names."""

Place = Literal["nodes", "film", "arc_nodes", "outer_nodes", "wall_nodes", "section"]
Group = Literal["solid", "load", "contact", "film", "squeeze", "support"]


@dataclass(frozen=True)
class Field:
    """A field of unknowns; a case has those that its blocks know.

    on: things that have one of them. A node has two displacements, a segment of the film the
    coefficients of a polynomial; other fields are of the nodes of the arc, of the other boundary,
    of what may touch a wall, or of the section.
    scale: reference size of its residuals. of: names of its unknowns, left out: one, its own.
    """

    name: str
    on: Place
    scale: Callable[[Seal], float]
    of: tuple[str, ...] = ()

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Names of its unknowns."""
        return self.of or (self.name,)


@dataclass(frozen=True)
class SealBlock:
    """Elements of one kernel.

    kernel: its name, with words of the case (see `kernel_of`); the solid is that of its region, ""
    where it is the case's.
    elements: a set of `SealSection.elements`. fields: of its unknowns that are not displacements,
    in the order in which the kernel has them. group: which values its parameters are taken from.
    needed: whether a case has it. rule: its quadrature, None for the kernel's own.
    constant: the tangent depends on parameters alone.
    """

    name: str
    kernel: str
    elements: str
    fields: tuple[str, ...]
    group: Group
    needed: Callable[[Seal], bool] = lambda _: True
    rule: Callable[[Seal], Rule] | None = None
    constant: bool = False
    region: str = ""

    @property
    def on_arc(self) -> bool:
        """True for what the modified Newton iteration treats exactly, with the film."""
        return self.elements in ("arc", "arc_nodes", "facets", "film_nodes", "sealed_arc")

    @property
    def of_film(self) -> bool:
        """True for what contact knows nothing of."""
        return self.group in ("film", "squeeze")

    def kernel_of(self, p: Seal) -> str:
        """Name of the kernel in a case."""
        return self.kernel.format(
            solid=p.rubber(self.region).solid_kernel(p.solid),
            edge="_corner" if p.opens else "",
            oil=p.film_suffix,
            rough="_rough" if p.rough else "",
            conserving="rough" if p.rough else f"conserving{p.film_suffix}",
        )


DISPLACEMENT, PRESSURE, ROD = "displacement", "pressure", "rod"
"""Displacements; film pressures; contact multipliers of the rod."""

MOVED = "u_z", "u_r"
"""Components of a displacement."""

VOID = "void"
"""Void fractions of the film, where its pressures stand."""

ROTATION, AXIAL = "rotation", "axial"
"""Moment that holds the mean rotation of the section; force that holds its mean axial place."""

SOLID, FILM, FACET, SQUEEZE = "solid", "film", "facet", "squeeze"
"""Blocks whose fields are results: the section, segments of the film, what lies between them, and
what the film holds where it changes with time."""

BORE, SEALED_WALL, AIR_WALL = "housing", "sealed_wall", "air_wall"
WALLS: dict[str, Place] = {BORE: "outer_nodes", SEALED_WALL: "wall_nodes", AIR_WALL: "wall_nodes"}
"""The other obstacles, and what may touch them; each has a field of multipliers of its own."""

FRICTION = "contact_friction"
SHEAR = {name: f"{name}_shear" for name in WALLS}
"""Kernel of contact with friction, and the tangential stresses that it adds to each obstacle."""

FIELDS = (
    Field(DISPLACEMENT, "nodes", scales.force, MOVED),
    Field(PRESSURE, "film", scales.largest_flux),
    Field(VOID, "film", lambda _: scales.VOID),
    Field(ROD, "arc_nodes", scales.gap),
    *(Field(name, nodes, scales.gap) for name, nodes in WALLS.items()),
    *(Field(SHEAR[name], nodes, scales.gap) for name, nodes in WALLS.items()),
    Field(ROTATION, "section", lambda _: scales.ROTATION),
    Field(AXIAL, "section", lambda _: scales.GAP),
)


def _segment_rule(p: Discretisation) -> Rule:
    return film_rule(p.pressure_order, p.quadrature, p.quadrature_points)


BLOCKS = (
    SealBlock(SOLID, "{solid}", BODY, (), "solid"),
    SealBlock("sealed_side", "follower_pressure", "sealed_side", (), "load"),
    SealBlock("sealed_arc", "follower_pressure", "sealed_arc", (), "load"),
    SealBlock(ROD, "contact", "arc_nodes", (ROD,), "contact"),
    *(
        SealBlock(name, kernel, WALLS[name], (name,), "contact", needed=lambda p: not p.rubs)
        for name, kernel in zip(WALLS, ("contact", "contact", "contact{edge}"), strict=True)
    ),
    *(
        SealBlock(name, FRICTION, on, (name, SHEAR[name]), "contact", needed=lambda p: p.rubs)
        for name, on in WALLS.items()
    ),
    SealBlock(
        name=FILM,
        kernel="film{oil}",
        elements="arc",
        fields=(PRESSURE,),
        group="film",
        needed=lambda p: not p.conserving,
        rule=_segment_rule,
    ),
    SealBlock(
        name=FILM,
        kernel="film_{conserving}",
        elements="arc",
        fields=(PRESSURE, VOID),
        group="film",
        needed=lambda p: p.conserving,
        rule=lambda p: rupture_rule(p.pressure_order),
    ),
    SealBlock(
        name="cavitation",
        kernel="film_void",
        elements="film_nodes",
        fields=(PRESSURE, VOID),
        group="film",
        needed=lambda p: p.conserving,
    ),
    SealBlock(
        name=SQUEEZE,
        kernel="film_squeeze{rough}",
        elements="arc",
        fields=(PRESSURE, VOID),
        group="squeeze",
        needed=lambda p: p.conserving,
        rule=lambda p: content_rule(p.pressure_order),
    ),
    SealBlock(
        name="upwind",
        kernel="film_upwind{rough}",
        elements="arc",
        fields=(PRESSURE,),
        group="film",
        needed=lambda p: p.upwinding != 0.0,
        rule=_segment_rule,
    ),
    SealBlock(
        name=FACET,
        kernel="film_facet",
        elements="facets",
        fields=(PRESSURE,),
        group="film",
        needed=lambda p: p.reynolds == "dg",
        rule=lambda p: facet_rule(p.pressure_order),
    ),
    SealBlock("rotation", "mean_rotation", "cells", (ROTATION,), "support", constant=True),
    SealBlock("hold", "mean_axial", "cells", (AXIAL,), "support", constant=True),
)


def blocks_of(p: Seal) -> tuple[SealBlock, ...]:
    """The blocks of a case, first the solids of its section in the order of their elements."""
    solid, *others = BLOCKS
    region_blocks = [replace(solid, name=f"{SOLID} {r}", elements=r, region=r) for r in p.materials]
    body = (solid,) if p.has_body else ()
    return (*region_blocks, *body, *(block for block in others if block.needed(p)))


def obstacles_of(p: Gland) -> dict[str, Obstacle]:
    """The obstacles by the names of their blocks."""
    obstacles = (
        inner_cylinder(ROD, 0.5 * p.rod_diameter),
        outer_cylinder(BORE, 0.5 * p.housing_diameter),
        plane(SEALED_WALL, p.sealed_wall, faces=1),
        plane(AIR_WALL, p.air_wall, faces=-1),
    )
    return {obstacle.name: obstacle for obstacle in obstacles}


def values_at_rest(block: SealBlock, p: Seal, section: SealSection) -> Values | None:
    """Parameters of a block of the unloaded contact problem; None where it is switched off."""
    if block.group == "solid":
        return p.rubber(block.region).rubber_values
    if block.group == "load":
        return {"pressure": 0.0}
    if block.group == "contact":
        wall = {"wall": p.air_wall, "fillet": p.corner_fillet}
        edge = {**wall, "lip": 0.5 * p.rod_diameter + p.extrusion_gap}
        return {"offset": 0.0, "force_weight": 1.0, "friction": p.housing_friction, **edge}
    area, (z, r), polar_moment = section.moments
    if block.name == "rotation":
        centre = {"centre_z": float(z), "centre_r": float(r)}
        return {**centre, "polar_moment": polar_moment, "angle": 0.0}
    if block.name == "hold":
        return {"area": area, "place": 0.0}
    return None


def contact_values(loads: ContactLoads) -> dict[str, Values | None]:
    """Changes by the loads of contact, by block.

    The sealed pressure also acts on the arc up to its lowest node, as the film will carry it there;
    the rod multipliers of that part are the contact pressure in excess of it.
    """
    pressure = {"pressure": loads.sealed_pressure}
    return {
        "sealed_side": pressure,
        "sealed_arc": pressure,
        **{name: {"offset": offset} for name, offset in loads.offsets.items()},
        "hold": {"place": loads.position or 0.0},
    }


def film_values(p: Seal, film: FilmLoads) -> Values:
    """Parameters of the terms of the film."""
    return {
        "rod_radius": 0.5 * p.rod_diameter,
        "rod_speed": film.rod_speed,
        "viscosity": p.viscosity * film.viscosity_ratio,
        "pressure_viscosity": p.pressure_viscosity,
        "cavitation_penalty": p.cavitation_penalty,
        "force_weight": 1.0,
        "shear_weight": film.shear,
        "shear_modulus": p.surface_modulus,
        "upwinding": p.upwinding * copysign(1.0, film.rod_speed),
        "rate": film.rate,
        **p.thinning_values(p.viscosity),
        **p.surfaces.values(),
        "boundary_speed": film.slip,
        **void_values(p.cavitation_pressure),
    }


def contact_kernels(p: Seal) -> tuple[str, ...]:
    """Names of the kernels that the contact problem of a case depends on, each once."""
    kernels = [b.kernel_of(p) for b in blocks_of(p) if not b.of_film]
    return tuple(dict.fromkeys(kernels))
