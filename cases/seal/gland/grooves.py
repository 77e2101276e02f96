"""Standard glands: grooves that charts of makers give for a section, and what lies between them.

- Inch O-rings, "dynamic": the common chart of makers' handbooks for reciprocating seals (e.g.
  Apple Rubber's design guide, table A).
- Metric O-rings, "dynamic": a maker's chart of housing dimensions (orings.co.uk, O-ring housing);
  widths there have +0.25 mm.
- "pneumatic": a maker's chart for pneumatic, dynamic use (rhondamaseals.co.uk, groove sizes), with
  about half the squeeze.
- X-rings: the chart of Minnesota Rubber's Quad-Rings for non-rotary dynamic use.

Depths of a rod and of a piston are the same. Between two sections of a chart squeeze and width over
section are interpolated. A U-cup has no chart: the ground of its groove is half way between heel
and lips, and the groove is a tenth wider than the seal.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, NamedTuple

INCH = 25.4
"""mm"""

Kind = Literal["dynamic", "hydraulic", "pneumatic"]

KINDS: tuple[Kind, ...] = ("dynamic", "hydraulic", "pneumatic")
"""Uses of a reciprocating seal; "dynamic" is "hydraulic"."""

SAME = 0.03
"""Relative difference of two sections that have the same groove."""


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
class Groove:
    """A groove for one section, mm: depth from the rod to its ground, axial width, corner radius.

    The depth holds the clearance between rod and housing; the width is one without back-up rings.
    by_rule: whether it follows from a rule, not from a chart.
    """

    section_diameter: float
    depth: Range
    width: Range
    radius: Range | None = None
    by_rule: bool = False


def gland(section_diameter: float, kind: str = "dynamic", section: str = "round") -> Groove:
    """The gland for a section (mm) of this shape; kind: one of KINDS.

    Raises UnknownGlandError. A U-cup: `cup_gland`.
    """
    if kind not in KINDS:
        raise UnknownGlandError(f'gland = "{kind}" is not known; there is {_quoted(KINDS)}')
    round_rings = _PNEUMATIC if kind == "pneumatic" else _DYNAMIC
    chart = _X_RINGS if section == "x_ring" else round_rings
    near = min(chart, key=lambda g: abs(g.section_diameter - section_diameter))
    if abs(section_diameter - near.section_diameter) <= SAME * near.section_diameter:
        return near
    for below, above in pairwise(chart):
        if below.section_diameter < section_diameter < above.section_diameter:
            return _between(below, above, section_diameter)
    scale = section_diameter / near.section_diameter
    raise UnknownGlandError(
        f'gland = "{kind}" has no groove for a section of {section_diameter:g} mm (only '
        f"{chart[0].section_diameter:.3g} to {chart[-1].section_diameter:.3g} mm); give squeeze "
        "and groove_width instead: in the proportions of the nearest one, squeeze = "
        f"{squeeze(near.section_diameter, near.depth.middle):.3g} and groove_width = "
        f"{scale * near.width.middle:.3g}"
    )


def cup_gland(height: float, heel_height: float, width: float) -> Groove:
    """The gland of a U-cup whose free lips and heel have these heights, mm."""
    depth, groove = 0.5 * (height + heel_height), 1.1 * width
    return Groove(height, Range(depth, depth), Range(groove, groove), by_rule=True)


def squeeze(section_diameter: float, depth: float) -> float:
    """Part of the free section that the gland takes away, %."""
    return 100.0 * (1.0 - depth / section_diameter)


def _between(below: Groove, above: Groove, section: float) -> Groove:
    """A gland in proportions that are interpolated between two sections."""
    part = (section - below.section_diameter) / (above.section_diameter - below.section_diameter)

    def size(name: Literal["depth", "width"]) -> Range:
        low, high = (getattr(g, name).middle / g.section_diameter for g in (below, above))
        length = round(section * ((1.0 - part) * low + part * high), 2)
        return Range(length, length)

    return Groove(section, size("depth"), size("width"), by_rule=True)


# inch: section, depth, width (+- 0.005), corner radius
_INCH = (
    (0.070, (0.055, 0.057), 0.095, (0.005, 0.015)),
    (0.103, (0.087, 0.090), 0.145, (0.005, 0.020)),
    (0.139, (0.119, 0.123), 0.185, (0.005, 0.030)),
    (0.210, (0.183, 0.188), 0.285, (0.005, 0.050)),
    (0.275, (0.234, 0.240), 0.375, (0.005, 0.060)),
)

# mm: section, depth, width
_HYDRAULIC_MM = (
    *((1.5, 1.25, 2.0), (1.8, 1.45, 2.4), (2.0, 1.65, 2.7), (2.4, 2.05, 3.2), (2.5, 2.15, 3.3)),
    *((2.65, 2.25, 3.6), (3.0, 2.6, 4.0), (3.55, 3.1, 4.8), (4.0, 3.5, 5.2), (4.5, 4.0, 5.8)),
    *((5.0, 4.4, 6.6), (5.3, 4.7, 7.1), (5.7, 5.0, 7.2), (6.0, 5.3, 7.4), (6.5, 5.7, 8.0)),
    (7.0, 6.1, 9.5),
)
_PNEUMATIC_MM = (
    *((1.5, 1.35, 1.9), (1.78, 1.55, 2.3), (2.0, 1.8, 2.4), (2.4, 2.15, 2.9), (2.5, 2.25, 3.0)),
    *((2.62, 2.35, 3.1), (3.0, 2.75, 3.6), (3.53, 3.25, 4.2), (4.0, 3.7, 4.8), (4.5, 4.2, 5.4)),
    *((5.0, 4.65, 6.0), (5.33, 4.95, 6.4), (5.7, 5.35, 6.9), (6.0, 5.65, 7.2), (6.5, 6.1, 7.8)),
    *((7.0, 6.6, 8.4), (7.5, 7.1, 9.0), (8.0, 7.6, 9.6)),
)

# inch: section, depth, width (+0.005)
_QUAD_INCH = (
    *((0.070, 0.061, 0.080), (0.103, 0.094, 0.115), (0.139, 0.128, 0.155)),
    *((0.210, 0.196, 0.240), (0.275, 0.256, 0.310)),
)


def _inches(low: float, high: float) -> Range:
    return Range(round(low * INCH, 4), round(high * INCH, 4))


def _metric(rows: Iterable[tuple[float, float, float]]) -> list[Groove]:
    return [Groove(d, Range(t, t), Range(b, b)) for d, t, b in rows]


def _chart(*rows: Sequence[Groove]) -> tuple[Groove, ...]:
    return tuple(sorted((g for some in rows for g in some), key=lambda g: g.section_diameter))


_DYNAMIC = _chart(
    [
        Groove(
            round(section * INCH, 4),
            _inches(*depth),
            _inches(width - 0.005, width + 0.005),
            _inches(*radius),
        )
        for section, depth, width, radius in _INCH
    ],
    _metric(_HYDRAULIC_MM),
)
_PNEUMATIC = _chart(_metric(_PNEUMATIC_MM))
_X_RINGS = _chart(
    [
        replace(g, width=Range(g.width.low, round(g.width.low + 0.005 * INCH, 4)))
        for g in _metric([(round(INCH * d, 4), INCH * t, INCH * b) for d, t, b in _QUAD_INCH])
    ]
)


def _quoted(names: Iterable[str]) -> str:
    return " and ".join(f'"{n}"' for n in names)
