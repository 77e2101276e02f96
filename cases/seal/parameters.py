"""Parameters of the reciprocating O-ring (section 5.1 and Table 1 of the paper), with their limits.

Units are mm, MPa, N, s.
"""

from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from softehl.cases.harness.parameters import key
from softehl.cases.seal.catalogue import Ring
from softehl.cases.seal.fitting import fitted
from softehl.cases.seal.oils import with_oil
from softehl.cases.seal.regions import MATERIALS, Region, with_regions
from softehl.cases.seal.rubber import with_rubber
from softehl.cases.seal.rubber_keys import RubberKeys
from softehl.cases.seal.sections.keys import (
    SectionKeys,
    is_mesh,
    lobes,
    mesh_of_file,
    surface_of,
    with_outline,
)
from softehl.cases.seal.shear_thinning import ThinningKeys
from softehl.cases.seal.surfaces import ROUGHNESS, Roughness, Surfaces
from softehl.cases.seal.tolerances import read_tolerances
from softehl.runtime.mesh.outline import Shape
from softehl.runtime.mesh.parted_mesh import CAP
from softehl.runtime.mesh.sections import SectionMesh

DENSITIES = (1, 2, 4, 8, 16)
"""Mesh densities of the paper, coarsest first."""

_LOWEST_ESTIMATED = 3
"""Least pressure order whose error is well below what the meshes differ by."""

# strict again on the item: the list itself is lax so that a TOML array becomes a tuple
Speed = Annotated[float, Field(gt=0, strict=True, allow_inf_nan=False)]


