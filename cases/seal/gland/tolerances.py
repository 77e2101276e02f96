"""Effect of tolerances of ring, gland, rubber and oil on a film, by its sensitivities.

Linear: a parameter that is off by t % moves a quantity by S t %, S its log derivative. Tolerances
add up in the worst case, and in quadrature where they are independent.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from softehl.cases.harness.row import Record, column
from softehl.cases.seal.gland.catalogue import ring
from softehl.cases.seal.gland.fit_geometry import DIAMETERS
from softehl.cases.seal.gland.records import Gland
from softehl.cases.seal.gland.rubbers.materials import MODULI
from softehl.cases.seal.gland.sections.section_keys import MEASURES
from softehl.cases.seal.gland.sensitivity_keys import LENGTHS, NUMBERS, PRESSURE_KEY
from softehl.cases.seal.gland.trade.parse_terms import LENGTHS as LIMITED
from softehl.cases.seal.gland.trade.parse_terms import bands
from softehl.cases.seal.gland.trade.ring_names import read_ring

if TYPE_CHECKING:
    from softehl.cases.seal.gland.parameters import Seal

_ALIASES = {
    "modulus": MODULI,
    **{name: (key,) for name, key in DIAMETERS.items()},
}
"""Names for other keys: all that a rubber has are off by the same share."""

_IN_MM = frozenset((*LENGTHS, *MEASURES))
_VARIED = _IN_MM.union(NUMBERS, [PRESSURE_KEY])

_OF_THE_GLAND = {"groove_depth": ("mm", "", "%"), "squeeze": ("%",), "fill": ("%",)}
"""Keys that follow from others -> units of their tolerances; per cent of squeeze, fill: points."""

_ITEM = re.compile(
    r"(?P<name>\w+)\s+(?:\+-\s*)?(?P<size>\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)\s*(?P<unit>%|mm|)"
)


@dataclass(frozen=True)
class ToleranceRow(Record):
    """One row of `tolerances.csv`."""

    sealed_pressure_MPa: float = column("MPa", "sealed pressure p_s")
    rod_speed_mm_s: float = column("mm/s", "rod speed U, + = outstroke (to the air side)")
    quantity: str = column("", "as in `sensitivity.csv`")
    worst_percent: float = column("%", "largest change: all tolerances at their unluckiest ends")
    likely_percent: float = column("%", "the same of independent tolerances, added in quadrature")
    largest: str = column("", "the tolerance that has the largest part in it")
    largest_percent: float = column("%", "its part")


Shares = Mapping[str, Mapping[str, float]]
"""Name of a tolerance -> the parameters that it moves, each by a share of its value."""


def read_tolerances(p: Seal) -> Shares:
    """The tolerances of a case: those of its ring in the catalogue, of limits, and those given.

    Raises ValueError.
    """
    typed = [_share(text, p) for text in p.tolerances]
    names = [name for name, _ in typed]
    if twice := [name for name in names if names.count(name) > 1]:
        raise ValueError(f"tolerances: {twice[0]} is given twice; leave one of them out")
    of_ring = [f"{key} {tolerance!r} mm" for key, _, tolerance in ring_sizes(p.ring)]
    of_limits = [
        f"{LIMITED[name]} {band.half:.9f} mm" for name, _, band in bands(p.said, piston=p.piston)
    ]
    return dict([*(_share(text, p) for text in (*of_ring, *of_limits)), *typed])


def _share(text: str, p: Seal) -> tuple[str, dict[str, float]]:
    """The name of a tolerance, and the share by which it moves each parameter.  ValueError."""
    match = _ITEM.fullmatch(text.strip())
    if match and match["name"] in _OF_THE_GLAND:
        return match["name"], _of_the_gland(match, p)
    names = _ALIASES.get(match["name"], (match["name"],)) if match else ()
    names = tuple(name for name in names if name in _VARIED and getattr(p, name))
    numbers = [value for name in names if isinstance(value := getattr(p, name), float)]
    metric = match is None or match["unit"] != "mm" or _IN_MM.issuperset(names)
    if not match or not numbers or len(numbers) < len(names) or not metric:
        raise ValueError(
            f'tolerances: "{text}" is not understood; allowed: a key of the case that is a '
            "number other than 0 and has a sensitivity, or modulus, and +- its tolerance, as "
            'in "viscosity 10 %" or "rod_diameter 0.05 mm"'
        )
    size = float(match["size"])
    share = 0.01 * size if match["unit"] == "%" else size / abs(numbers[0])
    moved = dict.fromkeys(names, share)
    if p.piston and "section_diameter" in moved:  # less the outside: inside and twice the section
        moved["inner_diameter"] = share * 2.0 * p.section_diameter / -p.inner_diameter
    return match["name"], moved


def _of_the_gland(match: re.Match[str], p: Gland) -> dict[str, float]:
    """The share by which a depth, squeeze (points) or fill (points) moves diameter or width."""
    name, size, unit = match["name"], float(match["size"]), match["unit"]
    if unit not in _OF_THE_GLAND[name]:
        unit, usual = _OF_THE_GLAND[name][0], 0.05 if name == "groove_depth" else 2
        raise ValueError(
            f'tolerances: "{match[0]}" is not understood; write "{name} {usual} {unit}"'
        )
    if name == "fill":
        return {"groove_width": size / p.fill_percent}
    error = 0.01 * size * (p.section_diameter if name == "squeeze" else p.depth)
    return {"housing_diameter": 2.0 * (error if unit == "%" else size) / abs(p.housing_diameter)}


def ring_sizes(name: str | None) -> list[tuple[str, float, float]]:
    """Sizes of a ring of the catalogue that have a tolerance: key, mm, +- mm; none of a U-cup."""
    if name is None or read_ring(name).kind == "u_cup":
        return []
    size = ring(name)
    sizes = (
        ("section_diameter", size.section_diameter, size.section_tolerance),
        ("inner_diameter", size.inner_diameter, size.inner_tolerance),
    )
    return [(key, value, tolerance) for key, value, tolerance in sizes if tolerance]


def band(
    operating_point: tuple[float, float],
    quantity: str,
    log_derivatives: Mapping[str, float],
    tolerances: Shares,
) -> ToleranceRow:
    """Effect of tolerances on a quantity at an operating point (p_s, U), by its log derivatives."""
    parts = {
        name: 100.0
        * abs(sum(log_derivatives.get(key, 0.0) * share for key, share in moved.items()))
        for name, moved in tolerances.items()
    }
    largest = max(parts, key=lambda name: parts[name])
    return ToleranceRow(
        sealed_pressure_MPa=operating_point[0],
        rod_speed_mm_s=operating_point[1],
        quantity=quantity,
        worst_percent=sum(parts.values()),
        likely_percent=math.hypot(*parts.values()),
        largest=largest,
        largest_percent=parts[largest],
    )
