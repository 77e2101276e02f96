"""The O-ring: a circle."""

from __future__ import annotations

from softehl.cases.seal.gland.sections.base import Section
from softehl.cases.seal.meshing.outline import Outline


class Round(Section):
    """A circle of the section's height."""

    def drawn(self) -> Outline:
        """About the origin."""
        return Outline.circle((0.0, 0.0), 0.5 * self.height)
