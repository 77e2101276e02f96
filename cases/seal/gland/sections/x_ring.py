"""The X-ring (quad ring): four lobes, joined by concave fillets."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

from softehl.cases.seal.gland.sections.base import Section, joined, part, require
from softehl.cases.seal.meshing.outline import Arc, Outline, Point


class XRing(Section):
    """Four circles in the corners of a box; a circle that touches two of them joins them."""

    width: float = part(1.0, "axial width")
    lobe_radius: float = part(
        0.255, "radius of the four lobes", bounds="> 0 to half the smaller side", gt=0
    )
    fillet_radius: float = part(0.17, "radius of the grooves between the lobes")

    def drawn(self) -> Outline:
        """About the origin; a circle where the lobes have grown together."""
        z, r = 0.5 * self.width - self.lobe_radius, 0.5 * self.height - self.lobe_radius
        self.at_most("lobe_radius", 0.5 * min(self.width, self.height), "half of the smaller side")
        if max(z, r) <= 1e-5 * self.height:
            return Outline.circle((0.0, 0.0), self.lobe_radius)
        reach = self.lobe_radius + self.fillet_radius
        require(
            max(z, r) < reach,
            f"fillet_radius = {self.fillet_radius:g} mm does not reach from lobe to lobe; more "
            f"than {max(z, r) - self.lobe_radius:.4g} mm is needed",
        )
        under, beside = sqrt(reach**2 - z**2), sqrt(reach**2 - r**2)
        waist = 2.0 * (min(z + beside, r + under) - self.fillet_radius)
        require(
            waist > 0.1 * self.height,
            f"lobe_radius = {self.lobe_radius:g} and fillet_radius = {self.fillet_radius:g} mm "
            "leave no rubber between the grooves; make one of them larger",
        )
        grooves = [(0.0, -r - under), (z + beside, 0.0), (0.0, r + under), (-z - beside, 0.0)]
        return joined(*self._arcs([(z, -r), (z, r), (-z, r), (-z, -r)], grooves))

    def crown(self, drawn: Outline) -> Point:
        """The crest of the upper lobe on the sealed side."""
        return self.lobe_radius - 0.5 * self.width, drawn.box[3]

    def _arcs(self, lobes: Sequence[Point], grooves: Sequence[Point]) -> list[Arc]:
        """About these centres from the groove at the bottom on, counterclockwise: lobe, groove."""
        part = self.lobe_radius / (self.lobe_radius + self.fillet_radius)

        def touch(lobe: Point, groove: Point) -> Point:
            (a, b), (c, d) = lobe, groove
            return a + part * (c - a), b + part * (d - b)

        arcs = []
        for k, lobe in enumerate(lobes):
            before, after = grooves[k], grooves[(k + 1) % 4]
            start, end = touch(lobe, before), touch(lobe, after)
            arcs += [Arc(start, end, lobe)]
            arcs += [Arc(end, touch(lobes[(k + 1) % 4], after), after, ccw=False)]
        return arcs
