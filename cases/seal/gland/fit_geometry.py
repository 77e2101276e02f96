"""Geometry of the fit: ring, rod, gland, depth and fill from the names of catalogues.

A ring gives two diameters; the rod, and either the depth, the squeeze, the housing or a standard
gland the rest. Values that are given twice must agree.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from softehl.cases.seal.gland import catalogue
from softehl.cases.seal.gland.catalogue import ring_gland
from softehl.cases.seal.gland.grooves import KINDS, Groove, cup_gland
from softehl.cases.seal.gland.key_values import agree, number, put, value_text
from softehl.cases.seal.gland.records import OF_PISTON, FreeSeal, Gland
from softehl.cases.seal.gland.rubbers.conditions import swollen_length
from softehl.cases.seal.gland.rubbers.materials import KEYS
from softehl.cases.seal.gland.sections.section_keys import MEASURES, section_of_file
from softehl.cases.seal.gland.sections.shapes import UCup, parts_of
from softehl.cases.seal.gland.trade.parse_terms import bands, texts
from softehl.cases.seal.gland.trade.ring_names import read_ring, size_of

DIAMETERS = {"rod": "rod_diameter", **{name: key for key, name in OF_PISTON.items()}}
"""Key of a diameter as it is measured -> key that is negative in a piston."""

_GROUND = ("groove_diameter", "squeeze", "groove_depth")
"""Keys that housing_diameter follows from, in the order in which they are read."""


def fitted(specified: Mapping[str, Any]) -> dict[str, Any]:
    """The keys of a case with those that follow from ring, rod, squeeze and gland filled in.

    Raises ValueError where something is missing or contradicts; values of wrong types pass, to be
    refused with their keys.
    """
    values = dict(specified)
    service = {k: float(values[k]) for k in _SERVICE if number(values.get(k))}
    if service:
        return _in_service(values, **service)
    _with_outline(values)
    if isinstance(values.get("ring"), int):
        values["ring"] = str(values["ring"])  # "-226" is a number to a reader of TOML
    side, ground = _side(values), values.get("housing_diameter")
    if side < 0.0 and number(ground) and ground > 0.0:
        values["housing_diameter"] = -float(ground)
    for name, key in DIAMETERS.items():
        if number(values.get(name)):
            _follow(values, key, side * float(values[name]), name)
    if isinstance(values.get("ring"), str):
        _with_ring(values)
    if side < 0.0:
        _in_piston(values)
    _with_gland(values)
    return values


_SERVICE = ("swelling", "compression_set")
"""Keys of what service makes of the sizes of a ring, %."""


def _in_service(
    values: dict[str, Any], swelling: float = 0.0, compression_set: float = 0.0
) -> dict[str, Any]:
    """The keys of a ring that has swollen and lost a part of its squeeze for good.

    It is put into the gland of the new ring. Swelling is free and alike in all directions; a set
    takes a part of the squeeze from the section, so that of h - t, section less depth, (1 - C) is
    left. Raises ValueError.
    """
    if not isinstance(values.get("ring"), str) or read_ring(values["ring"]).outer is not None:
        raise ValueError(
            'swelling and compression_set need a ring by its name, as in ring = "36x4"; for '
            "another seal give its sizes as they are in service"
        )
    if sizes := [name for name in MEASURES if values.get(name) is not None]:
        raise ValueError(f"swelling, compression_set and {sizes[0]}: give the sizes in service")
    sized = ("inner_diameter", "section_diameter", *_SERVICE)
    fresh = fitted({k: v for k, v in values.items() if k not in sized})
    rod, housing = fresh.get("rod_diameter"), fresh.get("housing_diameter")
    if not (number(rod) and number(housing)):
        return values  # refused with its key
    ring, factor = catalogue.ring(values["ring"]), swollen_length(swelling)
    section, depth = factor * ring.section_diameter, 0.5 * (housing - rod)
    section -= 0.01 * compression_set * max(section - depth, 0.0)
    inner = factor * ring.inner_diameter
    in_service = {k: v for k, v in fresh.items() if k not in sized}
    in_service |= {k: values[k] for k in sized if values.get(k) is not None}
    source = f'ring = "{values["ring"]}" in service'
    put(in_service, "section_diameter", section, source)
    put(in_service, "inner_diameter", inner if rod > 0.0 else -(inner + 2.0 * section), source)
    return in_service


def _with_outline(values: dict[str, Any]) -> None:
    """The height of an outline that is given."""
    if isinstance(values.get("outline"), str):
        inner = _size(values, "inner_diameter")
        if not number(inner) or inner == 0.0:
            return  # refused with its key
        shape, _ = section_of_file(Path(values["outline"]), float(inner))
        _, low, _, high = shape.outline.box
        put(values, "section_diameter", high - low, f"outline = {values['outline']}")


def _size(values: Mapping[str, Any], key: str) -> Any:
    """The value of a key of the gland, its default where none is given."""
    return values.get(key, Gland.model_fields[key].default)


def _side(values: Mapping[str, Any]) -> float:
    """-1 of a piston seal, whose diameters are counted negative, else 1."""
    if values.get("bore") is None:
        rod = values.get("rod_diameter")
        return -1.0 if number(rod) and rod < 0.0 else 1.0
    if values.get("rod") is not None:
        raise ValueError(
            f"rod = {values['rod']} and bore = {values['bore']}: a seal slides on one of them; a "
            "rod seal has a rod, a piston seal a bore"
        )
    return -1.0


def _in_piston(values: dict[str, Any]) -> None:
    """The inner diameter of a piston seal as less its outside one, and its usual gland.

    Without one the ring is just as large as the bore outside.
    """
    bore, inner = values.get("rod_diameter"), values.get("inner_diameter")
    section = _size(values, "section_diameter")
    if number(inner) and inner > 0.0 and number(section):
        values["inner_diameter"] = -(inner + 2.0 * section)
    if inner is None and not values.get("ring") and number(bore):
        values["inner_diameter"] = float(bore)
    if values.get("bore") is not None and not values.get("ring"):
        _with_usual_gland(values)


def _with_ring(values: dict[str, Any]) -> None:
    ring_name = read_ring(values["ring"])
    if ring_name.rubber:
        _with_rubber_of_ring(values, ring_name.rubber)
    if ring_name.kind is not None:
        section = values.get("section", ring_name.kind)
        if ring_name.kind != "round":
            values["section"] = section
        if section != ring_name.kind:
            raise ValueError(
                f'section = "{section}" and ring = "{values["ring"]}" contradict: leave one out'
            )
    if ring_name.outer is not None:
        diameters = ring_name.inner, ring_name.outer
        rod, ground = diameters if _side(values) > 0.0 else (-diameters[1], -diameters[0])
        if ring_name.bore_first and rod > 0.0:
            raise ValueError(
                f'ring = "{values["ring"]}" names a piston seal, its bore first; give '
                f'bore = {ring_name.outer:g}, or write "U-cup '
                f"{ring_name.inner:g}x{ring_name.outer:g}x"
                f'{ring_name.width:g}" for a rod seal'
            )
        _with_cup(values, rod, ground, ring_name.width or 0.0)
        return
    ring = catalogue.ring(values["ring"])
    if values.get("rod_diameter") is None:
        rod, bore = round(1.02 * ring.inner_diameter, 1), round(ring.outer_diameter, 1)
        if ring_name.code and ring.groove:  # JIS B 2401 names a ring by its rod
            rod = size_of(ring_name.code)
            bore = rod + 2.0 * ring.groove.depth
        raise ValueError(
            f'ring = "{values["ring"]}" needs the rod that it seals, as in rod = {rod:g}, '
            f"or the bore of a piston seal, as in bore = {bore:g}"
        )
    previous, inner = values.get("inner_diameter"), ring.inner_diameter
    if _side(values) < 0.0 and not (number(previous) and previous > 0.0):
        inner = -ring.outer_diameter
    _follow(values, "inner_diameter", inner, "ring")
    _follow(values, "section_diameter", ring.section_diameter, "ring")
    _with_usual_gland(values)


def _with_rubber_of_ring(values: dict[str, Any], rubber: str) -> None:
    """The rubber of a ring that is named with it, unless its modulus is given.  ValueError."""
    if any(values.get(key) is not None for key in ("fit", "shore_A", *KEYS)):
        return
    named = values.setdefault("compound", rubber)
    if named != rubber:
        raise ValueError(
            f'ring = "{values["ring"]}" is of {rubber}, and compound = "{named}": leave one out'
        )


def _with_usual_gland(values: dict[str, Any]) -> None:
    """A standard gland where depth or width are not given."""
    depths = ("housing_diameter", "groove_diameter", "squeeze", "gland", "groove_depth")
    widths = ("groove_width", "fill")
    if not any(map(values.get, depths)) or not any(map(values.get, widths)):
        values["gland"] = values.get("gland") or "dynamic"


def _with_cup(values: dict[str, Any], rod: float, groove: float, width: float) -> None:
    """A U-cup by its groove: the height over its free lips is such that its gland has this depth.

    The lips are squeezed alike on the rod and in the housing.
    """
    values.setdefault("rod_diameter", rod)
    values.setdefault("housing_diameter", groove)
    values.setdefault("groove_width", width)
    depth, heel = 0.5 * (groove - rod), parts_of(UCup)["heel_height"]
    height = values.setdefault("section_diameter", round(depth / (0.5 * (1.0 + heel)), 3))
    if number(height):
        values.setdefault("inner_diameter", rod - (height - depth))
        _require_rod_of_cup(values, rod, groove, width)


def _require_rod_of_cup(values: Mapping[str, Any], rod: float, groove: float, width: float) -> None:
    """ValueError for a U-cup that is named by another rod, or bore, than the one that is given."""
    diameter, ground = values["rod_diameter"], values["housing_diameter"]
    section = values["section_diameter"]
    if not (number(diameter) and number(ground)) or 0.98 <= diameter / rod <= 1.02:
        return
    if 0.5 * section < 0.5 * (ground - diameter) < section and -0.1 <= diameter / rod - 1.0 <= 0.2:
        return
    what, size, depth = "rod" if rod > 0.0 else "bore", abs(diameter), round(groove - rod, 4)
    rounded = round(size)
    diameters = (rounded, rounded + depth) if rod > 0.0 else (rounded - depth, rounded)
    raise ValueError(
        f'ring = "{values["ring"]}" is a U-cup for a {what} of {abs(rod):g} mm, not of '
        f"{value_text(float(size))}; give {what} = {abs(rod):g}, or a U-cup for this {what}, as in "
        f'"U-cup {diameters[0]:g}x{diameters[1]:g}x{width:g}"'
    )


def _with_gland(values: dict[str, Any]) -> None:
    """Ground and width of the groove by squeeze, depth, a standard gland and fill."""
    section, rod = _size(values, "section_diameter"), _size(values, "rod_diameter")
    if not (number(section) and number(rod)):
        return
    if number(values.get("squeeze")):
        depth = section * (1.0 - values["squeeze"] / 100.0)
        _follow(values, "housing_diameter", rod + 2.0 * depth, "squeeze")
    if number(values.get("groove_depth")):
        _follow(values, "housing_diameter", rod + 2.0 * values["groove_depth"], "groove_depth")
    if values.get("gland") in KINDS:
        groove = _groove(values, section)
        if values.get("housing_diameter") is None:
            terms = texts(values.get("said"))
            limits = {name: limit for name, _, limit in bands(terms, piston=rod < 0.0)}
            named = limits.get("bore" if rod < 0.0 else "rod")
            of_chart = math.copysign(named.nominal, rod) if named else rod
            values["housing_diameter"] = round(of_chart + 2.0 * groove.depth, 4)
        if values.get("groove_width") is None and values.get("fill") is None:
            values["groove_width"] = round(groove.width, 4)
    if number(fill := values.get("fill")) and fill > 0.0:
        free = FreeSeal(**{k: values[k] for k in FreeSeal.model_fields if k in values})
        around = 0.25 * math.pi * (_size(values, "housing_diameter") ** 2 - rod**2)
        width = 100.0 * free.volume / (around * fill)
        _follow(values, "groove_width", width, "fill")


def _groove(values: Mapping[str, Any], section: float) -> Groove:
    """The standard gland of a section."""
    if values.get("section") != "u_cup":
        name = values["ring"] if isinstance(values.get("ring"), str) else None
        return ring_gland(name, section, values["gland"], values.get("section", "round"))
    parts = parts_of(UCup)
    heel = values.get("heel_height") or parts["heel_height"] * section
    return cup_gland(section, heel, values.get("section_width") or parts["width"] * section)


def _follow(values: dict[str, Any], key: str, value: float, source: str) -> None:
    """A length that follows from another key, set or seen to agree.  ValueError names both."""
    if values.get(key) is None:
        values[key] = value
    previous, latter = values[key], f"{source} = {values[source]}"
    if not number(previous) or agree(previous, value):
        return  # what is no number is refused with its key
    earlier = _GROUND[: _GROUND.index(source)] if source in _GROUND else ()
    former = next((name for name in earlier if number(values.get(name))), None)
    was, new = value_text(abs(previous)), value_text(abs(value))
    message = f"{key} = {was} and {latter} contradict: the latter gives {new}"
    if former:
        setting = f"{former} = {value_text(values[former])}"
        message = f"{setting} and {latter} contradict: they give diameters of {was} and {new}"
    raise ValueError(f"{message} mm; leave one of them out")
