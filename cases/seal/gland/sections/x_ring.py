"""The X-ring (quad ring): four lobes, joined by concave fillets."""

from __future__ import annotations

from math import hypot, sqrt

from softehl.cases.seal.gland.sections.base import Section, joined, part, require
from softehl.runtime.mesh.outline import Arc, Outline, Point

_ROUND = 1e-9  # part of the radius at which four lobes are one circle


class XRing(Section):
    """Four circles in the corners of a box; a circle that touches two of them joins them."""

    width: float = part(1.0, "axial width")
    lobe_radius: float = part(
        0.255, "radius of the four lobes", bounds="> 0 to half the smaller side", gt=0
    )
    fillet_radius: float = part(0.17, "radius of the grooves between the lobes")

    def drawn(self) -> Outline:
        """About the origin; a circle where the lobes have grown together."""
        z, r = self._lobes
        require(
            min(z, r) >= -_ROUND * self.height,
            f"lobe_radius = {self.lobe_radius:g} mm; at most half of the smaller side, "
            f"{0.5 * min(self.width, self.height):g} mm",
        )
        if max(z, r) <= 1e-5 * self.height:
            return Outline.circle((0.0, 0.0), self.lobe_radius)
        reach = self.lobe_radius + self.fillet_radius
        require(
            max(z, r) < reach,
            f"fillet_radius = {self.fillet_radius:g} mm does not reach from lobe to lobe; more "
            f"than {max(z, r) - self.lobe_radius:.4g} mm is needed",
        )
        deep = (sqrt(reach**2 - r**2) - z, sqrt(reach**2 - z**2) - r)
        require(
            hypot(z + max(deep[0], 0.0), r + max(deep[1], 0.0)) > 0.0
            and self._waist(deep) > 0.1 * self.height,
            f"lobe_radius = {self.lobe_radius:g} and fillet_radius = {self.fillet_radius:g} mm "
            "leave no rubber between the grooves; make one of them larger",
        )
        return joined(*self._arcs(z, r, reach))

    def crown(self, drawn: Outline) -> Point:
        """The crest of the upper lobe on the sealed side."""
        return -self._lobes[0], drawn.box[3]

    @property
    def _lobes(self) -> Point:
        """Distance of the centres of the lobes from the middle, axially and radially."""
        z, r = 0.5 * self.width - self.lobe_radius, 0.5 * self.height - self.lobe_radius
        return z, r

    def _waist(self, deep: Point) -> float:
        """The least thickness between opposite grooves."""
        z, r = self._lobes
        across = 2.0 * (z + deep[0] + z - self.fillet_radius)
        along = 2.0 * (r + deep[1] + r - self.fillet_radius)
        return min(across, along)

    def _arcs(self, z: float, r: float, reach: float) -> list[Arc]:
        """From the groove at the bottom on, counterclockwise: lobe, groove, ..."""
        under, beside = sqrt(reach**2 - z**2), sqrt(reach**2 - r**2)
        lobes = [(z, -r), (z, r), (-z, r), (-z, -r)]
        grooves = [(0.0, -r - under), (z + beside, 0.0), (0.0, r + under), (-z - beside, 0.0)]
        part = self.lobe_radius / reach

        def touch(lobe: Point, groove: Point) -> Point:
            return (
                lobe[0] + part * (groove[0] - lobe[0]),
                lobe[1] + part * (groove[1] - lobe[1]),
            )

        arcs = []
        for k, lobe in enumerate(lobes):
            before, after = grooves[k], grooves[(k + 1) % 4]
            start, end = touch(lobe, before), touch(lobe, after)
            arcs += [Arc(start, end, lobe)]
            arcs += [Arc(end, touch(lobes[(k + 1) % 4], after), after, ccw=False)]
        return arcs
