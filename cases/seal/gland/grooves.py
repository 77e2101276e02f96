"""Standard glands: grooves that charts of makers give for a section, and what lies between them.

`grooves.csv` holds the charts:

- Inch O-rings, "dynamic": the common chart of makers' handbooks for reciprocating seals (e.g.
  Apple Rubber's design guide, table A).
- Metric O-rings, "dynamic": a maker's chart of housing dimensions (orings.co.uk, O-ring housing);
  widths there have +0.25 mm. Its rows for inch sections differ from the inch chart by at most 1.9 %
  in depth and 2.3 % in width.
- "pneumatic": a maker's chart for pneumatic, dynamic use (rhondamaseals.co.uk, groove sizes), with
  about half the squeeze.
- 8.4 mm, "dynamic": the groove of JIS B 2401-2.
- X-rings: the chart of Minnesota Rubber's Quad-Rings for non-rotary dynamic use.

Depths of a rod and of a piston are the same. Between two sections of a chart squeeze and width over
section are interpolated; below the first and above the last they are those of the nearest, for
sections of 1 to 10 mm. A U-cup has no chart: the ground of its groove is half way between heel
and lips, and the groove is a tenth wider than the seal.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Literal, get_args

from softehl.cases.seal.gland.tables import rows

INCH = 25.4
"""mm"""

Kind = Literal["dynamic", "hydraulic", "pneumatic"]
"""Uses of a reciprocating seal; "dynamic" is "hydraulic"."""

KINDS: tuple[Kind, ...] = get_args(Kind)


@dataclass(frozen=True)
class Groove:
    """A groove for one section, mm: depth from the rod to its ground, axial width.

    Both are the middles of what a chart allows. The depth holds the clearance between rod and
    housing; the width is one without back-up rings. by_rule: whether it follows from a rule, not
    from a chart.
    """

    section_diameter: float
    depth: float
    width: float
    by_rule: bool = False


def gland(section_diameter: float, kind: Kind = "dynamic", section: str = "round") -> Groove:
    """The gland for a section (mm) of this shape; a U-cup has `cup_gland`.  ValueError."""
    round_rings = "pneumatic" if kind == "pneumatic" else "dynamic"
    chart = _chart("x_ring" if section == "x_ring" else round_rings)
    nearest = min(chart, key=lambda g: abs(g.section_diameter - section_diameter))
    # ISO 3601 and AS568 have the same grooves for sections to 1.2 % apart, 2.65 and 2.62 mm
    if abs(section_diameter - nearest.section_diameter) <= 0.015 * nearest.section_diameter:
        return nearest
    for below, above in pairwise(chart):
        if below.section_diameter < section_diameter < above.section_diameter:
            return _between(below, above, section_diameter)
    scale = section_diameter / nearest.section_diameter
    if 1.0 <= section_diameter <= 10.0:
        depth, width = round(scale * nearest.depth, 2), round(scale * nearest.width, 2)
        return Groove(section_diameter, depth, width, by_rule=True)
    raise ValueError(
        f'gland = "{kind}" has no groove for a section of {section_diameter:g} mm (only '
        "1 to 10 mm); give squeeze and "
        "groove_width instead: in the proportions of the nearest one, squeeze = "
        f"{squeeze(nearest.section_diameter, nearest.depth):.3g} and groove_width = "
        f"{scale * nearest.width:.3g}"
    )


def cup_gland(height: float, heel_height: float, width: float) -> Groove:
    """The gland of a U-cup whose free lips and heel have these heights, mm."""
    return Groove(height, 0.5 * (height + heel_height), 1.1 * width, by_rule=True)


def squeeze(section_diameter: float, depth: float) -> float:
    """Part of the free section that the gland takes away, %."""
    return 100.0 * (1.0 - depth / section_diameter)


def _between(below: Groove, above: Groove, section: float) -> Groove:
    """A gland in proportions that are interpolated between two sections."""
    part = (section - below.section_diameter) / (above.section_diameter - below.section_diameter)

    def size(low: float, high: float) -> float:
        low, high = low / below.section_diameter, high / above.section_diameter
        return round(section * ((1.0 - part) * low + part * high), 2)

    depth, width = size(below.depth, above.depth), size(below.width, above.width)
    return Groove(section, depth, width, by_rule=True)


@cache
def _chart(name: str) -> tuple[Groove, ...]:
    """The grooves of a chart by their sections: "dynamic", "pneumatic" or "x_ring"."""
    grooves = (_groove(row) for row in rows("grooves.csv") if row["chart"] == name)
    return tuple(sorted(grooves, key=lambda groove: groove.section_diameter))


def _groove(row: dict[str, str]) -> Groove:
    unit = INCH if row["unit"] == "in" else 1.0
    names = ("section", "depth_low", "depth_high", "width_low", "width_high")
    section, *limits = (round(unit * float(row[name]), 4) for name in names)
    return Groove(section, 0.5 * (limits[0] + limits[1]), 0.5 * (limits[2] + limits[3]))
