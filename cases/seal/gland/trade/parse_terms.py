"""Terms of the trade as values of keys: parsed into the keys that they stand for.

`rod = "36 f7"` becomes `said = ["rod = 36 f7"]`; the diameter is the middle of its limits.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from softehl.cases.harness.parameters import Parameters, key
from softehl.cases.harness.units import is_quantity
from softehl.cases.seal.gland.grooves import KINDS
from softehl.cases.seal.gland.key_values import number, put
from softehl.cases.seal.gland.trade.finish_names import RMS_OF_RA, read_finish
from softehl.cases.seal.gland.trade.fit_names import Band, read_fit
from softehl.cases.seal.gland.trade.normalise_text import NUMBER, NotUnderstoodError, plain, refused
from softehl.cases.seal.gland.trade.oil_names import dynamic
from softehl.cases.seal.gland.trade.ring_names import read_section
from softehl.cases.seal.gland.trade.rubber_names import read_rubber

_SIZES = (
    *("rod_diameter", "bore", "groove_diameter", "housing_diameter", "groove_width"),
    *("groove_depth", "section_diameter", "inner_diameter"),
)
LENGTHS = {"rod": "rod_diameter", **{name: name for name in _SIZES}}
"""Key that may be given with a tolerance -> the key that it means."""

_SHAFTS = ("rod", "rod_diameter", "section_diameter")
"""Keys of outside sizes, which have classes of shafts."""
_GROUNDS = ("groove_diameter", "housing_diameter")
"""Keys of the bottom of the groove: a hole around a rod seal, a shaft in a piston seal."""

_STROKES = {
    "out": r"out[- ]?strokes?|outwards?|extend(?:ing)?|extension|push(?:ing)?",
    "in": r"in[- ]?strokes?|inwards?|retract(?:ing|ion)?|pull(?:ing)?",
    "both": r"both strokes|all|(?:out|in)(?: ?[,/+&] ?| and )(?:out|in)|out ?in|in ?out",
}
"""Stroke -> other words for it."""


class SaidKeys(Parameters):
    """The key of what was said."""

    said: tuple[str, ...] = key(
        (),
        "values that were given in words of the trade",
        bounds='texts such as "rod = 36 f7"; written by the program',
        strict=False,
    )

    @classmethod
    def worded(cls, specified: dict[str, Any]) -> dict[str, Any]:
        """The values without words of the trade, which are kept in `terms`.  ValueError."""
        values, terms, piston = dict(specified), texts(specified.get("said")), of_piston(specified)
        for name in specified:
            if name in LENGTHS and isinstance(values[name], str):
                terms += _length(name, values, piston)
        if "roughness" in specified:
            terms += _finishes(values)
        _oil(values)
        _require_stroke(values.get("stroke"))
        _require_gland(values.get("gland"))
        if isinstance(section := values.get("section"), str):
            values["section"] = read_section(section)
        return super().worded({**values, "said": tuple(dict.fromkeys(terms))} if terms else values)


def texts(value: object) -> list[str]:
    """Return the texts of `value`; anything else is refused with its key."""
    return (
        [text for text in value if isinstance(text, str)] if isinstance(value, list | tuple) else []
    )


def of_piston(values: Mapping[str, Any]) -> bool:
    """True if the values are those of a piston seal: a bore, or a negative rod_diameter."""
    rod = values.get("rod_diameter")
    return values.get("bore") is not None or (number(rod) and rod < 0.0)


def bands(terms: Sequence[str], *, piston: bool) -> Iterator[tuple[str, str, Band]]:
    """Keys that were given with limits, what was said, and these.  Raises NotUnderstoodError."""
    for name, _, value in (text.partition(" = ") for text in terms):
        if name not in LENGTHS:
            continue
        if (band := _fit(name, value, piston)) is None:
            raise NotUnderstoodError(
                f'said = "{name} = {value}" is not understood; write it in its own key'
            )
        yield name, value, band


def _fit(name: str, value: str, piston: bool) -> Band | None:
    return read_fit(name, value, hole=_hole(name, piston))


def _hole(name: str, piston: bool) -> bool | None:
    """True if the size of this key is that of a hole; None for a depth, which is neither."""
    if name == "groove_depth":
        return None
    return not piston if name in _GROUNDS else name not in _SHAFTS


def with_limits(values: dict[str, Any]) -> dict[str, Any]:
    """The values with the middles of what has limits.  ValueError."""
    terms = texts(values.get("said"))
    piston = of_piston(values) or any(text.startswith("bore = ") for text in terms)
    for name, value, band in bands(terms, piston=piston):
        for key_of in dict.fromkeys((name, LENGTHS[name])):
            if number(existing := values.get(key_of)) and existing < 0.0:
                continue  # of a piston seal that is complete: minus this size, or minus its outside
            put(values, key_of, band.middle, f'{name} = "{value}"')
    return values


def understood(terms: Sequence[str], *, piston: bool) -> list[str]:
    """Lines that say how words of the trade were understood."""
    lines = [
        f"{name} = {value}: {band.low:.10g} to {band.high:.10g} mm, solved at the middle, "
        f"{band.middle:.10g}"
        for name, value, band in bands(terms, piston=piston)
    ]
    for text in terms:
        name, _, value = text.partition(" = ")
        if name == "roughness" and (height := read_finish(value.partition(" ")[2])):
            factor = f", {RMS_OF_RA:.4g} Ra (normal distribution)" if "Ra" in value else ""
            lines.append(f"{name} of the {value}: {height:.4g} um rms{factor}")
    return lines


def _require_stroke(value: object) -> None:
    """Raise NotUnderstoodError for another word for a stroke."""
    for stroke, pattern in _STROKES.items():
        if isinstance(value, str) and re.fullmatch(pattern, plain(value), re.IGNORECASE):
            raise refused("stroke", value, "is another word for it", stroke)


def _require_gland(value: object) -> None:
    """Raise NotUnderstoodError for a standard, or for a use, whose grooves are not known here."""
    if not isinstance(value, str) or value in KINDS:
        return
    if re.search(r"ISO|BS|DIN|JIS|GB|AS ?\d|MIL|SAE", plain(value), re.IGNORECASE):
        why = (
            "names a standard: rings of JIS B 2401 have its groove by themselves, those of other "
            "standards (ISO 3601-2, BS 4518) are not in the catalogue; give groove_depth and "
            "groove_width"
        )
    elif re.fullmatch(r"static.*|flange|face|axial|rotary.*|oscillating", plain(value), re.I):
        why = "is no groove of a reciprocating seal"
    else:
        return
    raise refused("gland", value, why, "dynamic", "pneumatic")


def _length(name: str, values: dict[str, Any], piston: bool) -> list[str]:
    """A size with a tolerance."""
    text = plain(values[name])
    if re.fullmatch(rf"{NUMBER} ?(mm)?", text):
        values[name] = float(text.removesuffix("mm"))
        return []
    if _fit(name, values[name], piston):
        del values[name]
        return [f"{name} = {text}"]
    if is_quantity(text):
        return []
    usual = "36 H8" if _hole(name, piston) else "36 f7"
    raise refused(name, values[name], "is no size", "36 mm", usual)


def rubber_named(values_in: dict[str, Any]) -> dict[str, Any]:
    """The values with a rubber that is named in another key in `compound`.  ValueError."""
    values = dict(values_in)
    for name in ("material", "shore_A"):
        text = values.get(name)
        if not isinstance(text, str) or (rubber := read_rubber(name, text)) is None:
            continue
        del values[name]
        existing = values.setdefault("compound", rubber.text)
        if existing != rubber.text:
            raise ValueError(
                f'compound = "{existing}" and {name} = "{text}" contradict: leave one of them out'
            )
    return values


def _oil(values: dict[str, Any]) -> None:
    """A dynamic viscosity that stands for an oil, and an oil for a viscosity, to their own keys."""
    oil, viscosity = values.get("oil"), values.get("viscosity")
    if isinstance(oil, str) and dynamic(oil) is not None and viscosity is None:
        values["viscosity"] = values.pop("oil")
    elif isinstance(viscosity, str) and oil is None and re.match(r"[A-Za-z]", viscosity):
        values["oil"] = values.pop("viscosity")


def _finishes(values: dict[str, Any]) -> list[str]:
    """Finishes of rod and seal, or of the seal alone, as rms heights."""
    finishes = values["roughness"]
    if isinstance(finishes, str) and " and " in finishes:
        finishes = finishes.split(" and ")
    several = isinstance(finishes, list | tuple)
    items, parts = (list(finishes), ("rod", "seal")) if several else ([finishes], ("seal",))
    terms = []
    for n, item in enumerate(items[:2]):
        if isinstance(item, str) and (height := read_finish(item)) is not None:
            items[n] = height
            terms += [f"roughness = {parts[n]} {plain(item)}"]
    values["roughness"] = items if several else items[0]
    return terms
