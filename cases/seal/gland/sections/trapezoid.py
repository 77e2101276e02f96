"""The trapezoidal ring: narrow on the rod, wide in the groove."""

from __future__ import annotations

from softehl.cases.seal.gland.sections.base import Section, part
from softehl.cases.seal.meshing.outline import Outline, rounded


class Trapezoid(Section):
    """A symmetric trapezoid with round corners."""

    width: float = part(1.0, "axial width at the housing")
    rod_width: float = part(0.6, "axial width at the rod", bounds="> 0 to twice the width")
    corner_radius: float = part(
        0.1, "radius of the four corners", bounds="0 to a third of the smallest side", ge=0
    )

    def drawn(self) -> Outline:
        """The middle of the lower side at the origin."""
        smallest = min(self.width, self.rod_width, self.height)
        self.at_most("corner_radius", smallest / 3.0, "a third of the smallest side")
        self.at_most("rod_width", 2.0 * self.width, "twice the width")
        a, b, h = 0.5 * self.rod_width, 0.5 * self.width, self.height
        return Outline(rounded([(-a, 0.0), (a, 0.0), (b, h), (-b, h)], self.corner_radius))
