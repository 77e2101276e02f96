"""The layout of a section of any outline, or of the mesh of a file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from math import inf

import numpy as np

from softehl.cases.seal.gland.parameters import ORing
from softehl.cases.seal.gland.sections.files import finer as divided
from softehl.cases.seal.section.layout import Layout, dam_nodes, moved_dams
from softehl.runtime.arrays import Array
from softehl.runtime.mesh.outline import Shape
from softehl.runtime.mesh.outline_mesh import outline_mesh
from softehl.runtime.mesh.parted_mesh import parted_mesh
from softehl.runtime.mesh.sections import SectionMesh
from softehl.runtime.mesh.spacing import Spacing

_LEVEL, _LOOKED_AT = 1e-6, 4001  # of the height: what is level; places of a film that are compared


@dataclass(frozen=True)
class OutlineLayout:
    """A section of any outline.

    film: ends (s0, s1) of the lubricated part of the outline, mm. dams: places on it at which the
    sealed pressure ends on the rod and on the housing, mm; None: where the shape has them.
    """

    shape: Shape
    film: tuple[float, float]
    spacing: Spacing | None
    long: int
    dams: tuple[float | None, float | None] = (None, None)

    @property
    def flat(self) -> bool:
        """See `Layout`."""
        return True

    @property
    def contour(self) -> Array:
        """See `Layout`."""
        outline = self.shape.outline
        even = np.linspace(0.0, outline.length, 721)
        return outline.at(np.unique(np.concatenate([even, outline.starts])))

    def mesh(self, density: int | Fraction) -> SectionMesh:
        """See `Layout`."""
        mesh = parted_mesh if self.shape.chord else outline_mesh
        return mesh(self.shape, self.film, self.spacing, self.long, density)

    def pressed(self, mesh: SectionMesh) -> int:
        """See `Layout`: from the node nearest to where the housing ends the pressure."""
        begin, crown = mesh.places[0], self.dams[1]
        crown = self.shape.pressure[0] if crown is None else crown
        crown = begin + (crown - begin) % mesh.length
        return int(np.argmin(np.abs(mesh.places[mesh.arc :] - crown)))

    def lowest(self, mesh: SectionMesh) -> int:
        """See `Layout`: the middle of a flat, the last of two lobes: a film fills the groove.

        Of the outline, not of the mesh: nodes stand elsewhere on each of two lobes, so that one
        mesh would have the pressure in the groove and the next one not.
        """
        place = self.dams[0]
        return self._node(mesh, self._lobes(mesh)[-1] if place is None else place)

    def _node(self, mesh: SectionMesh, place: float) -> int:
        """The arc node nearest to a place, mm."""
        return int(np.argmin(np.abs(mesh.arc_places - (place - self.film[0]))))

    def _lobes(self, mesh: SectionMesh) -> list[float]:
        """Places (mm) of the lowest points of the film, each the middle of a flat."""
        places = np.linspace(*self.film, _LOOKED_AT)
        r = self.shape.outline.at(places)[:, 1]
        level = np.flatnonzero(r <= r.min() + _LEVEL * float(np.ptp(mesh.points[:, 1])))
        flats = np.split(level, np.flatnonzero(np.diff(level) > 1) + 1)
        return [float(places[flat[len(flat) // 2]]) for flat in flats]

    def held(self, mesh: SectionMesh, rod: Array, housing: Array, p_s: float) -> OutlineLayout:
        """See `Layout`: lips turn, and lie elsewhere than they were made to."""
        nodes = dam_nodes(self, mesh, rod, housing, p_s)
        return replace(self, dams=moved_dams(self.dams, nodes, mesh.places))

    def bounds(self, old: Layout) -> tuple[float, float]:
        """See `Layout`: the other arc itself, as what lies beyond may be a corner or a wall."""
        assert isinstance(old, OutlineLayout)
        return 0.0, old.film[1] - old.film[0]

    def between(self, old: Layout, ends: tuple[float, float]) -> OutlineLayout:
        """See `Layout`."""
        assert isinstance(old, OutlineLayout)
        begin, end = (old.film[0] + place for place in ends)
        return replace(self, film=(begin, end), dams=old.dams)

    def graded(
        self, spacing: Spacing, long: int, depth: float = inf, first: float | None = None
    ) -> OutlineLayout:
        """See `Layout`; the depth of its elements follows from its segments."""
        return replace(self, spacing=spacing, long=long)


@dataclass(frozen=True)
class FileLayout(OutlineLayout):
    """The mesh of a file as it is, every element divided by the density; its film is where it is.

    base: the mesh of density 1.
    """

    base: SectionMesh | None = None

    @classmethod
    def of(cls, p: ORing) -> FileLayout:
        """Of a case whose mesh is one of a file."""
        shape, base = p.free_section, p.file_mesh
        return cls(shape, shape.film, None, base.arc, base=base)

    def mesh(self, density: int | Fraction) -> SectionMesh:
        """See `Layout`."""
        assert self.base is not None
        return divided(self.base, int(density))

    def between(self, old: Layout, ends: tuple[float, float]) -> FileLayout:
        """See `Layout`: with what it knows of the ends of the pressure."""
        assert isinstance(old, FileLayout)
        return replace(self, dams=old.dams)
