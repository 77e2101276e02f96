"""How the mesh of a section is laid out: everything that knows the shape of a seal.

`RoundLayout` is the O-grid of the paper in a disc. Whatever comes behind asks a `Layout` for its
mesh and for where the sealed pressure ends.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from math import inf, pi, radians
from typing import Protocol

import numpy as np

from softehl.cases.seal.parameters import ORing
from softehl.cases.seal.sections.files import finer as divided
from softehl.runtime.arrays import Array
from softehl.runtime.fem.postprocess import run_around
from softehl.runtime.mesh.outline import Shape, gentle
from softehl.runtime.mesh.outline_mesh import outline_mesh
from softehl.runtime.mesh.parted_mesh import parted_mesh
from softehl.runtime.mesh.sections import LAYERS, SHORT, Disc, SectionMesh, disc_mesh
from softehl.runtime.mesh.spacing import Spacing, Spot, graded

_LEVEL, _LOOKED_AT = 1e-6, 4001  # of the height: what is level; places of a film that are compared
_DENSITY = 2  # for which the sizes are chosen; other densities divide or join its segments


class Layout(Protocol):
    """A section in its reference configuration and how a mesh is laid into it; lengths in mm."""

    @property
    def long(self) -> int:
        """Segments of the arc at density 1."""

    @property
    def spacing(self) -> Spacing | None:
        """That of the nodes along the arc, None where they are equally spaced."""

    @property
    def flat(self) -> bool:
        """Whether a contact may have flats, at whose corners pressure peaks."""

    @property
    def contour(self) -> Array:
        """Points (n, 2) in (z, r) of its boundary, for pictures."""

    def mesh(self, density: int | Fraction) -> SectionMesh:
        """The mesh of a density."""

    def lowest(self, mesh: SectionMesh) -> int:
        """The arc node at which the sealed pressure of the contact ends: that nearest to the rod,
        or where the section was seen to touch it.
        """

    def before_groove(self, mesh: SectionMesh) -> int:
        """The arc node on the first of two lobes; that of `lowest` where there is no groove."""

    def pressed(self, mesh: SectionMesh) -> int:
        """The first outer segment that the sealed pressure acts on, which it does up to the arc."""

    def held(self, mesh: SectionMesh, rod: Array, housing: Array, p_s: float) -> Layout:
        """The same with the sealed pressure ending where contact holds it back.

        rod, housing: pressures in excess of it, (arc nodes,) and (outer nodes,) of this mesh, MPa.
        """

    def bounds(self, old: Layout) -> tuple[float, float]:
        """Places (mm) on the arc of another one between which parts of this one's lie."""

    def between(self, old: Layout, ends: tuple[float, float]) -> Layout:
        """The same laid out on an arc whose ends are at these places of that of another one."""

    def graded(
        self, spacing: Spacing, long: int, depth: float = inf, first: float | None = None
    ) -> Layout:
        """With these segments on the arc.

        depth: that elements on the arc are to have at most, mm, as far as their number allows.
        first: size of the segment beyond the air end of the arc, mm.
        """


GUIDE_ARC, GUIDE_TOP = 75.0, 118.0
"""Half the angle of the arc on which contact is first looked for, and where the top begins."""

EDGE_ANGLES = range(27, 70, 3)
"""Where a section meets the edge of the gap under pressure, degrees from the bottom."""

LONG_OPEN = 42
"""The same where the edge of an open gap is to be resolved too."""

LONG_PLACED = 33
"""Segments at density 1 of an arc that the contact has placed."""

BEYOND = 0.3
"""How far beyond a film as drawn contact is looked for on the air side, in heights of a section."""

_SIDES = 25.0  # degrees that the side blocks need at least
_CORNERS, _TOP, _LAYER_GROWTH, _ROW_GROWTH = (0.965, 0.62), 90.0, 20.0, 5.0


MOST_LAYERS, STEEPEST_GROWTH = 6, 2.0
"""Layers at density 1, and the largest ratio of one to the one outside of it at density 2."""


