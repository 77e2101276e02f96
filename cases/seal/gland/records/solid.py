"""The solid of a seal: its section, the mesh of it, and its materials."""

import numpy as np

from softehl.cases.harness.parameters import key
from softehl.cases.seal.gland.records.discretisation import Discretisation
from softehl.cases.seal.gland.records.free_seal import FreeSeal
from softehl.cases.seal.gland.rubbers.regions import MATERIALS, Region
from softehl.cases.seal.gland.rubbers.rubber_keys import Rubber
from softehl.runtime.mesh.parted_mesh import CAP


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

    def rubber(self, region: str) -> Rubber:
        """Rubber of a region of the section; "" names the section itself."""
        return self.materials[region] if region else self
