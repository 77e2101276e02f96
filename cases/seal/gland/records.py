"""Records of a seal: groups of keys, with the values that follow from them alone.

The discretisation, the numerics (solvers, support of the section, results beside the curve), the
duty (sealed pressure and motion), the oil, the seal before it is fitted, the model of its film, the
gland.
"""

from math import pi
from pathlib import Path
from typing import Annotated, Literal, get_args

import numpy as np
from pydantic import AfterValidator, Field, field_validator

from softehl.cases.harness.parameters import Number, Parameters, different, key
from softehl.cases.seal.gland.grooves import Kind, squeeze
from softehl.cases.seal.gland.rubbers.regions import MATERIALS, Region
from softehl.cases.seal.gland.rubbers.rubber_keys import Rubber
from softehl.cases.seal.gland.sections.section_keys import (
    MEASURES,
    ROUND,
    SectionKeys,
    capped,
    dimensions,
    lobes,
    section_of_file,
    shape_of,
)
from softehl.cases.seal.gland.sections.shapes import HEIGHT, SECTIONS
from softehl.cases.seal.gland.shear_thinning import ThinningKeys
from softehl.cases.seal.gland.surfaces import Surfaces
from softehl.cases.seal.gland.trade.service_names import read_service
from softehl.cases.seal.meshing.outline import Shape
from softehl.cases.seal.meshing.section_mesh import SectionMesh
from softehl.cases.seal.meshing.two_region_mesh import CAP

Density = Literal[1, 2, 4, 8, 16]
DENSITIES: tuple[int, ...] = get_args(Density)
"""Mesh densities of the paper, coarsest first."""


class Discretisation(Parameters):
    """Mesh, elements of section and film, and the error that is allowed."""

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
    solid: Literal["taylor_mean", "taylor", "fbar", "q4"] = key(
        "taylor_mean",
        "solid element",
        bounds='"taylor_mean" (passes the patch test), "taylor" (the paper\'s), "fbar" or "q4"',
    )

    @field_validator("density", mode="before")
    @classmethod
    def _density_is_integer(cls, density: object) -> object:
        # a Literal compares by ==, which would let 2.0 and True through
        if type(density) is not int:
            raise ValueError("not an integer")
        return density


class Numerics(Parameters):
    """Solvers, support, sensitivities."""

    sensitivity: bool = key(
        False, "whether sensitivity.csv is written: derivatives of the results by every parameter"
    )
    tolerances: tuple[str, ...] = key(
        (),
        "+- tolerances for tolerances.csv, beside those of a catalogue ring",
        bounds='texts such as "viscosity 10 %", "rod_diameter 0.05 mm" or "modulus 15 %"',
        strict=False,
    )
    rotation: Literal["fixed", "free"] = key(
        "fixed", "mean rotation of the section", bounds='"fixed" (held at zero) or "free"'
    )
    solver: Literal["auto", "monolithic"] = key(
        "auto",
        "method of solution",
        bounds='"auto" (fast, checks itself) or "monolithic" (reference)',
    )
    linear: Literal["auto", "superlu", "pardiso", "petsc"] = key(
        "auto",
        "linear solver",
        bounds='"superlu", "pardiso", "petsc" (MUMPS, also under mpirun) or "auto" (pardiso where '
        "installed)",
    )


Speed = Annotated[Number, Field(gt=0)]
Speeds = Annotated[tuple[Speed, ...], Field(min_length=1, strict=False), AfterValidator(different)]


class Duty(Parameters):
    """Sealed pressure, speeds and strokes."""

    sealed_pressure: float = key(
        1.0,
        "sealed pressure p_s",
        unit="MPa",
        bounds='0 to 100; "160 bar" may be written too',
        ge=0,
        le=100,
    )
    stroke: Literal["out", "in", "both"] = key(
        "both", "direction of the rod", bounds='"out" (to the air side), "in" or "both"'
    )
    speeds: Speeds = key(
        (1600.0, 800.0, 400.0, 200.0, 100.0),
        "rod speeds |U|",
        unit="mm/s",
        bounds="a number > 0, or a list of different ones in any order",
    )
    travel: float = key(100.0, "stroke length of the rod, for leakage in a cycle", unit="mm", gt=0)
    service: str | None = key(
        None,
        "service that the net leakage is also given for",
        bounds='"1e6 cycles", "2000 h" or "500 km" of travel, left out = 100 m',
    )

    @field_validator("service")
    @classmethod
    def _service_is_read(cls, service: str | None) -> str | None:
        if service is not None:
            read_service(service)
        return service


