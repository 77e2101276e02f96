"""From the names of catalogues to the measures of a case: ring, rod, squeeze and gland.

A ring gives two diameters; the rod, and either the squeeze, the housing or a gland of the
catalogue the rest. What is given twice must agree.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from softehl.cases.seal.gland import catalogue
from softehl.cases.seal.gland.given import number, put

_SAME = 1e-9


def fitted(given: Mapping[str, Any]) -> dict[str, Any]:
    """The keys of a case with those that follow from ring, rod, squeeze and gland filled in.

    Raises ValueError where something is missing or contradicts; values of wrong types pass, to be
    refused with their keys.
    """
    values = dict(given)
    if isinstance(values.get("ring"), int):
        values["ring"] = str(values["ring"])  # "-226" is a number to a reader of TOML
    if number(values.get("rod")):
        _follow(values, "rod_diameter", float(values["rod"]), "rod")
    if isinstance(values.get("ring"), str):
        _with_ring(values)
    if isinstance(values.get("gland"), str) or number(values.get("squeeze")):
        _with_gland(values)
    return values


def _with_ring(values: dict[str, Any]) -> None:
    ring = catalogue.ring(values["ring"])
    if values.get("rod_diameter") is None:
        rod = round(1.02 * ring.inner_diameter, 1)
        raise ValueError(
            f'ring = "{values["ring"]}" needs the rod that it seals, as in rod = {rod:g}'
        )
    _follow(values, "inner_diameter", ring.inner_diameter, "ring")
    _follow(values, "section_diameter", ring.section_diameter, "ring")
    known = [values.get(k) is not None for k in ("housing_diameter", "squeeze", "gland")]
    if not any(known) or values.get("groove_width") is None:
        values["gland"] = values.get("gland") or "dynamic"


def _with_gland(values: dict[str, Any]) -> None:
    section, rod = values.get("section_diameter", 3.53), values.get("rod_diameter", 50.0)
    if not (number(section) and number(rod)):
        return
    if number(values.get("squeeze")):
        depth = section * (1.0 - values["squeeze"] / 100.0)
        _follow(values, "housing_diameter", rod + 2.0 * depth, "squeeze")
    if isinstance(values.get("gland"), str):
        gland = catalogue.gland(section, values["gland"])
        if values.get("housing_diameter") is None:
            values["housing_diameter"] = round(rod + 2.0 * gland.depth.middle, 4)
        if values.get("groove_width") is None:
            values["groove_width"] = round(gland.width.middle, 4)


def _follow(values: dict[str, Any], key: str, value: float, source: str) -> None:
    """`put` of a length that follows from another key."""
    put(values, key, value, f"{source} = {values[source]}", _SAME)
