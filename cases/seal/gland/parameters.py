"""Parameters of the reciprocating O-ring (section 5.1 and Table 1 of the paper), with their limits.

Units are mm, MPa, N, s.
"""

from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import Field, field_validator, model_validator

from softehl.cases.harness.parameters import key
from softehl.cases.seal.gland.catalogue import Ring
from softehl.cases.seal.gland.contradictions import require_consistent
from softehl.cases.seal.gland.fitting import fitted
from softehl.cases.seal.gland.grooves import Kind
from softehl.cases.seal.gland.headings import SEAL, WORDS
from softehl.cases.seal.gland.oils import with_oil
from softehl.cases.seal.gland.rubbers.regions import MATERIALS, Region, with_regions
from softehl.cases.seal.gland.rubbers.rubber import with_rubber
from softehl.cases.seal.gland.rubbers.rubber_keys import RubberKeys
from softehl.cases.seal.gland.sections.keys import (
    SectionKeys,
    lobes,
    mesh_of_file,
    surface_of,
    with_outline,
)
from softehl.cases.seal.gland.shear_thinning import ThinningKeys
from softehl.cases.seal.gland.surfaces import ROUGHNESS, Roughness, Surfaces
from softehl.cases.seal.gland.trade.said import SaidKeys, with_limits
from softehl.runtime.mesh.outline import Shape
from softehl.runtime.mesh.parted_mesh import CAP
from softehl.runtime.mesh.sections import SectionMesh

SIGNED = "other than 0; of a piston seal negative: give bore"

Density = Literal[1, 2, 4, 8, 16]
DENSITIES: tuple[int, ...] = get_args(Density)
"""Mesh densities of the paper, coarsest first."""

# strict again on the item: the list itself is lax so that a TOML array becomes a tuple
Speed = Annotated[float, Field(gt=0, strict=True, allow_inf_nan=False)]


