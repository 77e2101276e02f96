"""Parts of a vector of unknowns of a seal."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from softehl.cases.seal.equations.system import (
    AXIAL,
    BORE,
    DISPLACEMENT,
    FIELDS,
    FILM,
    PRESSURE,
    ROD,
    ROTATION,
    SHEAR,
    WALLS,
    Field,
    Place,
)
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.meshing.section_mesh import SectionMesh
from softehl.cases.seal.section.section import SealSection
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.contact.rigid_obstacles import tributary_areas
from softehl.runtime.discretisation.dofmap import DofLayout, Numbering


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
        return self._ends(PRESSURE)

    def contact_fields(self) -> tuple[Field, ...]:
        """The fields that contact knows: film pressures are all zero in it."""
        return tuple(field for field in self._fields if field.on != "film")

    def film_fields(self) -> tuple[Field, ...]:
        """The fields that the film alone has."""
        return tuple(field for field in self._fields if field.on == "film")

    @property
    def _fields(self) -> tuple[Field, ...]:
        return tuple(field for field in FIELDS if field.name in self.layout.names)

    def _ends(self, field: str) -> Integers:
        return self.layout.dofs(field)[[0, -1]]
