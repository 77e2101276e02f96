"""Regions of a section that have a material of their own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from softehl.cases.seal.gland.key_values import number, one_line
from softehl.cases.seal.gland.rubbers.rubber import with_rubber
from softehl.cases.seal.gland.rubbers.rubber_keys import Rubber
from softehl.cases.seal.gland.trade.rubber_names import is_plastic
from softehl.cases.seal.meshing.two_region_mesh import CAP

PRESETS: dict[str, dict[str, Any]] = {
    "ptfe": {"material": "neo-hooke", "mu": 171.0, "bulk_modulus": 2080.0}
}
"""Materials by name. PTFE as an elastic solid, E = 500 MPa and nu = 0.46 at room temperature; it
neither yields nor creeps here."""

MATERIALS = (
    'a table of regions: cap = "ptfe", or cap = { material = "neo-hooke", mu = 171, bulk_modulus = '
    "2080 } with the keys of a rubber; a cap is of PTFE where nothing is given"
)


class Region(Rubber):
    """Material of a region of a section.  Raises pydantic.ValidationError, ValueError."""

    @classmethod
    def worded(cls, values: dict[str, Any]) -> dict[str, Any]:
        """As in the base; a plastic is one of the presets, or none."""
        name = values.get("material")
        plastic = isinstance(name, str) and is_plastic(name)
        return values if plastic else super().worded(values)

    @classmethod
    def completed(cls, values: dict[str, Any]) -> dict[str, Any]:
        """The keys of its material filled in."""
        name = values.get("material")
        preset = PRESETS.get(name, {}) if isinstance(name, str) else {}
        return with_rubber(
            {**values, **preset, **{k: v for k, v in values.items() if k != "material"}}
        )


def with_regions(values: dict[str, Any]) -> dict[str, Any]:
    """The keys of a case with its regions as such.  ValueError, one line, for what is none."""
    materials = values.get("materials", {})
    if not isinstance(materials, Mapping):
        return values
    tables = dict(materials)
    if number(values.get("cap_thickness")):
        tables.setdefault(CAP, "ptfe")
    return {**values, "materials": {name: _region(name, table) for name, table in tables.items()}}


def _region(name: str, table: object) -> Region:
    if isinstance(table, Region):
        return table
    if isinstance(table, str):
        table = {"material": table}
    if not isinstance(table, Mapping) or not table:
        raise ValueError(f"materials.{name} = {table}: allowed is {MATERIALS}")
    for key in ("fit", "ogden_terms", "glass_transition", "modulus_rule", "modulus_table"):
        if table.get(key) not in (None, 3):
            raise ValueError(f"materials.{name}: {key} is for the whole section; give moduli")
    if name == CAP and set(table) <= set(PRESETS["ptfe"]) - {"material"}:
        table = {"material": "ptfe", **table}
    with one_line(f"materials.{name}.", material=f"; or {', '.join(PRESETS)}"):
        return Region(**table)
