"""Keys by which results have sensitivities."""

from __future__ import annotations

from softehl.cases.seal.gland import shear_thinning
from softehl.cases.seal.gland.rubbers import materials

PRESSURE_KEY = "sealed_pressure"
"""The sealed pressure, which belongs to a film and not to the case alone."""

LENGTHS = (
    *("section_diameter", "inner_diameter", "rod_diameter", "housing_diameter"),
    *("groove_width", "groove_centre", "extrusion_gap", "corner_fillet"),
)
"""Keys of a case that are lengths."""

ROOM = 0.01
"""Share by which each dimension of a section must be free to change for its derivatives."""

NUMBERS = (
    *LENGTHS,
    *(*materials.KEYS, "bulk_modulus"),
    *("viscosity", "pressure_viscosity", "cavitation_penalty", *shear_thinning.NUMBERS),
)
"""Physical and geometric keys of a case; the terms of an Ogden rubber count as one."""

BASES = {
    "groove_depth": ("housing_diameter", "depth"),
    "squeeze": ("housing_diameter", "squeeze_percent"),
    "fill": ("groove_width", "fill_percent"),
}
"""Measure of the gland -> the key that it decides, all others held, and its name in `Gland`."""
