"""What tolerances of ring, gland, rubber and oil do to a film, by its sensitivities.

Linear: a parameter that is off by t % moves a quantity by S t %, S its log derivative. Tolerances
add up in the worst case, and in quadrature where they are independent.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from softehl.cases.harness.row import Record, column
from softehl.cases.seal.catalogue import UnknownRingError, ring

MODULUS = {"modulus": ("mu_1", "mu_2")}
"""Names for several parameters that are off by the same share."""

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


Shares = Mapping[str, tuple[float, tuple[str, ...]]]
"""Name of a tolerance -> its relative size, and the parameters that it moves."""


def read_tolerances(
    given: Sequence[str], values: Mapping[str, object], ring_name: str | None
) -> Shares:
    """The tolerances of a case: those of its ring in the catalogue, and those given.

    given: texts such as "viscosity 10 %" or "rod_diameter 0.05 mm". values: those of the case's
    keys. Raises ValueError.
    """
    shares = {}
    for text in (*_of_ring(ring_name), *given):
        found = _ITEM.fullmatch(text.strip())
        names = MODULUS.get(found["name"], (found["name"],)) if found else ()
        known = [values.get(name) for name in names]
        if not found or not all(isinstance(v, float) and v != 0.0 for v in known):
            raise ValueError(
                f'tolerances: "{text}" is not understood; allowed: a key of the case that is a '
                'number other than 0, or modulus, and +- its tolerance, as in "viscosity 10 %" '
                'or "rod_diameter 0.05 mm"'
            )
        value, size = known[0], float(found["size"])
        assert isinstance(value, float)
        relative = 0.01 * size if found["unit"] == "%" else size / abs(value)
        shares[found["name"]] = relative, names
    return shares


def _of_ring(name: str | None) -> list[str]:
    """Tolerances of a ring of the catalogue, +- mm."""
    if name is None:
        return []
    try:
        known = ring(name)
    except UnknownRingError:
        return []
    sizes = {
        "section_diameter": known.section_tolerance,
        "inner_diameter": known.inner_tolerance,
    }
    return [f"{key} {size!r} mm" for key, size in sizes.items() if size]


def band(
    place: tuple[float, float], quantity: str, slopes: Mapping[str, float], shares: Shares
) -> ToleranceRow:
    """What tolerances do to one quantity; place: p_s and U; slopes: its log derivatives."""
    parts = {
        name: 100.0 * abs(sum(slopes.get(key, 0.0) for key in keys)) * share
        for name, (share, keys) in shares.items()
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
