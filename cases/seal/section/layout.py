"""Layout of the mesh of a section: everything that knows the shape of a seal.

Whatever comes behind asks a `Layout` for its mesh and for where the sealed pressure ends. Before
the contact is known its arc has equal segments (`uniform_layout`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from math import inf, pi, radians

import numpy as np

from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.sections.section_files import finer
from softehl.cases.seal.meshing.outline import Shape, gentle
from softehl.cases.seal.meshing.section_mesh import SectionMesh
from softehl.cases.seal.meshing.section_mesher import Sizes, section_mesh
from softehl.cases.seal.meshing.spacing import Spacing, Spot, graded
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.postprocessing import run_around

_LEVEL, _LOOKED_AT = 1e-6, 4001
"""Part of the height that two lobes as low may differ by, and places of a film that are compared.
These find the lobes of an X-ring to be as low within 4e-8, 1001 within 4e-7; at 1e-8 the pressure
ends at the other lobe, and h* is 1.2 % off."""

RATE = 0.3
"""Growth of the segments with the distance from what they resolve."""

EDGE_ANGLES = range(27, 70, 3)
"""Places where a section may meet the edge of the gap under pressure, degrees from the bottom:
every 6 degrees, or from 15 to 81, change h* and friction of an O-ring by 0.003 and 0.14 %."""

LONG_PLACED = 33
"""Segments at density 1 of an arc that the contact has placed: 27 or 42 change h* of an O-ring by
0.03 %."""

LONG_OPEN = 42
"""Segments where the edge of an open gap is to be resolved too: 33 or 54 change h* and friction of
an O-ring by 0.03 and 0.07 %."""

BEYOND = 0.3
"""Length beyond a film as drawn in which contact is looked for on the air side, in heights of a
section. Without it one film of thirty, of five sections at 2 to 12 MPa, is not found: the instroke
of a trapezoid at 12 MPa."""


@dataclass(frozen=True)
class Layout:
    """A section in its reference configuration and how a mesh is laid into it; lengths in mm.

    film: ends (s0, s1) of the lubricated part of the outline, the arc. pressure_boundaries: places
    on the outline at which the sealed pressure ends on the rod and on the housing; None: where the
    shape has them. base: the mesh of a file at density 1, every element of which the density
    divides.
    """

    shape: Shape
    film: tuple[float, float]
    sizes: Sizes
    pressure_boundaries: tuple[float | None, float | None] = (None, None)
    base: SectionMesh | None = None

    @property
    def long(self) -> int:
        """Segments of the arc at density 1."""
        return self.sizes.long

    @property
    def flat(self) -> bool:
        """True if a contact may have flats, at whose corners pressure peaks."""
        return self.shape.outline.disc is None

    @property
    def contour(self) -> Array:
        """Points (n, 2) in (z, r) of its boundary, for pictures."""
        outline = self.shape.outline
        even = np.linspace(0.0, outline.length, 721)
        return outline.at(np.unique(np.concatenate([even, outline.starts])))

    def mesh(self, density: int | Fraction) -> SectionMesh:
        """The mesh of a density."""
        if self.base is not None:
            return finer(self.base, int(density))
        return section_mesh(self.shape, self.film, self.sizes, density)

    def pressed(self, mesh: SectionMesh) -> int:
        """The first outer segment that the sealed pressure acts on, which it does up to the arc."""
        begin, crown = mesh.positions[0], self.pressure_boundaries[1]
        crown = self.shape.pressure[0] if crown is None else crown
        crown = begin + (crown - begin) % mesh.length
        return int(np.argmin(np.abs(mesh.positions[mesh.arc :] - crown)))

    def lowest(self, mesh: SectionMesh) -> int:
        """The arc node at which the sealed pressure of the contact ends.

        That at the middle of a flat, at the last of two lobes: a film fills the groove. Of the
        outline, not of the mesh: nodes stand elsewhere on each of two lobes, so that one mesh would
        have the pressure in the groove and the next one not.
        """
        position = self.pressure_boundaries[0]
        position = self._last_lobe if position is None else position
        return int(np.argmin(np.abs(mesh.arc_places - (position - self.film[0]))))

    @cached_property
    def _last_lobe(self) -> float:
        """Place of the last of the lowest points of the film, the middle of a flat."""
        positions, (_, low, _, high) = np.linspace(*self.film, _LOOKED_AT), self.shape.outline.box
        r = self.shape.outline.at(positions)[:, 1]
        level = np.flatnonzero(r <= r.min() + _LEVEL * (high - low))
        flat = np.split(level, np.flatnonzero(np.diff(level) > 1) + 1)[-1]
        return float(positions[flat[len(flat) // 2]])

    def with_sealed_ends(self, mesh: SectionMesh, rod: Array, housing: Array, p_s: float) -> Layout:
        """Layout whose sealed pressure ends where contact holds it back.

        rod, housing: pressures in excess of it, (arc nodes,) and (outer nodes,) of this mesh, MPa.
        """
        last = len(housing) - 1  # the pressure comes from there, round the sealed side
        lip = pressure_boundary(rod, self.lowest(mesh), p_s)
        crown = pressure_boundary(housing[::-1], last - self.pressed(mesh), p_s)
        on_rod, on_housing = self.pressure_boundaries
        if lip is not None:
            on_rod = float(mesh.positions[lip])
        if crown is not None:
            on_housing = float(mesh.positions[(mesh.arc + last - crown) % len(mesh.boundary)])
        return replace(self, pressure_boundaries=(on_rod, on_housing))

    def between(self, old: Layout, arc_bounds: tuple[float, float]) -> Layout:
        """Layout with the pressure boundaries of another one, and its arc between these places on
        the arc of that one, unless its mesh is that of a file.
        """
        begin, end = (old.film[0] + position for position in arc_bounds)
        film = (begin, end) if self.base is None else self.film
        return replace(self, film=film, pressure_boundaries=old.pressure_boundaries)

    def graded(self, spacing: Spacing, long: int, depth: float = inf, first: float = inf) -> Layout:
        """With these segments on the arc; see `Sizes` for the others."""
        return replace(self, sizes=Sizes(long, spacing, depth, first))


def pressure_boundary(excess: Array, index: int, p_s: float) -> int | None:
    """Place where contact holds back a pressure taken to act up to an index, None if just there.

    excess: (n,) of contact over the pressure, which is p_s up to there and zero beyond. Contact of
    less than p_s does not hold it back: it goes on, at most to where contact presses most.
    """
    touching = excess > 0.0
    if not touching.any() or (touching[index] and excess[min(index + 1, len(excess) - 1)] >= p_s):
        return None
    nodes = np.flatnonzero(touching)
    run = run_around(touching, int(nodes[np.argmin(np.abs(nodes - index))]))
    total = excess + np.where(np.arange(len(excess)) <= index, p_s, 0.0)
    return int(run.start + np.argmax(total[run]))


def uniform_layout(p: Seal) -> Layout:
    """The section of a case with equal segments on its arc, the given one or a wide guide."""
    shape = p.free_section
    if p.mesh == "file":
        return Layout(shape, shape.film, Sizes(p.file_mesh.arc), base=p.file_mesh)
    if p.given_arc:
        start, end = (radians(angle) * 0.5 * p.section_diameter for angle in p.given_arc)
        return Layout(shape, (start, end), Sizes())
    if p.opens:
        return Layout(shape, shape.film, Sizes(LONG_OPEN, _fine_at_edge(shape)))
    # under pressure a section rolls; without, both its sides are to be alike
    rolls = shape.outline.disc is None and p.sealed_pressure > 0.0
    film = _reaching(shape, BEYOND * p.section_diameter if rolls else 0.0)
    return Layout(shape, film, Sizes(p.lobes * LONG_PLACED))


def _reaching(shape: Shape, extension: float) -> tuple[float, float]:
    """The film (s0, s1) of a shape and as much as `extension`, mm, of what faces the rod behind it.

    The sealed pressure rolls it onto the rod. A cap ends it too.
    """
    begin, end = shape.film
    length = shape.outline.length
    _, steep = gentle(shape.outline, 0.5 * pi)
    last = (steep - begin) % length if shape.chord is None else (shape.chord[1] - begin) % length
    film = (end - begin) % length
    return begin, begin + min(max(film, last), film + extension)


def _fine_at_edge(shape: Shape) -> Spacing:
    """Of the film of a disc: fine where it may meet the edge of an open gap, wherever that is."""
    begin, end = shape.film
    degree = radians(0.5) * (shape.outline.box[2] - shape.outline.box[0])
    spots = [Spot(angle * degree - begin) for angle in EDGE_ANGLES]
    length = end - begin
    return graded(length, spots, 2 * LONG_OPEN, coarsest=0.05 * length, rate=RATE)
