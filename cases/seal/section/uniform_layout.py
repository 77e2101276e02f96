"""The layout of a case before its contact is known: equal segments on its arc."""

from __future__ import annotations

from math import pi, radians

from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.section.layout import Layout
from softehl.runtime.mesh.outline import Shape, gentle
from softehl.runtime.mesh.section_mesh import Sizes
from softehl.runtime.mesh.spacing import Spacing, Spot, graded

EDGE_ANGLES = range(27, 70, 3)
"""Places where a section may meet the edge of the gap under pressure, degrees from the bottom:
every 6 degrees, or from 15 to 81, change h* and friction of an O-ring by 0.003 and 0.14 %."""

LONG_PLACED = 33
"""Segments at density 1 of an arc that the contact has placed: 27 or 42 change h* of an O-ring by
0.03 %."""

LONG_OPEN = 42
"""Segments where the edge of an open gap is to be resolved too: 33 or 54 change h* and friction of
an O-ring by 0.03 and 0.07 %."""

BEYOND = 0.3
"""Length beyond a film as drawn in which contact is looked for on the air side, in heights of a
section. Without it one film of thirty, of five sections at 2 to 12 MPa, is not found: the instroke
of a trapezoid at 12 MPa."""


def uniform_layout(p: Seal) -> Layout:
    """The section of a case with equal segments on its arc, the given one or a wide guide."""
    shape = p.free_section
    if p.mesh == "file":
        return Layout(shape, shape.film, Sizes(p.file_mesh.arc), base=p.file_mesh)
    if p.given_arc:
        start, end = (radians(angle) * 0.5 * p.section_diameter for angle in p.given_arc)
        return Layout(shape, (start, end), Sizes())
    if p.opens:
        return Layout(shape, shape.film, Sizes(LONG_OPEN, _fine_at_edge(shape)))
    # under pressure a section rolls; without, both its sides are to be alike
    rolls = shape.outline.disc is None and p.sealed_pressure > 0.0
    film = _reaching(shape, BEYOND * p.section_diameter if rolls else 0.0)
    return Layout(shape, film, Sizes(p.lobes * LONG_PLACED))


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


def _fine_at_edge(shape: Shape) -> Spacing:
    """Of the film of a disc: fine where it may meet the edge of an open gap, wherever that is."""
    begin, end = shape.film
    degree = radians(0.5) * (shape.outline.box[2] - shape.outline.box[0])
    spots = [Spot(angle * degree - begin) for angle in EDGE_ANGLES]
    length = end - begin
    return graded(length, spots, 2 * LONG_OPEN, coarsest=0.05 * length, rate=0.3)
