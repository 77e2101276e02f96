"""The layout of a case before its contact is known: equal segments on its arc."""

from __future__ import annotations

from dataclasses import replace
from math import pi, radians

from softehl.cases.seal.gland.parameters import ORing
from softehl.cases.seal.section.layout import Layout
from softehl.cases.seal.section.outline_layout import FileLayout, OutlineLayout
from softehl.cases.seal.section.round_layout import RoundLayout
from softehl.runtime.mesh.outline import Shape, gentle
from softehl.runtime.mesh.sections import Disc
from softehl.runtime.mesh.spacing import Spacing, Spot, graded

GUIDE_ARC, GUIDE_TOP = 75.0, 118.0
"""Half the angle of the arc on which contact is first looked for, and where the top begins."""

EDGE_ANGLES = range(27, 70, 3)
"""Where a section meets the edge of the gap under pressure, degrees from the bottom."""

LONG_OPEN = 42
"""The same where the edge of an open gap is to be resolved too."""

LONG_PLACED = 33
"""Segments at density 1 of an arc that the contact has placed."""

BEYOND = 0.3
"""How far beyond a film as drawn contact is looked for on the air side, in heights of a section."""


def uniform_layout(p: ORing) -> Layout:
    """The section of a case with equal segments on its arc, the given one or a wide guide."""
    if p.mesh == "file":
        return FileLayout.of(p)
    if not p.round:
        shape = p.free_section
        rolls = p.sealed_pressure > 0.0  # else both sides are to be alike
        film = _reaching(shape, BEYOND * p.section_diameter if rolls else 0.0)
        return OutlineLayout(shape, film, None, p.lobes * LONG_PLACED)
    radius = 0.5 * p.section_diameter
    centre = 0.0, 0.5 * p.inner_diameter + radius
    if p.given_arc:
        return RoundLayout(Disc(*centre, radius, *p.given_arc))
    long = LONG_OPEN if p.opens else LONG_PLACED
    guide = Disc(*centre, radius, -GUIDE_ARC, GUIDE_ARC, top=GUIDE_TOP, long=long)
    return RoundLayout(replace(guide, spacing=_fine_at_edge(guide)) if p.opens else guide)


def _reaching(shape: Shape, most: float) -> tuple[float, float]:
    """The film (s0, s1) of a shape and as much as `most`, mm, of what faces the rod behind it.

    The sealed pressure rolls it onto the rod. A cap ends it too.
    """
    begin, end = shape.film
    length = shape.outline.length
    _, steep = gentle(shape.outline, 0.5 * pi)
    last = (steep - begin) % length if shape.chord is None else (shape.chord[1] - begin) % length
    film = (end - begin) % length
    return begin, begin + min(max(film, last), film + most)


def _fine_at_edge(guide: Disc) -> Spacing:
    """Of a guide: fine where the section may meet the edge of an open gap, wherever that is."""
    degree = radians(1.0) * guide.radius
    spots = [Spot((GUIDE_ARC + angle) * degree) for angle in EDGE_ANGLES]
    length = 2.0 * GUIDE_ARC * degree
    return graded(length, spots, 2 * guide.long, coarsest=0.05 * length, rate=0.3)