THICKEST = 1e-3
"""Largest viscosity, MPa s."""


class Oil(ThinningKeys):
    """The oil at the temperature of the seal."""

    oil: str | None = key(
        None,
        "a fluid by its grade or two viscosities, for viscosity and pressure_viscosity",
        bounds='"ISO VG 46", "HLP 46", "HVLP 46", "HFC 46", "PAO 46", "46 cSt at 40 degC, 6.8 cSt '
        'at 100 degC"',
    )
    temperature: float | None = key(
        None, "temperature of oil and rubber, where they depend on it", unit="degC", ge=-60, le=200
    )
    viscosity: float = key(
        6.59e-8,
        "dynamic viscosity eta_0 at zero pressure",
        unit="MPa s",
        bounds='1e-12 to 1e-3; 1e-9 MPa s is 1 mPa s, and "46 mPa s" may be written too',
        ge=1e-12,
        le=THICKEST,
    )
    pressure_viscosity: float = key(
        0.02, "coefficient alpha of eta = eta_0 exp(alpha p)", unit="1/MPa", ge=0, le=1
    )
    roelands: float | None = key(
        None,
        "Roelands' pressure-viscosity index z, for pressure_viscosity",
        bounds="0 to 2",
        ge=0,
        le=2,
    )
    viscosity_slope: float | None = key(
        None,
        "fall of ln eta_0 for a degree at the temperature (40 degC if left out), for heating",
        unit="1/K",
        bounds="0 to 0.5, 0.03 to 0.08 is usual, left out = that of the oil",
        ge=0,
        le=0.5,
    )
    oil_density: float | None = key(
        None,
        "density of the oil at 15 degC",
        unit="kg/m3",
        bounds="500 to 2000, left out = 870, or typical of a fluid that is no mineral oil",
        ge=500,
        le=2000,
    )


SIGNED = "other than 0; of a piston seal negative: give bore"


class FreeSeal(SectionKeys):
    """The seal before it is fitted; its lengths are in mm."""

    ring: str | None = key(
        None,
        "a ring by its name, for inner_diameter and section_diameter",
        bounds='"AS568-226", "36x4", "ISO 3601-1 226A", "P50", "X-ring 36x4", "U-cup 25x35x8", '
        "left out = by its diameters (docs/trade.md)",
    )
    inner_diameter: float = key(
        50.39,
        "inner diameter of the seal D_inner; of a piston seal minus its outside diameter",
        unit="mm",
        bounds=SIGNED,
        ge=-5000,
        le=5000,
    )
    section_diameter: float = key(
        HEIGHT,
        "diameter of the section D_seal; radial height of one that is not round",
        unit="mm",
        gt=0,
        le=500,
    )

    swelling: float | None = key(
        None,
        "growth of the ring in its medium by volume, for its sizes and the modulus of its hardness",
        unit="%",
        bounds="-20 to 100, left out = none; only of a ring by its name",
        ge=-20,
        le=100,
    )
    compression_set: float | None = key(
        None,
        "part of the squeeze that the ring has lost for good (ISO 815)",
        unit="%",
        bounds="0 to 95, left out = none; only of a ring by its name",
        ge=0,
        le=95,
    )

    @property
    def volume(self) -> float:
        """Of the free seal, mm^3; of a piston seal, whose diameters are negative, negative."""
        outline = self.free_section.outline
        return 2.0 * pi * outline.centroid[1] * outline.area

    @property
    def free_section(self) -> Shape:
        """The free section where it is.  ValueError where there is none."""
        sizes = self.sizes
        if self.outline is None:
            shape = shape_of(self.section, tuple(sizes.items()), self.inner_diameter)
        elif self.section != ROUND or len(sizes) > 1:
            others = [name for name in sizes if name != "height"] or ["section"]
            raise ValueError(f"outline and {', '.join(others)}: give one of them")
        else:
            shape, _ = section_of_file(Path(self.outline), self.inner_diameter)
        return shape if self.cap_thickness is None else capped(shape, self.cap_thickness)

    @property
    def sizes(self) -> dict[str, float]:
        """The dimensions that are given, as their page calls them.  ValueError for others'."""
        names = dimensions(self.section)
        lengths = {name: size for name in MEASURES if (size := getattr(self, name)) is not None}
        for name in lengths:
            if name not in names:
                has = ", ".join(names) or "section_diameter alone"
                raise ValueError(f'{name} is no dimension of section = "{self.section}": {has}')
        return {"height": self.section_diameter, **{names[n]: size for n, size in lengths.items()}}

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
        if self.round or self.outline is not None:
            return {}
        page = SECTIONS[self.section](**self.sizes)
        return {
            name: getattr(page, field_name) for name, field_name in dimensions(self.section).items()
        }

    @property
    def lobes(self) -> int:
        """Number of contacts with the rod that the section is made for."""
        return 1 if self.round else lobes(self.free_section)

    @property
    def file_mesh(self) -> SectionMesh:
        """The mesh of the file that outline names, where it is."""
        _, mesh = section_of_file(Path(self.outline or ""), self.inner_diameter)
        assert mesh is not None
        return mesh


