"""Standard rings by name, the glands they are made for, and how a ring sits in one.

`as568.csv` holds the 349 general sizes of SAE AS568 (-001 to -475, inch): inside diameter, section
and their tolerances. Dimensions are facts; the rows were written by series and step and compared,
one by one, with the public ISO 3601-1 class A table of bell-jamie/o-ring-studio: every inside
diameter agrees within rounding, so does every tolerance but those of -228 to -231, where that
table has no band for 0.020 in, which the other series have at these diameters.
Glands: the common chart of makers' handbooks for reciprocating rod seals (e.g. Apple Rubber's
design guide, table A). ISO 3601-1 class B tolerances: its rule (A.1) and its steps of the section.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from math import pi
from typing import NamedTuple

INCH = 25.4
"""mm"""


class UnknownRingError(ValueError):
    """A name that no ring has; its text names the nearest ones."""


class UnknownGlandError(ValueError):
    """A section for which no gland is known; its text says what to give instead."""


class Range(NamedTuple):
    """Least and largest value, mm."""

    low: float
    high: float

    @property
    def middle(self) -> float:
        """Mean of both ends, mm."""
        return 0.5 * (self.low + self.high)


@dataclass(frozen=True)
class Ring:
    """A ring as it is sold, mm. Tolerances are +-, None where the class gives none.

    area, middle: of a section that is not round, mm^2, and radius of its centroid, mm.
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


@dataclass(frozen=True)
class Gland:
    """A groove for one section, mm: depth from the rod to its ground, axial width, corner radius.

    The depth holds the clearance between rod and housing; the width is one without back-up rings.
    """

    section_diameter: float
    depth: Range
    width: Range
    radius: Range


def ring(name: str) -> Ring:
    """The ring of a name: "AS568-226", "-226", "50.4 x 3.55", also with "ISO 3601" or "DIN 3771".

    A metric ring has the tolerances of ISO 3601-1, class B, for general use. Raises
    UnknownRingError.
    """
    text = name.strip()
    if found := _DASH.fullmatch(text):
        return _by_number(text, int(found["number"]))
    if found := _METRIC.fullmatch(text):
        inner, section = (float(found[k].replace(",", ".")) for k in ("inner", "section"))
        return _metric(text, inner, section)
    sizes = re.findall(r"\d+(?:[.,]\d+)?", text)[-2:]
    near = f' (did you mean "{sizes[0]}x{sizes[1]}"?)' if len(sizes) == 2 else ""
    raise UnknownRingError(
        f'ring = "{name}" is not known{near}; give a number, "AS568-226" ({_SERIES_TEXT}), '
        'or the diameters in mm, "ISO 3601 50.4x3.55"'
    )


def gland(section_diameter: float, kind: str = "dynamic") -> Gland:
    """The gland for a section (mm); kind: "dynamic", a reciprocating rod seal.

    A metric section takes the gland of the inch section within 3 % of it. Raises UnknownGlandError.
    """
    if kind not in _GLANDS:
        raise UnknownGlandError(f'gland = "{kind}" is not known; there is {_quoted(_GLANDS)}')
    for rule in _GLANDS[kind]:
        if abs(section_diameter - rule.section_diameter) <= 0.03 * rule.section_diameter:
            return rule
    known = ", ".join(f"{g.section_diameter:.2f}" for g in _GLANDS[kind])
    near = min(_GLANDS[kind], key=lambda g: abs(g.section_diameter - section_diameter))
    width = section_diameter * near.width.middle / near.section_diameter
    taken = squeeze(near.section_diameter, near.depth.middle)
    raise UnknownGlandError(
        f'gland = "{kind}" has no groove for a section of {section_diameter:g} mm (only {known} '
        "mm); give squeeze and groove_width instead: in the proportions of the nearest one, "
        f"squeeze = {taken:.3g} and groove_width = {width:.3g}"
    )


def stretch(inner_diameter: float, rod_diameter: float) -> float:
    """Circumferential stretch of the inside of a ring on its rod, %; 0 if it is loose."""
    return 100.0 * max(rod_diameter / inner_diameter - 1.0, 0.0)


def squeeze(section_diameter: float, depth: float) -> float:
    """Part of the free section that the gland takes away, %."""
    return 100.0 * (1.0 - depth / section_diameter)


def fill(a: Ring, rod_diameter: float, housing_diameter: float, width: float) -> float:
    """Volume of a ring over that of its gland, %."""
    return 100.0 * a.volume / (0.25 * pi * (housing_diameter**2 - rod_diameter**2) * width)


def warnings(
    a: Ring, rod_diameter: float, housing_diameter: float, width: float
) -> tuple[str, ...]:
    """What handbooks advise against in a ring and its gland, a line each."""
    filled = fill(a, rod_diameter, housing_diameter, width)
    stretched = stretch(a.inner_diameter, rod_diameter)
    found = []
    if not FILL.low <= filled <= FILL.high:
        found.append(
            f"the ring fills {filled:.0f} % of its gland; handbooks advise "
            f"{FILL.low:g} to {FILL.high:g} %"
        )
    if stretched > STRETCH:
        found.append(
            f"the ring is stretched by {stretched:.1f} % on its rod; handbooks advise at most "
            f"{STRETCH:g} %"
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


_DASH = re.compile(
    r"(O-?ring\s+)?((AS\s?568[A-G]?|BS)[\s-]*|2-|-)?(?P<number>\d{1,3})", re.IGNORECASE
)
_STANDARD = r"(O-?ring|(DIN\s)?ISO\s?3601(-1)?|DIN\s?3771(-1)?)"
_METRIC = re.compile(
    rf"""({_STANDARD}[\s,-]+)*
    (?P<inner>\d+([.,]\d+)?)\s?(mm)?
    \s?[x\u00d7*]\s?
    (?P<section>\d+([.,]\d+)?)(\s?mm)?
    ([\s,-]+{_STANDARD})*""",
    re.IGNORECASE | re.VERBOSE,
)
_SERIES_TEXT = "-001 to -050, -102 to -178, -201 to -284, -309 to -395, -425 to -475"

# inch: section, depth, width (+- 0.005), corner radius
_DYNAMIC = (
    (0.070, (0.055, 0.057), 0.095, (0.005, 0.015)),
    (0.103, (0.087, 0.090), 0.145, (0.005, 0.020)),
    (0.139, (0.119, 0.123), 0.185, (0.005, 0.030)),
    (0.210, (0.183, 0.188), 0.285, (0.005, 0.050)),
    (0.275, (0.234, 0.240), 0.375, (0.005, 0.060)),
)


def _inches(low: float, high: float) -> Range:
    return Range(round(low * INCH, 4), round(high * INCH, 4))


def _glands() -> Iterator[Gland]:
    for section, depth, width, radius in _DYNAMIC:
        yield Gland(
            round(section * INCH, 4),
            _inches(*depth),
            _inches(width - 0.005, width + 0.005),
            _inches(*radius),
        )


_GLANDS = {"dynamic": tuple(_glands())}

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
        f'ring = "{text}": AS568 has no general size -{number:03d}; nearest: {near}'
    )


def _quoted(names: Iterable[str]) -> str:
    return " and ".join(f'"{n}"' for n in names)