class ORing(SectionKeys, RubberKeys, ThinningKeys, SaidKeys):
    """Everything that defines one run of the O-ring case, or of a seal of another section.

    Raises pydantic.ValidationError also for a geometry in which the seal is not squeezed.
    """

    names = (
        *(
            "ring",
            "rod",
            "bore",
            "groove_diameter",
            "squeeze",
            "groove_depth",
            "fill",
            "gland",
            "backup",
        ),
        *("compound", "shore_A", "fit"),
        *("oil", "oil_density", "roelands", "said"),
    )
    headings = SEAL
    words = WORDS

    density: Density = key(
        2,
        "mesh density d: 27 d segments on an arc that is given, 33 d or more on one that is found",
        bounds="1, 2, 4, 8 or 16",
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
    travel: float = key(
        100.0, "way of the rod from end to end, for leakage in a cycle", unit="mm", gt=0
    )
    pressure_viscosity: float = key(
        0.02,
        "coefficient alpha of eta = eta_0 exp(alpha p)",
        unit="1/MPa",
        ge=0,
        le=1,
    )
    shear_traction: bool = key(True, "whether the shear stress of the film acts on the seal")
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
        bounds='"AS568-226", "36x4", "ISO 3601 50.4x3.55", "X-ring 36x4", "U-cup 25x35x8", left '
        "out = by its diameters (docs/trade.md)",
    )
    rod: float | None = key(
        None, "the same as rod_diameter", unit="mm", bounds='> 0, or "36 f7"', gt=0
    )
    bore: float | None = key(
        None,
        "bore that a piston seal slides on: the groove is in the piston, inside the ring",
        unit="mm",
        bounds='> 0, or "40 H8"; left out = a rod seal',
        gt=0,
    )
    groove_diameter: float | None = key(
        None,
        "diameter of the ground of the groove, for housing_diameter",
        unit="mm",
        bounds='> 0, or "33 h9"',
        gt=0,
    )
    squeeze: float | None = key(
        None,
        "part of section_diameter that the gland takes away, for housing_diameter",
        unit="%",
        bounds="> 0 to 50, left out = by housing_diameter",
        gt=0,
        le=50,
    )
    groove_depth: float | None = key(
        None,
        "radial depth of the gland, from rod or bore to its ground, for housing_diameter",
        unit="mm",
        bounds="> 0, left out = by housing_diameter",
        gt=0,
    )
    fill: float | None = key(
        None,
        "part of the gland that the free seal fills, for groove_width",
        unit="%",
        bounds="30 to 100, left out = by groove_width",
        ge=30,
        le=100,
    )
    gland: Kind | None = key(
        None,
        "a standard gland, for housing_diameter and groove_width where they are not given",
        bounds='"dynamic" or "hydraulic" (the same), "pneumatic", left out = none, or "dynamic" '
        "with a ring (docs/glands.md)",
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
        50.39,
        "inner diameter of the seal D_inner; of a piston seal less its outside diameter",
        unit="mm",
        bounds=SIGNED,
        ge=-5000,
        le=5000,
    )
    section_diameter: float = key(
        3.53,
        "diameter of the section D_seal; radial height of one that is not round",
        unit="mm",
        gt=0,
    )
    rod_diameter: float = key(50.0, "rod diameter D_rod", unit="mm", bounds=SIGNED)
    housing_diameter: float = key(
        56.30, "inner diameter of the housing D_housing", unit="mm", bounds=SIGNED
    )
    viscosity: float = key(
        6.59e-8,
        "dynamic viscosity eta_0 at zero pressure",
        unit="MPa s",
        bounds='1e-12 to 1e-3; 1e-9 MPa s is 1 mPa s, and "46 mPa s" may be written too',
        ge=1e-12,
        le=1e-3,
    )
    oil: str | None = key(
        None,
        "an oil by its grade or two viscosities, for viscosity and pressure_viscosity",
        bounds='"ISO VG 46", "HLP 46", "HVLP 46", "46 cSt at 40 degC, 6.8 cSt at 100 degC"',
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
        bounds='"penalty" or "mass-conserving", left out = the latter with roughness, '
        "with a cavitation_pressure and where a section has two lobes",
    )
    cavitation_pressure: float = key(
        0.0, "mass-conserving: pressure of the ruptured film", unit="MPa", ge=-0.1, le=0
    )
    cavitation_penalty: float = key(
        1.0e4, "penalty of pressures below zero, flux for a pressure", unit="mm/(MPa s)", gt=0
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
        values = fitted(with_outline(with_limits(dict(given))))
        return with_oil(with_rubber(with_regions(values)))

    @property
    def piston(self) -> bool:
        """True if the seal sits in a piston and slides on a bore.

        Its diameters are counted negative then. With r = -radius a piston seal is a rod seal: what
        slides is below it, what holds it above.
        """
        return self.rod_diameter < 0.0

    @property
    def ring_diameter(self) -> float:
        """Inside diameter of the free seal, mm."""
        outside = self.inner_diameter + 2.0 * self.section_diameter
        return -outside if self.piston else self.inner_diameter

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
        """Height of the free section, mm."""
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
        """Number of contacts with the rod that the section is made for."""
        return 1 if self.round else lobes(self.free_section)

    @property
    def given_arc(self) -> tuple[float, float] | None:
        """Ends of the lubricated arc where they are given; else the contact decides."""
        start, end = self.arc_start, self.arc_end
        return None if start is None or end is None else (start, end)

    @property
    def rubs(self) -> bool:
        """True if housing and walls have friction, which then holds the section by itself."""
        return self.housing_friction > 0.0

    @property
    def rough(self) -> bool:
        """True if the film knows roughness."""
        return any(self.roughness)

    @property
    def conserving(self) -> bool:
        """True if the film conserves mass where it ruptures."""
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
        """True if there is a gap between rod and housing on the air side."""
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
        """True if a part of the section has no material of its own."""
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
        """Rubber of a region of the section; "" names the section itself."""
        return self.materials[region] if region else self

    @field_validator("inner_diameter", "rod_diameter", "housing_diameter")
    @classmethod
    def _diameter_is_not_zero(cls, diameter: float) -> float:
        if diameter == 0.0:
            raise ValueError("a diameter is not 0")
        return diameter

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
    def _nothing_contradicts(self) -> Self:
        require_consistent(self)
        return self
