"""The square ring: a rectangle with round corners."""

from __future__ import annotations

from softehl.cases.seal.gland.sections.base import Section, part
from softehl.cases.seal.meshing.outline import Outline, rounded


class Rectangular(Section):
    """A rectangle, its four corners rounded alike."""

    width: float = part(1.0, "axial width")
    corner_radius: float = part(
        0.12, "radius of the four corners", bounds="0 to half the smaller side", ge=0
    )

    def drawn(self) -> Outline:
        """About the origin."""
        z, r = 0.5 * self.width, 0.5 * self.height
        self.at_most("corner_radius", min(z, r), "half of the smaller side")
        return Outline(rounded([(-z, -r), (z, -r), (z, r), (-z, r)], self.corner_radius))
