"""The layout of a disc: the O-grid of the paper, graded along its arc and in its depth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from math import inf, pi

import numpy as np

from softehl.cases.seal.section.layout import Layout, dam_nodes, moved_dams
from softehl.runtime.arrays import Array
from softehl.runtime.mesh.sections import LAYERS, SHORT, Disc, SectionMesh, disc_mesh
from softehl.runtime.mesh.spacing import Spacing

_DENSITY = 2  # for which the sizes are chosen; other densities divide or join its segments

_SIDES = 35.0  # degrees that the side blocks need at least: with 25 their upper corners fold

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

    def held(self, mesh: SectionMesh, rod: Array, housing: Array, p_s: float) -> RoundLayout:
        """See `Layout`: by its lowest point and its crown as long as these do."""
        nodes = dam_nodes(self, mesh, rod, housing, p_s)
        return replace(
            self, dams=moved_dams(self.dams, nodes, self._angles(mesh.points[mesh.boundary]))
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


def _closest(angles: Array, angle: float) -> int:
    """Index of that of several angles which is closest to another one, degrees."""
    return int(np.argmin(np.abs((angles - angle + 180.0) % 360.0 - 180.0)))
