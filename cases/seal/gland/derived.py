"""Measures of a gland that follow from its dimensions, and the dimension that each decides."""

from __future__ import annotations

from softehl.cases.seal.gland import catalogue
from softehl.cases.seal.gland.parameters import Seal

BASES = {
    "groove_depth": "housing_diameter",
    "squeeze": "housing_diameter",
    "fill": "groove_width",
}
"""Measure -> the key that it decides, all others held."""


def derived(p: Seal, name: str) -> float:
    """A measure of the gland of a case: mm or %."""
    depth = 0.5 * (p.housing_diameter - p.rod_diameter)
    if name == "groove_depth":
        return depth
    if name == "squeeze":
        return catalogue.squeeze(p.section_diameter, depth)
    return catalogue.fill(p.free_ring, p.rod_diameter, p.housing_diameter, p.groove_width)
