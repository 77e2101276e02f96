"""The O-ring: a circle."""

from __future__ import annotations

from softehl.cases.seal.gland.sections.base import Section
from softehl.runtime.mesh.outline import Outline, Point


class Round(Section):
    """A circle of the section's height."""

    def drawn(self) -> Outline:
        """About the origin."""
        return Outline.circle((0.0, 0.0), 0.5 * self.height)

    def crown(self) -> Point:
        """The highest point."""
        return 0.0, 0.5 * self.height