class ORing(SectionKeys, RubberKeys, ThinningKeys):
    """Everything that defines one run of the O-ring case, or of a seal of another section.

    Raises pydantic.ValidationError also for a geometry in which the seal is not squeezed.
    """

    names = (
        *("ring", "rod", "squeeze", "gland", "backup", "shore_A", "fit"),
        *("oil", "oil_density", "roelands"),
    )

    density: Literal[1, 2, 4, 8, 16] = key(
        2, "mesh density d: 27 d segments on the lubricated arc", bounds="1, 2, 4, 8 or 16"
    )
    mesh: Literal["graded", "uniform", "file"] = key(
        "graded",
        "segments of the arc",
        bounds='"graded" (fine at the contact edges), "uniform" or "file" (those of the mesh file '
        "that outline names, each divided by density)",
    )
    pressure_order: int = key(
        4, "order m_p of the film pressure on a segment", bounds="1 to 64", ge=1, le=64
    )
    reynolds: Literal["fe", "dg"] = key(
        "fe", "treatment of the Reynolds equation", bounds='"fe" (continuous pressure) or "dg"'
    )
    quadrature: Literal["gauss", "lobatto"] = key("gauss", "quadrature rule of the film")
    quadrature_points: int | None = key(
        None, "points of the film rule", bounds="2 to 128, left out = automatic", ge=2, le=128
    )
    upwinding: float = key(
        1.0, "strength c of the bubble-load upwinding", bounds=">= 0, 0 = the paper's scheme", ge=0
    )
    error_estimate: bool = key(True, "whether the error of h* is estimated, on a graded mesh")
    tolerance: float | None = key(
        None,
        "largest estimated error of h*, reached by finer meshes",
        unit="%",
        bounds="left out = any",
        gt=0,
    )
    sensitivity: bool = key(
        False, "whether sensitivity.csv is written: how results follow every parameter"
    )
    tolerances: tuple[str, ...] = key(
        (),
        "+- tolerances for tolerances.csv, beside those of a catalogue ring",
        bounds='texts such as "viscosity 10 %", "rod_diameter 0.05 mm" or "modulus 15 %"',
        strict=False,
    )
    solid: Literal["taylor_mean", "taylor", "fbar", "q4"] = key(
        "taylor_mean",
        "solid element",
        bounds='"taylor_mean" (passes the patch test), "taylor" (the paper\'s), "fbar" or "q4"',
    )
    sealed_pressure: float = key(1.0, "sealed pressure p_s", unit="MPa", ge=0, le=100)
    stroke: Literal["out", "in", "both"] = key(
        "both", "direction of the rod", bounds='"out" (to the air side), "in" or "both"'
    )
    speeds: tuple[Speed, ...] = key(
        (1600.0, 800.0, 400.0, 200.0, 100.0),
        "rod speeds |U|",
        unit="mm/s",
        bounds="a number > 0, or a list of different ones in any order",
        min_length=1,
        strict=False,
    )
    pressure_viscosity: float = key(
        0.02, "pressure-viscosity coefficient alpha of (13)", unit="1/MPa", ge=0, le=1
    )
    shear_traction: bool = key(True, "whether the shear stress (17) acts on the seal")
    rotation: Literal["fixed", "free"] = key(
        "fixed", "mean rotation of the section", bounds='"fixed" (held at zero) or "free"'
    )
    housing_friction: float = key(
        0.0,
        "coefficient of Coulomb friction at the housing and the walls of the groove",
        bounds="0 to 1; 0 = frictionless, the section is held",
        ge=0,
        le=1,
    )
    solver: Literal["auto", "monolithic"] = key(
        "auto",
        "way to the solution",
        bounds='"auto" (fast, checks itself) or "monolithic" (reference)',
    )
    linear: Literal["auto", "superlu", "pardiso", "petsc"] = key(
        "auto",
        "linear solver",
        bounds='"superlu", "pardiso", "petsc" (MUMPS, also under mpirun) or "auto" (pardiso where '
        "installed)",
    )

    ring: str | None = key(
        None,
        "a ring by its name, for inner_diameter and section_diameter",
        bounds='"AS568-226", "ISO 3601 50.4x3.55", left out = by its diameters',
    )
    rod: float | None = key(None, "the same as rod_diameter", unit="mm", gt=0)
    squeeze: float | None = key(
        None,
        "part of section_diameter that the gland takes away, for housing_diameter",
        unit="%",
        bounds="> 0 to 50, left out = by housing_diameter",
        gt=0,
        le=50,
    )
    gland: Literal["dynamic"] | None = key(
        None,
        "a standard gland, for housing_diameter and groove_width where they are not given",
        bounds='"dynamic" (reciprocating rod), left out = none, or "dynamic" with a ring',
    )
    backup: bool | None = key(
        None,
        "whether a back-up ring closes the gap between rod and housing on the air side",
        bounds="true, false (then extrusion_gap too), left out = true without extrusion_gap",
    )
    extrusion_gap: float = key(
        0.0,
        "radial gap between rod and housing on the air side",
        unit="mm",
        bounds="0 = closed, to 0.5",
        ge=0,
        le=0.5,
    )
    corner_fillet: float = key(
        0.1,
        "fillet of the edge of the housing at the extrusion gap",
        unit="mm",
        bounds="0.02 to 2, used where there is an extrusion_gap",
        ge=0.02,
        le=2,
    )

    inner_diameter: float = key(
        50.39, "inner diameter of the seal D_inner", unit="mm", gt=0, le=5000
    )
    section_diameter: float = key(
        3.53,
        "diameter of the section D_seal; radial height of one that is not round",
        unit="mm",
        gt=0,
    )
    rod_diameter: float = key(50.0, "rod diameter D_rod", unit="mm", gt=0)
    housing_diameter: float = key(56.30, "inner diameter of the housing D_housing", unit="mm", gt=0)
    viscosity: float = key(
        6.59e-8,
        "viscosity eta_0 at zero pressure of (13)",
        unit="MPa s",
        bounds='1e-12 to 1e-3; 1e-9 MPa s is 1 mPa s, and "46 mPa s" may be written too',
        ge=1e-12,
        le=1e-3,
    )
    oil: str | None = key(
        None,
        "an oil by its grade or two viscosities, for viscosity and pressure_viscosity",
        bounds='"ISO VG 46", "46 cSt at 40 degC, 6.8 cSt at 100 degC"',
    )
    temperature: float | None = key(
        None, "temperature of oil and rubber, where they depend on it", unit="degC", ge=-60, le=200
    )
    oil_density: float | None = key(
        None,
        "density of the oil at 15 degC",
        unit="kg/m3",
        bounds="500 to 2000, left out = 870",
        ge=500,
        le=2000,
    )
    roelands: float | None = key(
        None,
        "Roelands' pressure-viscosity index z, for pressure_viscosity",
        bounds="0 to 2",
        ge=0,
        le=2,
    )
    cavitation: Literal["penalty", "mass-conserving"] | None = key(
        None,
        "model of cavitation",
        bounds='"penalty" (25) or "mass-conserving", left out = the latter with roughness, '
        "with a cavitation_pressure and where a section has two lobes",
    )
    cavitation_pressure: float = key(
        0.0, "mass-conserving: pressure of the ruptured film", unit="MPa", ge=-0.1, le=0
    )
    cavitation_penalty: float = key(
        1.0e4, "cavitation penalty epsilon of (25)", unit="mm/(MPa s)", gt=0
    )
    roughness: Roughness = key(
        (0.0, 0.0), "rms heights of rod and seal, 0 = smooth", unit="um", bounds=ROUGHNESS
    )
    asperity_stiffness: float | None = key(
        None,
        "pressure K of touching asperities, K F_3/2(h/sigma)",
        unit="MPa",
        bounds="> 0, left out = 4 (mu_1 + mu_2)",
        gt=0,
    )
    boundary_friction: float = key(0.1, "friction coefficient of touching asperities", ge=0, le=2)

    materials: dict[str, Region] = key({}, "materials of regions of the section", bounds=MATERIALS)

    groove_width: float = key(3.74, "axial width of the groove", unit="mm", gt=0)
    groove_centre: float = key(
        0.0,
        "axial position of the middle of the groove, section centre = 0",
        unit="mm",
        bounds="such that the section is between the walls",
    )
    arc_start: float | None = key(
        None,
        "sealed end of the lubricated arc, from the bottom",
        unit="degrees",
        bounds="-120 to < 0, left out = found from the contact",
        ge=-120.0,
        lt=0.0,
    )
    arc_end: float | None = key(
        None,
        "air end of the lubricated arc, from the bottom",
        unit="degrees",
        bounds="> 0 to 120, left out = found from the contact",
        gt=0.0,
        le=120.0,
    )

    @classmethod
    def completed(cls, given: dict[str, Any]) -> dict[str, Any]:
        """Diameters and width from ring, rod, squeeze and gland; rubber and oil.  ValueError."""
        return with_oil(with_rubber(with_regions(fitted(with_outline(dict(given))))))

    @property
    def air_wall(self) -> float:
        """Axial place of the groove's wall on the air side, mm."""
        return self.groove_centre + 0.5 * self.groove_width

    @property
    def free_section(self) -> Shape:
        """The free section where it is."""
        return self.free(self.section_diameter, self.inner_diameter)

    @property
    def free_ring(self) -> Ring:
        """The seal as it is sold."""
        if self.round:
            return Ring("", self.inner_diameter, self.section_diameter)
        outline = self.free_section.outline
        sizes = {"area": outline.area, "middle": outline.centroid[1]}
        return Ring("", self.inner_diameter, self.section_diameter, **sizes)

    @property
    def axial_width(self) -> float:
        """That of the free section, mm."""
        if self.round:
            return self.section_diameter
        left, _, right, _ = self.free_section.outline.box
        return right - left

    @property
    def measures(self) -> dict[str, float]:
        """Key of each dimension of the section but its height -> what it is, mm."""
        return self.measured(self.section_diameter)

    @property
    def lobes(self) -> int:
        """How many contacts with the rod the section is made for."""
        return 1 if self.round else lobes(self.free_section)

    @property
    def given_arc(self) -> tuple[float, float] | None:
        """Ends of the lubricated arc where they are given; else the contact decides."""
        start, end = self.arc_start, self.arc_end
        return None if start is None or end is None else (start, end)

    @property
    def rubs(self) -> bool:
        """Whether housing and walls have friction, which then holds the section by itself."""
        return self.housing_friction > 0.0

    @property
    def rough(self) -> bool:
        """Whether the film knows roughness."""
        return any(self.roughness)

    @property
    def conserving(self) -> bool:
        """Whether the film conserves mass where it ruptures."""
        if self.cavitation is None:
            return self.rough or self.lobes > 1 or self.cavitation_pressure < 0.0
        return self.cavitation == "mass-conserving"

    @property
    def surfaces(self) -> Surfaces:
        """Roughness, asperities and their friction; rubber on rigid asperities is as E* = 4 G."""
        stiffness = self.asperity_stiffness or 4.0 * self.surface_modulus
        return Surfaces.of(self.roughness, stiffness, self.boundary_friction)

    @property
    def opens(self) -> bool:
        """Whether there is a gap between rod and housing on the air side."""
        return self.extrusion_gap > 0.0

    @property
    def surface_modulus(self) -> float:
        """Shear modulus of what the film is on [MPa]."""
        under = surface_of(self._file) if self.mesh == "file" else CAP
        return self.rubber(under if under in self.materials else "").shear_modulus

    @property
    def regions(self) -> tuple[str, ...]:
        """Names of the regions that may have a material of their own."""
        if self.mesh == "file":
            return tuple(self.file_mesh.regions)
        return () if self.cap_thickness is None else (CAP,)

    @property
    def has_body(self) -> bool:
        """Whether a part of the section has no material of its own."""
        if self.mesh != "file" or not self.materials:
            return True
        mesh = self.file_mesh
        own = set[int]().union(*(mesh.regions[name].tolist() for name in self.materials))
        return len(own) < len(mesh.quads)

    @property
    def file_mesh(self) -> SectionMesh:
        """The mesh of the file that outline names, where it is."""
        return mesh_of_file(self._file, self.inner_diameter)

    @property
    def _file(self) -> Path:
        return Path(self.outline or "")

    def rubber(self, region: str) -> RubberKeys:
        """What a region of the section is made of; "" where it has no material of its own."""
        return self.materials[region] if region else self

    @field_validator("density", mode="before")
    @classmethod
    def _density_is_integer(cls, density: object) -> object:
        # a Literal compares by ==, which would let 2.0 and True through
        if type(density) is not int:
            raise ValueError("not an integer")
        return density

    @field_validator("speeds")
    @classmethod
    def _speeds_differ(cls, speeds: tuple[float, ...]) -> tuple[float, ...]:
        if len(set(speeds)) < len(speeds):
            raise ValueError("a speed is given twice")
        return speeds

    @model_validator(mode="after")
    def _mesh_is_there(self) -> Self:
        if self.mesh != "file":
            return self
        if not is_mesh(self.outline):
            raise ValueError(
                'mesh = "file" takes the mesh of a file: give outline = "seal.msh" too, or leave '
                "mesh out"
            )
        if self.cap_thickness is not None:
            raise ValueError("cap_thickness: the mesh of a file has its own regions; leave it out")
        regions = self.file_mesh.regions
        cells = [n for name in self.materials for n in regions.get(name, np.empty(0)).tolist()]
        if len(cells) > len(set(cells)):
            names = " and ".join(self.materials)
            raise ValueError(f"materials: {names} have elements in common; an element has one")
        return self

    @model_validator(mode="after")
    def _rubber_has_an_element(self) -> Self:
        rubbers: tuple[RubberKeys, ...] = (self, *self.materials.values())
        for rubber in rubbers:
            if self.solid != "taylor_mean" and rubber.energy != "mooney_rivlin":
                raise ValueError(
                    f'material = "{rubber.material}" and solid = "{self.solid}": other elements '
                    'than "taylor_mean" have "mooney-rivlin" and "neo-hooke" alone; leave solid out'
                )
        return self

    @model_validator(mode="after")
    def _sensitivity_has_a_meaning(self) -> Self:
        read_tolerances(self.tolerances, dict(self), self.ring)
        if self.tolerances and not self.sensitivity:
            raise ValueError(
                "tolerances need the sensitivities of the run; set sensitivity = true "
                "(--sensitivity)"
            )
        if self.sensitivity and self.rubs:
            raise ValueError(
                f"sensitivity = true with housing_friction = {self.housing_friction:g}: with "
                "friction a state depends on how it was reached, and has no derivative by its "
                "parameters alone; set housing_friction = 0"
            )
        return self

    @model_validator(mode="after")
    def _rule_is_rich_enough(self) -> Self:
        points, order = self.quadrature_points, self.pressure_order
        if points is not None and points < order:
            raise ValueError(
                f"quadrature_points = {points} cannot hold {order + 1} pressures of a segment "
                f"(pressure_order = {order}); give at least {order}, or leave it out"
            )
        return self

    @model_validator(mode="after")
    def _film_has_its_model(self) -> Self:
        for name, given in (
            ("roughness", self.rough),
            ("cavitation_pressure", self.cavitation_pressure < 0.0),
        ):
            if given and not self.conserving:
                raise ValueError(f'cavitation = "penalty" knows no {name}; leave cavitation out')
        if self.conserving and self.reynolds == "dg":
            raise ValueError('reynolds = "dg" knows the penalty only; use "fe", or leave it out')
        self.require_smooth_film(dg=self.reynolds == "dg", rough=self.rough)
        return self

    @model_validator(mode="after")
    def _tolerance_has_an_estimate(self) -> Self:
        if self.tolerance is not None and not (self.error_estimate and self.mesh == "graded"):
            raise ValueError(
                f"tolerance = {self.tolerance:g} needs an estimate of the error; "
                'set error_estimate = true and mesh = "graded"'
            )
        if self.tolerance is not None and self.pressure_order < _LOWEST_ESTIMATED:
            raise ValueError(
                f"tolerance = {self.tolerance:g}: meshes do not show the error of pressure_order = "
                f"{self.pressure_order}; use an order of at least {_LOWEST_ESTIMATED}"
            )
        return self

    @model_validator(mode="after")
    def _air_side_is_closed_or_open(self) -> Self:
        gap, depth = self.extrusion_gap, 0.5 * (self.housing_diameter - self.rod_diameter)
        if self.backup and gap:
            raise ValueError(
                f"backup = true and extrusion_gap = {gap:g} contradict each other: a back-up ring "
                "closes the gap; leave one of them out"
            )
        if self.backup is False and not gap:
            raise ValueError(
                "backup = false leaves a gap whose width is not given: add extrusion_gap, 0.02 to "
                "0.1 mm is usual, or leave backup out"
            )
        if gap and gap + self.corner_fillet > 0.5 * depth:
            raise ValueError(
                f"extrusion_gap = {gap:g} and corner_fillet = {self.corner_fillet:g} mm leave too "
                f"little of a wall that is {depth:g} mm high; both together at most half of it"
            )
        if gap and self.rubs:
            raise ValueError(
                f"extrusion_gap = {gap:g} and housing_friction = {self.housing_friction:g}: the "
                "edge of the gap has no friction; give one of them"
            )
        return self

    @model_validator(mode="after")
    def _arc_has_two_ends(self) -> Self:
        if (self.arc_start is None) != (self.arc_end is None):
            raise ValueError("arc_start and arc_end: give both, or none to have them found")
        return self

    @model_validator(mode="after")
    def _section_is_one(self) -> Self:
        self.sized(self.section_diameter)
        if self.round:
            if self.materials:
                raise ValueError(
                    'materials and cap_thickness: not for section = "round"; leave them out'
                )
            return self
        _ = self.free_section
        has = ", ".join(self.regions) or "no regions; cap_thickness makes one"
        for name in self.materials:
            if name not in self.regions:
                raise ValueError(f"materials.{name}: the section has {has}")
        for name, given in (
            ("arc_start and arc_end", self.arc_start is not None),
            ("extrusion_gap", self.opens),
        ):
            if given:
                raise ValueError(f'{name}: for section = "round" only; leave it out')
        if self.sensitivity and (self.outline is not None or self.cap_thickness is not None):
            raise ValueError(
                "sensitivity = true: not of an outline of a file, which has no dimensions, and not "
                "of a section with a cap; leave it out"
            )
        return self

    @model_validator(mode="after")
    def _seal_is_squeezed(self) -> Self:
        gap = 0.5 * (self.housing_diameter - self.rod_diameter)
        if not 0.5 * self.section_diameter < gap < self.section_diameter:
            raise ValueError(
                f"the gap between rod and housing is {gap:g} mm (rod_diameter, housing_diameter); "
                f"to squeeze the seal it must be between a half and one section_diameter, "
                f"{0.5 * self.section_diameter:g} to {self.section_diameter:g} mm"
            )
        stretch = self.rod_diameter / self.inner_diameter - 1.0
        if not -0.1 <= stretch <= 0.2:
            raise ValueError(
                f"rod_diameter = {self.rod_diameter:g} mm stretches inner_diameter = "
                f"{self.inner_diameter:g} mm by {100 * stretch:.3g} %; allowed are -10 to 20 %"
            )
        if self.groove_width < self.axial_width:
            what = "section_diameter" if self.round else "the width of the section"
            raise ValueError(
                f"groove_width = {self.groove_width:g} mm; it must be at least "
                f"{what}, {self.axial_width:g} mm"
            )
        limit = 0.5 * (self.groove_width - self.axial_width)
        if abs(self.groove_centre) > limit + 1e-9 * self.groove_width:
            what = "round section" if self.round else "section"
            raise ValueError(
                f"groove_centre = {self.groove_centre:g} mm; the {what} must lie between "
                f"the walls, {-limit:g} to {limit:g} mm"
            )
        return self