class Solid(FreeSeal, Rubber, Discretisation):
    """A section, its elements, and a rubber for each of its regions."""

    materials: dict[str, Region] = key({}, "materials of regions of the section", bounds=MATERIALS)

    @property
    def surface_rubber(self) -> Rubber:
        """Rubber that the film is on."""
        under = self._surface if self.mesh == "file" else CAP
        return self.rubber(under if under in self.materials else "")

    @property
    def surface_modulus(self) -> float:
        """Shear modulus of what the film is on [MPa]."""
        return self.surface_rubber.shear_modulus

    @property
    def _surface(self) -> str:
        """The region of the mesh file that the lowest point of its film is on, "" if of none."""
        mesh = self.file_mesh
        lowest = mesh.arc_nodes[int(np.argmin(mesh.points[mesh.arc_nodes, 1]))]
        of_it = (name for name, cells in mesh.regions.items() if lowest in mesh.quads[cells])
        return next(of_it, "")

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
        cells = set[int]().union(*(mesh.regions[name].tolist() for name in self.materials))
        return len(cells) < len(mesh.quads)

    def load_ratio(self, pressure: float) -> float:
        """A pressure (MPa) over the shear modulus of the softest part of the section."""
        parts = [*([""] if self.has_body else []), *self.materials]
        return pressure / min(self.rubber(part).shear_modulus for part in parts)

    def rubber(self, region: str) -> Rubber:
        """Rubber of a region of the section; "" names the section itself."""
        return self.materials[region] if region else self