@dataclass(frozen=True)
class RoundLayout:
    """A disc under an O-grid.

    dams: angles from the bottom at which the sealed pressure ends on the rod and on the housing,
    degrees, counterclockwise; None: at the lowest point, at the crown.
    """

    disc: Disc
    dams: tuple[float | None, float | None] = (None, None)

    @property
    def long(self) -> int:
        """See `Layout`."""
        return self.disc.long

    @property
    def spacing(self) -> Spacing | None:
        """See `Layout`."""
        return self.disc.spacing

    @property
    def flat(self) -> bool:
        """See `Layout`."""
        return False

    @property
    def contour(self) -> Array:
        """See `Layout`."""
        angles = np.linspace(0.0, 2.0 * pi, 181)
        return np.asarray(self.disc.centre + self.disc.radius * self.disc.direction(angles))

    def mesh(self, density: int | Fraction) -> SectionMesh:
        """See `Layout`."""
        return disc_mesh(self.disc, density)

    def lowest(self, mesh: SectionMesh) -> int:
        """See `Layout`."""
        if self.dams[0] is not None:
            return _closest(self._angles(mesh.points[mesh.arc_nodes]), self.dams[0])
        return int(np.argmin(mesh.points[mesh.arc_nodes, 1]))

    def before_groove(self, mesh: SectionMesh) -> int:
        """See `Layout`."""
        return self.lowest(mesh)

    def held(self, mesh: SectionMesh, rod: Array, housing: Array, p_s: float) -> RoundLayout:
        """See `Layout`: by its lowest point and its crown as long as these do."""
        nodes = _dam_nodes(self, mesh, rod, housing, p_s)
        return replace(
            self, dams=_moved(self.dams, nodes, self._angles(mesh.points[mesh.boundary]))
        )

    def pressed(self, mesh: SectionMesh) -> int:
        """See `Layout`: from the crown on."""
        if self.dams[1] is not None:
            return _closest(self._angles(mesh.points[mesh.outer_nodes[:-1]]), self.dams[1])
        middle = mesh.points[mesh.outer_segments].mean(axis=1)
        return int(np.flatnonzero(middle[:, 0] < 0.0)[0])

    def _angles(self, points: Array) -> Array:
        """Of points (..., 2) on its circle from the bottom, degrees in (-180, 180]."""
        z, r = np.moveaxis(points - self.disc.centre, -1, 0)
        return np.asarray(np.degrees(np.arctan2(z, -r)))

    def bounds(self, old: Layout) -> tuple[float, float]:
        """See `Layout`."""
        assert isinstance(old, RoundLayout)
        angles, begin = (self.disc.arc_start, self.disc.arc_end), old.disc.arc_start
        first, last = (old.disc.radius * float(np.radians(a - begin)) for a in angles)
        return first, last

    def between(self, old: Layout, ends: tuple[float, float]) -> RoundLayout:
        """See `Layout`."""
        assert isinstance(old, RoundLayout)
        before = old.disc
        start, end = (before.arc_start + float(np.degrees(e / before.radius)) for e in ends)
        disc = replace(self.disc, arc_start=start, arc_end=end)
        return RoundLayout(disc, old.dams)

    def graded(
        self, spacing: Spacing, long: int, depth: float = inf, first: float | None = None
    ) -> RoundLayout:
        """See `Layout`."""
        start, end = self.disc.arc_start, self.disc.arc_end
        growth, top = _ROW_GROWTH, max(_TOP, end + _SIDES, _SIDES - start)
        if first is not None:
            side = self.disc.radius * np.radians(top - end)
            growth = _growth_to(first / side, SHORT * _DENSITY, _ROW_GROWTH)
        layers, layer_growth = _layers(depth / self._deepest)
        disc = replace(
            self.disc,
            spacing=spacing,
            long=long,
            top=top,
            corner_radius=_CORNERS,
            layers=layers,
            layer_growth=layer_growth,
            row_growth=growth,
        )
        return RoundLayout(disc, self.dams)

    @property
    def _deepest(self) -> float:
        """Depth of all layers below the middle of the arc, mm: they are least deep at its ends."""
        bulge, half = self.disc.bulge[0], 0.5 * (self.disc.arc_end - self.disc.arc_start)
        inner = _CORNERS[0] * (bulge + (1.0 - bulge) * np.cos(np.radians(half)))
        return float((1.0 - inner) * self.disc.radius)


def _layers(first: float) -> tuple[int, float]:
    """How many layers there are at density 1, and their growth; the first is this part of all."""
    for layers in range(LAYERS, MOST_LAYERS + 1, LAYERS):
        growth = _growth_to(first, layers * _DENSITY, _LAYER_GROWTH)
        if growth <= STEEPEST_GROWTH ** (layers * _DENSITY):
            return layers, growth
    return MOST_LAYERS, STEEPEST_GROWTH ** (MOST_LAYERS * _DENSITY)


