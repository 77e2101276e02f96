"""Effect of tolerances of ring, gland, rubber and oil on a film, by its sensitivities.

Linear: a parameter that is off by t % moves a quantity by S t %, S its log derivative. Tolerances
add up in the worst case, and in quadrature where they are independent.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from softehl.cases.harness.row import Record, column
from softehl.cases.seal.gland.catalogue import UnknownRingError, ring
from softehl.cases.seal.gland.trade.said import LENGTHS as LIMITED
from softehl.cases.seal.gland.trade.said import bands
from softehl.cases.seal.gland.varied import LENGTHS, MEASURES, NUMBERS, PRESSURE_KEY

_SURFACES = {
    "rod": ("rod_diameter",),
    "bore": ("rod_diameter",),
    "groove_diameter": ("housing_diameter",),
}
_ALIASES = {"modulus": ("mu_1", "mu_2", "mu", "c_10", "c_20", "c_30"), **_SURFACES}
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


def read_tolerances(
    given: Sequence[str], values: Mapping[str, object], ring_name: str | None
) -> Shares:
    """The tolerances of a case: those of its ring in the catalogue, of limits, and those given.

    given: texts such as "viscosity 10 %" or "rod_diameter 0.05 mm". values: those of the case's
    keys. Raises ValueError.
    """
    typed = [_share(text, values) for text in given]
    twice = [name for name, times in Counter(name for name, _ in typed).items() if times > 1]
    if twice:
        raise ValueError(f"tolerances: {twice[0]} is given twice; leave one of them out")
    of_ring = [f"{key} {tolerance!r} mm" for key, _, tolerance in ring_sizes(ring_name)]
    known = [*of_ring, *_of_limits(values)]
    return dict([*(_share(text, values) for text in known), *typed])


def _with_outside(moved: dict[str, float], values: Mapping[str, object]) -> dict[str, float]:
    """What a tolerance of the section moves: the outside of a piston ring with it, which is the
    inside diameter and twice the section.
    """
    section, outside = (float(str(values[key])) for key in ("section_diameter", "inner_diameter"))
    if "section_diameter" in moved and outside < 0.0:
        moved["inner_diameter"] = moved["section_diameter"] * 2.0 * section / -outside
    return moved


def _of_limits(values: Mapping[str, object]) -> list[str]:
    """Tolerances of what was given with its limits, "36 f7", +- mm."""
    said = values.get("said", ())
    assert isinstance(said, tuple)
    return [f"{LIMITED[name]} {found.half:.9f} mm" for name, found in bands(said)]


def _share(text: str, values: Mapping[str, object]) -> tuple[str, dict[str, float]]:
    """The name of a tolerance, and the share by which it moves each parameter.  ValueError."""
    found = _ITEM.fullmatch(text.strip())
    if found and found["name"] in _OF_THE_GLAND:
        return found["name"], _of_the_gland(found, values)
    names = _moved(found["name"], values) if found else ()
    known = [value for value in map(values.get, names) if isinstance(value, float)]
    metric = found is None or found["unit"] != "mm" or _IN_MM.issuperset(names)
    if not found or not known or len(known) < len(names) or not metric:
        raise ValueError(
            f'tolerances: "{text}" is not understood; allowed: a key of the case that is a '
            "number other than 0 and has a sensitivity, or modulus, and +- its tolerance, as "
            'in "viscosity 10 %" or "rod_diameter 0.05 mm"'
        )
    size = float(found["size"])
    share = 0.01 * size if found["unit"] == "%" else size / abs(known[0])
    return found["name"], _with_outside(dict.fromkeys(names, share), values)


def _of_the_gland(found: re.Match[str], values: Mapping[str, object]) -> dict[str, float]:
    """The share by which a depth, squeeze (points) or fill (points) moves diameter or width."""
    name, size, unit = found["name"], float(found["size"]), found["unit"]
    rod, housing, section, fill = (
        float(str(values.get(key) or 0.0))
        for key in ("rod_diameter", "housing_diameter", "section_diameter", "fill")
    )
    if unit not in _OF_THE_GLAND[name]:
        unit, usual = _OF_THE_GLAND[name][0], 0.05 if name == "groove_depth" else 2
        raise ValueError(
            f'tolerances: "{found[0]}" is not understood; write "{name} {usual} {unit}"'
        )
    if name == "fill":
        if not fill:
            raise ValueError(
                f'tolerances: "{found[0]}" needs fill; write "groove_width 0.2 mm", or give fill'
            )
        return {"groove_width": size / fill}
    depth = 0.5 * (housing - rod)
    wrong = 0.01 * size * section if name == "squeeze" else size
    if name == "groove_depth" and unit == "%":
        wrong = 0.01 * size * depth
    return {"housing_diameter": 2.0 * wrong / abs(housing)}


def _moved(name: str, values: Mapping[str, object]) -> tuple[str, ...]:
    """The keys that a tolerance moves: those of its name that have a value and a sensitivity."""
    names = _ALIASES.get(name, (name,))
    return tuple(key for key in names if key in _VARIED and values.get(key))


def ring_sizes(name: str | None) -> list[tuple[str, float, float]]:
    """Sizes of a ring of the catalogue that have a tolerance: key, mm, +- mm; none of a U-cup."""
    if name is None:
        return []
    try:
        known = ring(name)
    except UnknownRingError:
        return []
    sizes = (
        ("section_diameter", known.section_diameter, known.section_tolerance),
        ("inner_diameter", known.inner_diameter, known.inner_tolerance),
    )
    return [(key, value, tolerance) for key, value, tolerance in sizes if tolerance]


def band(
    place: tuple[float, float], quantity: str, slopes: Mapping[str, float], shares: Shares
) -> ToleranceRow:
    """Effect of tolerances on one quantity; place: p_s and U; slopes: its log derivatives."""
    parts = {
        name: 100.0 * abs(sum(slopes.get(key, 0.0) * share for key, share in moved.items()))
        for name, moved in shares.items()
    }
    largest = max(parts, key=lambda name: parts[name])
    return ToleranceRow(
        sealed_pressure_MPa=place[0],
        rod_speed_mm_s=place[1],
        quantity=quantity,
        worst_percent=sum(parts.values()),
        likely_percent=math.hypot(*parts.values()),
        largest=largest,
        largest_percent=parts[largest],
    )
