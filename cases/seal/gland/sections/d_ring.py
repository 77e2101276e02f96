"""The D-ring: a round nose towards the rod, a flat back in the groove."""

from __future__ import annotations

from math import sqrt

from softehl.cases.seal.gland.sections.base import Section, joined, part, require
from softehl.cases.seal.gland.sections.seated import mirrored
from softehl.cases.seal.meshing.outline import Arc, Line, Outline, Piece


class DRing(Section):
    """A flat back and straight sides with round corners, closed by a circular nose."""

    width: float = part(1.0, "axial width")
    nose_radius: float = part(
        0.5, "radius of the nose on the rod", bounds="half the width to ten widths"
    )
    corner_radius: float = part(
        0.1, "radius of the corners", bounds="> 0 to a quarter of the smaller side"
    )

    def drawn(self) -> Outline:
        """The lowest point of the nose at the origin."""
        half, R, f = 0.5 * self.width, self.nose_radius, self.corner_radius
        require(
            half * (1.0 - 1e-9) <= R <= 20.0 * half,
            f"nose_radius = {R:g} mm; half the width to ten widths, {half:g} to {20 * half:g} mm",
        )
        smaller = min(self.width, self.height)
        self.at_most("corner_radius", 0.25 * smaller, "a quarter of the smaller side")
        rise = R - sqrt(max((R - f) ** 2 - (half - f) ** 2, 0.0))  # of the lower corners' centres
        top = self.height - f
        require(
            rise < top,
            f"nose_radius = {R:g} mm takes {rise:.4g} mm of the height; the back leaves "
            f"{top:.4g} mm; make the section higher or narrower",
        )
        part_of_nose = R / (R - f)
        touch = part_of_nose * (half - f), R + part_of_nose * (rise - R)
        low, high = half - f, self.height
        right: list[Piece] = [
            Arc(touch, (half, rise), (low, rise)),
            Line((half, rise), (half, top)),
            Arc((half, top), (low, high), (low, top)),
        ]
        left = [mirrored(piece).reversed() for piece in reversed(right)]
        nose, back = Arc((-touch[0], touch[1]), touch, (0.0, R)), Line((low, high), (-low, high))
        return joined(nose, *right, back, *left)