class FilmModel(FreeSeal, Surfaces):
    """The model of a film between these surfaces; the number of its contacts is by the section."""

    cavitation: Literal["penalty", "mass-conserving"] | None = key(
        None,
        "model of cavitation",
        bounds='"penalty" or "mass-conserving", left out = mass-conserving with roughness, '
        "with a cavitation_pressure, with an outline and where a section has two lobes",
    )
    cavitation_pressure: float = key(
        0.0, "mass-conserving: pressure of the ruptured film", unit="MPa", ge=-0.1, le=0
    )
    cavitation_penalty: float = key(
        1.0e4, "penalty of pressures below zero, flux for a pressure", unit="mm/(MPa s)", gt=0
    )
    shear_traction: bool = key(True, "whether the shear stress of the film acts on the seal")
    heating: bool = key(
        False, "whether friction warms the film, in steady state; needs an oil, or viscosity_slope"
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

    @property
    def given_arc(self) -> tuple[float, float] | None:
        """Ends of the lubricated arc where they are given; else the contact decides."""
        start, end = self.arc_start, self.arc_end
        return None if start is None or end is None else (start, end)

    @property
    def conserving(self) -> bool:
        """True if the film conserves mass where it ruptures."""
        if self.cavitation is None:
            drawn = (
                self.outline is not None
            )  # its pressure may fall to zero anywhere in the contact
            return self.rough or drawn or self.lobes > 1 or self.cavitation_pressure < 0.0
        return self.cavitation == "mass-conserving"


OF_PISTON = {"rod_diameter": "bore", "housing_diameter": "groove_diameter"}
"""Key that is less than 0 in a piston seal -> the key that it is given by."""


class Gland(FreeSeal):
    """A seal in its gland; lengths in mm."""

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
    rod_diameter: float = key(50.0, "rod diameter D_rod", unit="mm", bounds=SIGNED)
    gland: Kind | None = key(
        None,
        "a standard gland, for housing_diameter and groove_width where they are not given",
        bounds='"dynamic" or "hydraulic" (the same), "pneumatic", left out = none, or "dynamic" '
        "with a ring (docs/glands.md)",
    )
    groove_depth: float | None = key(
        None,
        "radial depth of the groove, from rod or bore to its bottom, for housing_diameter",
        unit="mm",
        bounds="> 0, left out = by housing_diameter",
        gt=0,
    )
    squeeze: float | None = key(
        None,
        "reduction of section_diameter by the gland, for housing_diameter",
        unit="%",
        bounds="> 0 to 50, left out = by housing_diameter",
        gt=0,
        le=50,
    )
    groove_diameter: float | None = key(
        None,
        "diameter of the bottom of the groove, for housing_diameter",
        unit="mm",
        bounds='> 0, or "43 H9" of a rod seal, "33 h9" of a piston seal',
        gt=0,
    )
    housing_diameter: float = key(
        56.30, "inner diameter of the housing D_housing", unit="mm", bounds=SIGNED
    )
    fill: float | None = key(
        None,
        "part of the gland that the free seal fills, for groove_width",
        unit="%",
        bounds="30 to 100, left out = by groove_width",
        ge=30,
        le=100,
    )
    groove_width: float = key(3.74, "axial width of the groove", unit="mm", gt=0)
    groove_centre: float = key(
        0.0,
        "axial position of the middle of the groove, section centre = 0",
        unit="mm",
        bounds="such that the section is between the walls",
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
    housing_friction: float = key(
        0.0,
        "coefficient of Coulomb friction at the housing and the walls of the groove",
        bounds="0 to 1; 0 = frictionless, the section is held",
        ge=0,
        le=1,
    )

    @property
    def piston(self) -> bool:
        """True if the seal sits in a piston and slides on a bore.

        Its diameters are counted negative then. With r = -radius a piston seal is a rod seal: what
        slides is below it, what holds it above.
        """
        return self.rod_diameter < 0.0

    def called(self, key: str) -> str:
        """The key that a user of this seal knows: of a piston seal its bore and its groove."""
        return OF_PISTON.get(key, key) if self.piston else key

    @property
    def ring_diameter(self) -> float:
        """Inside diameter of the free seal, mm."""
        outside = self.inner_diameter + 2.0 * self.section_diameter
        return -outside if self.piston else self.inner_diameter

    @property
    def depth(self) -> float:
        """Radial depth of the gland, from rod or bore to its ground, mm."""
        return 0.5 * (self.housing_diameter - self.rod_diameter)

    @property
    def squeeze_percent(self) -> float:
        """Part of the free section that the gland takes away, %."""
        return squeeze(self.section_diameter, self.depth)

    @property
    def stretch_percent(self) -> float:
        """Circumferential stretch of the free ring on its rod, or on the ground of the groove of
        its piston, %; 0 if it is loose.
        """
        on = -self.housing_diameter if self.piston else self.rod_diameter
        return 100.0 * max(on / self.ring_diameter - 1.0, 0.0)

    @property
    def fill_percent(self) -> float:
        """Volume of the free ring over that of the gland, %."""
        around = 0.25 * pi * (self.housing_diameter**2 - self.rod_diameter**2)
        return 100.0 * self.volume / (around * self.groove_width)

    @property
    def sealed_wall(self) -> float:
        """Axial place of the groove's wall on the sealed side, mm."""
        return self.groove_centre - 0.5 * self.groove_width

    @property
    def air_wall(self) -> float:
        """Axial place of the groove's wall on the air side, mm."""
        return self.groove_centre + 0.5 * self.groove_width

    @property
    def rubs(self) -> bool:
        """True if housing and walls have friction, which then holds the section by itself."""
        return self.housing_friction > 0.0

    @property
    def opens(self) -> bool:
        """True if there is a gap between rod and housing on the air side."""
        return self.extrusion_gap > 0.0

    @field_validator("inner_diameter", "rod_diameter", "housing_diameter")
    @classmethod
    def _diameter_is_not_zero(cls, diameter: float) -> float:
        if diameter == 0.0:
            raise ValueError("a diameter is not 0")
        return diameter
