"""Measures of a gland that follow from its dimensions, and the dimension that each decides."""

from __future__ import annotations

from softehl.cases.seal.gland.records.gland import Gland

BASES = {
    "groove_depth": "housing_diameter",
    "squeeze": "housing_diameter",
    "fill": "groove_width",
}
"""Measure -> the key that it decides, all others held."""


def derived(p: Gland, name: str) -> float:
    """A measure of the gland of a case: mm or %."""
    return {"groove_depth": p.depth, "squeeze": p.squeeze_percent, "fill": p.fill_percent}[name]
