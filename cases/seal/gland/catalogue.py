"""Standard rings by name, and how a ring sits in its gland (grooves.py).

`as568.csv` holds the 349 general sizes of SAE AS568 (-001 to -475, inch): inside diameter, section
and their tolerances. Dimensions are facts; the rows were written by series and step and compared,
one by one, with the public ISO 3601-1 class A table of bell-jamie/o-ring-studio: every inside
diameter agrees within rounding, so does every tolerance but those of -228 to -231, where that
table has no band for 0.020 in, which the other series have at these diameters.
ISO 3601-1 class B tolerances: its rule (A.1) and its steps of the section.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from math import pi

from softehl.cases.seal.gland.grooves import INCH, Range
from softehl.cases.seal.gland.grooves import squeeze as squeeze
from softehl.cases.seal.gland.trade.ring_names import read_ring
from softehl.cases.seal.gland.trade.text import NotUnderstoodError


class UnknownRingError(ValueError):
    """A name that no ring has; its text names the nearest ones."""


@dataclass(frozen=True)
class Ring:
    """A ring as it is sold, mm. Tolerances are +-, None where the class gives none.

    area, middle: of a section that is not round, mm^2, and radius of its centroid, mm.
    inner_diameter: less the outside diameter for a ring in a piston, see `Seal.piston`.
    """

    name: str
    inner_diameter: float
    section_diameter: float
    inner_tolerance: float | None = None
    section_tolerance: float | None = None
    area: float | None = None
    middle: float | None = None

    @property
    def volume(self) -> float:
        """Of the free ring, mm^3."""
        if self.area is not None and self.middle is not None:
            return 2.0 * pi * self.middle * self.area
        middle = 0.5 * (self.inner_diameter + self.section_diameter)
        return 2.0 * pi**2 * middle * (0.5 * self.section_diameter) ** 2

    @property
    def outer_diameter(self) -> float:
        """Inside diameter and twice the section, mm."""
        return self.inner_diameter + 2.0 * self.section_diameter


def ring(name: str) -> Ring:
    """The ring of a name (trade.ring_names), of a round section or an X-ring.

    A metric ring has the tolerances of ISO 3601-1, class B, for general use. Raises
    UnknownRingError.
    """
    try:
        said = read_ring(name)
    except NotUnderstoodError as error:
        raise UnknownRingError(str(error)) from None
    if said.outer is not None:
        raise UnknownRingError(f'ring = "{name}" is a U-cup, which is named by its groove')
    if said.number is not None:
        return _by_number(name.strip(), said.number)
    return _metric(name.strip(), said.inner, said.section)


def stretch(a: Ring, rod_diameter: float, housing_diameter: float) -> float:
    """Circumferential stretch of the inside of a ring on its rod, or on the ground of the groove
    of its piston, %; 0 if it is loose.
    """
    on, inside = rod_diameter, a.inner_diameter
    if rod_diameter < 0.0:
        on, inside = housing_diameter, a.outer_diameter
    return 100.0 * max(on / inside - 1.0, 0.0)


def fill(a: Ring, rod_diameter: float, housing_diameter: float, width: float) -> float:
    """Volume of a ring over that of its gland, %."""
    return 100.0 * a.volume / (0.25 * pi * (housing_diameter**2 - rod_diameter**2) * width)


def warnings(
    a: Ring, rod_diameter: float, housing_diameter: float, width: float
) -> tuple[str, ...]:
    """Warnings of handbooks about a ring and its gland, a line each."""
    filled = fill(a, rod_diameter, housing_diameter, width)
    stretched = stretch(a, rod_diameter, housing_diameter)
    carrier = "piston" if rod_diameter < 0.0 else "rod"
    found = []
    if not FILL.low <= filled <= FILL.high:
        found.append(
            f"the ring fills {filled:.0f} % of its gland; handbooks advise "
            f"{FILL.low:g} to {FILL.high:g} %"
        )
    if stretched > STRETCH:
        found.append(
            f"the ring is stretched by {stretched:.1f} % on its {carrier}; handbooks advise at "
            f"most {STRETCH:g} %"
        )
    return tuple(found)


FILL = Range(60.0, 95.0)
"""Advised volume of the ring over that of its gland, %."""

STRETCH = 5.0
"""Largest advised stretch, %."""


@cache
def as568() -> dict[int, Ring]:
    """The 349 general sizes by number, mm."""
    text = files(__package__).joinpath("as568.csv").read_text(encoding="utf-8")
    return {int(row["number"]): _row(row) for row in csv.DictReader(text.splitlines())}


def _row(row: dict[str, str]) -> Ring:
    mm = {k: round(float(v) * INCH, 4) for k, v in row.items() if k != "number"}
    return Ring(
        f"AS568-{row['number']}",
        mm["inner_in"],
        mm["section_in"],
        mm["inner_tolerance_in"],
        mm["section_tolerance_in"],
    )


_SERIES_TEXT = "-001 to -050, -102 to -178, -201 to -284, -309 to -395, -425 to -475"

# ISO 3601-1 class B: tolerance of the section up to a diameter, mm
_CLASS_B = ((2.25, 0.08), (3.15, 0.09), (4.50, 0.10), (6.30, 0.13), (8.40, 0.15))


def _metric(name: str, inner: float, section: float) -> Ring:
    if not 0.5 * section <= inner <= 1500.0 or not 0.5 <= section <= 20.0:
        raise UnknownRingError(
            f'ring = "{name}" has an inside diameter of {inner:g} and a section of {section:g} mm; '
            "write inside diameter x section in mm, the section 0.5 to 20 mm"
        )
    band = next((t for most, t in _CLASS_B if section <= most), None)
    tolerance = round(0.009 * inner**0.95 + 0.11, 2)
    return Ring(f"ISO 3601 {inner:g}x{section:g}", inner, section, tolerance, band)


def _by_number(text: str, number: int) -> Ring:
    rings = as568()
    if number in rings:
        return rings[number]
    below = max((n for n in rings if n < number), default=None)
    above = min((n for n in rings if n > number), default=None)
    near = _quoted(rings[n].name for n in (below, above) if n is not None)
    raise UnknownRingError(
        f'ring = "{text}": AS568 has no general size -{number:03d}; nearest: {near} '
        f"({_SERIES_TEXT})"
    )


def _quoted(names: Iterable[str]) -> str:
    return " and ".join(f'"{n}"' for n in names)
