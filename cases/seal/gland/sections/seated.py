"""Parts of a section from a file that carry film and pressure, and its place in the groove."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from softehl.runtime.mesh.outline import Arc, Line, Outline, OutlineError, Piece, Point, Shape

Named = tuple[Piece, str]
"""A piece of a contour, and the name of its side."""

FILM, PRESSURE = "FILM", "PRESSURE"
"""Layers of a drawing, or named sides of a mesh: what may carry film, what p_s acts on."""


@dataclass(frozen=True)
class Runs:
    """Numbers of the first and, behind it, the last piece of film and pressure, cyclic.

    mirrored: whether the sealed side is at +z, so that film follows pressure clockwise.
    """

    film: tuple[int, int]
    pressure: tuple[int, int]
    mirrored: bool


def runs(names: Sequence[str], file: str) -> Runs:
    """The runs of film and pressure among named pieces, counterclockwise.

    Raises OutlineError, one line, where one is missing, in several parts or away from the other.
    """
    film, pressure = (_run([n.upper() == x for n in names], x, file) for x in (FILM, PRESSURE))
    count = len(names)
    if sum(pressure) % count == film[0]:
        return Runs(film, pressure, False)
    if sum(film) % count == pressure[0]:
        return Runs(film, pressure, True)
    raise OutlineError(
        f"{file}: {PRESSURE} does not begin where {FILM} ends; sealed pressure acts from the end "
        "of the film round to the housing, without a gap"
    )


def _run(flags: Sequence[bool], name: str, file: str) -> tuple[int, int]:
    """First of the pieces that have a name, and how many they are; they follow one another."""
    here = np.array(flags, dtype=np.bool_)
    if not here.any():
        raise OutlineError(
            f"{file}: nothing is named {name}; put the part of the contour that "
            + ("may carry film" if name == FILM else "sealed pressure acts on")
            + " on a layer, or in a group, of that name"
        )
    starts = np.flatnonzero(here & ~np.roll(here, 1))
    if len(starts) != 1:
        words = "is the whole contour" if here.all() else f"is {len(starts)} parts"
        raise OutlineError(f"{file}: {name} {words}; it must be one part, and not all of it")
    return int(starts[0]), int(here.sum())


def named_shape(named: Sequence[Named], inner_diameter: float | None, file: str) -> Shape:
    """The section of a closed contour, either way round; with its sealed side at +z it is mirrored.

    Raises OutlineError, one line.
    """
    outline = outline_in(file, [piece for piece, _ in named])
    if outline.pieces[0] != named[0][0]:  # it was clockwise
        named = _backwards(named)
    found = runs([name for _, name in named], file)
    if found.mirrored:
        named = _backwards([(mirrored(piece), name) for piece, name in named])
        outline = Outline([piece for piece, _ in named])
        found = runs([name for _, name in named], file)
    outline = seated(outline, inner_diameter)
    film, pressure = (
        (float(outline.starts[first]), float(outline.starts[(first + count) % len(named)]))
        for first, count in (found.film, found.pressure)
    )
    return require_film_below(Shape(outline, film, pressure, Path(file).stem), file)


def outline_in(file: str, pieces: Sequence[Piece]) -> Outline:
    """The outline of pieces; an OutlineError names the file."""
    try:
        return Outline(pieces)
    except OutlineError as error:
        raise OutlineError(f"{file}: {error}") from None


def mirrored(piece: Piece) -> Piece:
    """The piece with -z for z."""
    (a, b), (c, d) = piece.start, piece.end
    if isinstance(piece, Line):
        return Line((-a, b), (-c, d))
    return Arc((-a, b), (-c, d), (-piece.centre[0], piece.centre[1]), not piece.ccw)


def _backwards(named: Sequence[Named]) -> list[Named]:
    return [(piece.reversed(), name) for piece, name in reversed(named)]


def seated(outline: Outline, inner_diameter: float | None) -> Outline:
    """The outline with z = 0 in its middle and its lowest point at r = inner_diameter / 2.

    None leaves it at the radius where it was drawn.
    """
    return outline.moved(shift=seat(outline, inner_diameter))


def seat(outline: Outline, inner_diameter: float | None) -> Point:
    """Displacement to that place."""
    a, b, c, _ = outline.box
    return -0.5 * (a + c), 0.0 if inner_diameter is None else 0.5 * inner_diameter - b


def require_film_below(shape: Shape, file: str) -> Shape:
    """The shape, if its film holds its lowest point.  Raises OutlineError."""
    outline = shape.outline
    s = np.linspace(shape.film[0], shape.film[0] + _part(shape.film, outline.length), 2001)
    low, size = outline.box[1], outline.size
    if outline.at(s)[:, 1].min() > low + 1e-3 * size:
        raise OutlineError(
            f"{file}: {FILM} does not hold the lowest point of the contour; the rod is below, at "
            "small r (y of a drawing)"
        )
    if low <= 0.0 < outline.box[3]:
        raise OutlineError(
            f"{file}: the contour reaches r = {low:g} mm; the axis of the rod is at r = 0, give "
            "inner_diameter to have it moved"
        )
    return shape


def _part(ends: tuple[float, float], length: float) -> float:
    return (ends[1] - ends[0]) % length
