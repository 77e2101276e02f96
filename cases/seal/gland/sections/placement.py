"""Placement of a section: its position in the groove, its sides that carry film and pressure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from softehl.cases.seal.meshing.outline import Arc, Line, Outline, OutlineError, Piece, Point, Shape

Named = tuple[Piece, str]
"""A piece of a contour, and the name of its side."""

FILM, PRESSURE = "FILM", "PRESSURE"
"""Layers of a drawing, or named sides of a mesh: what may carry film, what p_s acts on."""


@dataclass(frozen=True)
class Runs:
    """Numbers of the first piece of film and of pressure, and how many there are, cyclic.

    mirrored: whether the sealed side is at +z, so that film follows pressure clockwise.
    """

    film: tuple[int, int]
    pressure: tuple[int, int]
    mirrored: bool


def runs(names: Sequence[str]) -> Runs:
    """The runs of film and pressure among named pieces, counterclockwise.

    Raises OutlineError where one is missing, in several parts or away from the other.
    """
    film, pressure = (_run([n.upper() == name for n in names], name) for name in (FILM, PRESSURE))
    if sum(pressure) % len(names) == film[0]:
        return Runs(film, pressure, False)
    if sum(film) % len(names) == pressure[0]:
        return Runs(film, pressure, True)
    raise OutlineError(
        f"{PRESSURE} does not begin where {FILM} ends; sealed pressure acts from the end of the "
        "film round to the housing, without a gap"
    )


def _run(flags: Sequence[bool], name: str) -> tuple[int, int]:
    """First of the pieces that have a name, and how many they are; they follow one another."""
    marked = np.array(flags, dtype=np.bool_)
    if not marked.any():
        does = "may carry film" if name == FILM else "sealed pressure acts on"
        raise OutlineError(
            f"nothing is named {name}; put the part of the contour that {does} on a layer, or in "
            "a group, of that name"
        )
    starts = np.flatnonzero(marked & ~np.roll(marked, 1))
    if len(starts) != 1:
        text = "is the whole contour" if marked.all() else f"is {len(starts)} parts"
        raise OutlineError(f"{name} {text}; it must be one part, and not all of it")
    return int(starts[0]), int(marked.sum())


def named_shape(named: Sequence[Named], inner_diameter: float | None, name: str) -> Shape:
    """The section of a closed contour, either way round; with its sealed side at +z it is mirrored.

    Raises OutlineError.
    """
    outline = Outline([piece for piece, _ in named])
    if outline.pieces[0] != named[0][0]:  # it was clockwise
        named = _backwards(named)
    sides = runs([side for _, side in named])
    if sides.mirrored:
        named = _backwards([(mirrored(piece), side) for piece, side in named])
        outline = Outline([piece for piece, _ in named])
        sides = runs([side for _, side in named])
    outline = seated(outline, inner_diameter)
    positions = np.append(outline.starts, outline.length + outline.starts[1:])
    film, pressure = (
        (float(positions[first]), float(positions[first + count]))
        for first, count in (sides.film, sides.pressure)
    )
    return film_below(Shape(outline, film, pressure, name))


def mirrored(piece: Piece) -> Piece:
    """The piece with -z for z."""
    (a, b), (c, d) = piece.start, piece.end
    if isinstance(piece, Line):
        return Line((-a, b), (-c, d))
    return Arc((-a, b), (-c, d), (-piece.centre[0], piece.centre[1]), not piece.ccw)


def _backwards(named: Sequence[Named]) -> list[Named]:
    return [(piece.reversed(), side) for piece, side in reversed(named)]


def seated(outline: Outline, inner_diameter: float | None) -> Outline:
    """The outline with z = 0 in its middle and its lowest point at r = inner_diameter / 2.

    None leaves it at the radius where it was drawn.
    """
    return outline.moved(shift=seat(outline, inner_diameter))


def seat(outline: Outline, inner_diameter: float | None) -> Point:
    """Displacement to that place."""
    a, b, c, _ = outline.box
    return -0.5 * (a + c), 0.0 if inner_diameter is None else 0.5 * inner_diameter - b


def film_below(shape: Shape) -> Shape:
    """The shape, if its film holds its lowest point.  Raises OutlineError."""
    outline = shape.outline
    low, s = outline.box[1], np.linspace(*shape.film, 2001)
    if outline.at(s)[:, 1].min() > low + 1e-3 * outline.size:
        raise OutlineError(
            f"{FILM} does not hold the lowest point of the contour; the rod is below, at small r "
            "(y of a drawing)"
        )
    if low <= 0.0 < outline.box[3]:
        raise OutlineError(
            f"the contour reaches r = {low:g} mm; the axis of the rod is at r = 0, give "
            "inner_diameter to have it moved"
        )
    return shape
