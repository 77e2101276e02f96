"""The seal before it is fitted: its section, its diameters, its mesh and its materials."""

from math import pi
from pathlib import Path

import numpy as np

from softehl.cases.harness.parameters import key
from softehl.cases.seal.gland.records.discretisation import Discretisation
from softehl.cases.seal.gland.rubbers.regions import MATERIALS, Region
from softehl.cases.seal.gland.rubbers.rubber_keys import Rubber
from softehl.cases.seal.gland.sections import SECTIONS
from softehl.cases.seal.gland.sections.base import HEIGHT
from softehl.cases.seal.gland.sections.keys import (
    MEASURES,
    ROUND,
    SectionKeys,
    capped,
    dimensions,
    lobes,
    section_of_file,
    shape_of,
)
from softehl.cases.seal.meshing.outline import Shape
from softehl.cases.seal.meshing.section_mesh import SectionMesh
from softehl.cases.seal.meshing.two_region_mesh import CAP

SIGNED = "other than 0; of a piston seal negative: give bore"


class FreeSeal(SectionKeys):
    """The seal before it is fitted; its lengths are in mm."""

    ring: str | None = key(
        None,
        "a ring by its name, for inner_diameter and section_diameter",
        bounds='"AS568-226", "36x4", "ISO 3601 50.4x3.55", "X-ring 36x4", "U-cup 25x35x8", left '
        "out = by its diameters (docs/trade.md)",
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
        known = dimensions(self.section)
        given = {name: size for name in MEASURES if (size := getattr(self, name)) is not None}
        for name in given:
            if name not in known:
                has = ", ".join(known) or "section_diameter alone"
                raise ValueError(f'{name} is no dimension of section = "{self.section}": {has}')
        return {"height": self.section_diameter, **{known[n]: size for n, size in given.items()}}

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
        return {name: getattr(page, own) for name, own in dimensions(self.section).items()}

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
    def surface_modulus(self) -> float:
        """Shear modulus of what the film is on [MPa]."""
        under = self._surface if self.mesh == "file" else CAP
        return self.rubber(under if under in self.materials else "").shear_modulus

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
        own = set[int]().union(*(mesh.regions[name].tolist() for name in self.materials))
        return len(own) < len(mesh.quads)

    def load_ratio(self, pressure: float) -> float:
        """A pressure (MPa) over the shear modulus of the softest part of the section."""
        parts = [*([""] if self.has_body else []), *self.materials]
        return pressure / min(self.rubber(part).shear_modulus for part in parts)

    def rubber(self, region: str) -> Rubber:
        """Rubber of a region of the section; "" names the section itself."""
        return self.materials[region] if region else self