def _growth_to(first: float, count: int, least: float) -> float:
    """Ratio of the last to the first of `count` parts of a line, the first of them this part."""
    growth = least
    while np.expm1(np.log(growth) / count) / (growth - 1.0) > first:
        growth *= 1.1
    return growth


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

    def before_groove(self, mesh: SectionMesh) -> int:
        """See `Layout`: as `lowest`, of the first lobe."""
        return min(self._node(mesh, self._lobes(mesh)[0]), self.lowest(mesh))

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
        nodes = _dam_nodes(self, mesh, rod, housing, p_s)
        return replace(self, dams=_moved(self.dams, nodes, mesh.places))

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


def _closest(angles: Array, angle: float) -> int:
    """Index of that of several angles which is closest to another one, degrees."""
    return int(np.argmin(np.abs((angles - angle + 180.0) % 360.0 - 180.0)))


def _dam_nodes(
    layout: Layout, mesh: SectionMesh, rod: Array, housing: Array, p_s: float
) -> tuple[int | None, int | None]:
    """Numbers along the boundary of the nodes that `Layout.held` moves the pressure's ends to.

    Of that on the rod and that on the housing; None where it stays.
    """
    last = len(housing) - 1  # the pressure comes from there, round the sealed side
    lip = dam(rod, layout.lowest(mesh), p_s)
    crown = dam(housing[::-1], last - layout.pressed(mesh), p_s)
    return lip, None if crown is None else (mesh.arc + last - crown) % len(mesh.boundary)


def _moved(
    dams: tuple[float | None, float | None], nodes: tuple[int | None, int | None], at: Array
) -> tuple[float | None, float | None]:
    """The dams at these nodes of the boundary, None: as before.  at: (boundary nodes,)."""
    lip, crown = (
        old if node is None else float(at[node]) for old, node in zip(dams, nodes, strict=True)
    )
    return lip, crown


def dam(excess: Array, index: int, p_s: float) -> int | None:
    """Where contact holds back a pressure that is taken to act up to an index, None if just there.

    excess: (n,) of contact over the pressure, which is p_s up to there and zero beyond. Where less
    than p_s holds it back it goes on, at most to where contact presses most.
    """
    touching = excess > 0.0
    if not touching.any() or (touching[index] and excess[min(index + 1, len(excess) - 1)] >= p_s):
        return None
    nodes = np.flatnonzero(touching)
    run = run_around(touching, int(nodes[np.argmin(np.abs(nodes - index))]))
    total = excess + np.where(np.arange(len(excess)) <= index, p_s, 0.0)
    return int(run.start + np.argmax(total[run]))


def uniform_layout(p: ORing) -> Layout:
    """The section of a case with equal segments on its arc, the given one or a wide guide."""
    if p.mesh == "file":
        return FileLayout.of(p)
    if not p.round:
        shape = p.free_section
        rolls = p.sealed_pressure > 0.0  # else both sides are to be alike
        film = _reaching(shape, BEYOND * p.section_diameter if rolls else 0.0)
        return OutlineLayout(shape, film, None, p.lobes * LONG_PLACED)
    radius = 0.5 * p.section_diameter
    centre = 0.0, 0.5 * p.inner_diameter + radius
    if p.given_arc:
        return RoundLayout(Disc(*centre, radius, *p.given_arc))
    long = LONG_OPEN if p.opens else LONG_PLACED
    guide = Disc(*centre, radius, -GUIDE_ARC, GUIDE_ARC, top=GUIDE_TOP, long=long)
    return RoundLayout(replace(guide, spacing=_fine_at_edge(guide)) if p.opens else guide)


def _reaching(shape: Shape, most: float) -> tuple[float, float]:
    """The film (s0, s1) of a shape and as much as `most`, mm, of what faces the rod behind it.

    The sealed pressure rolls it onto the rod. A cap ends it too.
    """
    begin, end = shape.film
    length = shape.outline.length
    _, steep = gentle(shape.outline, 0.5 * pi)
    last = (steep - begin) % length if shape.chord is None else (shape.chord[1] - begin) % length
    film = (end - begin) % length
    return begin, begin + min(max(film, last), film + most)


def _fine_at_edge(guide: Disc) -> Spacing:
    """Of a guide: fine where the section may meet the edge of an open gap, wherever that is."""
    degree = radians(1.0) * guide.radius
    spots = [Spot((GUIDE_ARC + angle) * degree) for angle in EDGE_ANGLES]
    length = 2.0 * GUIDE_ARC * degree
    return graded(length, spots, 2 * guide.long, coarsest=0.05 * length, rate=0.3)
