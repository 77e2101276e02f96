"""The outline of a section: exact lines and arcs, parametrised by arc length, and what lies in it.

Lengths are mm; points are (z, r). An outline runs counterclockwise, its inside on the left, so that
along the rod, at the bottom, it goes towards +z, from the sealed to the air side.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import hypot, pi, radians, tau

import numpy as np
from scipy.special import roots_legendre

from softehl.cases.seal.meshing.curve_segments import (
    Arc,
    Line,
    OutlineError,
    Piece,
    Point,
    meetings,
    rounded,
)
from softehl.cases.seal.meshing.outline_checks import (
    CLOSED,
    require_closed,
    require_lengths,
    require_no_crossing,
    require_no_spikes,
)
from softehl.runtime.arrays import Array

__all__ = ["Arc", "Line", "Outline", "OutlineError", "Piece", "Point", "Shape", "rounded"]

_CORNER = radians(0.5)  # a turn between two pieces that is a corner
_RULE = 32  # points on a piece: exact for polynomials and, to rounding, the sines of a whole turn


class Outline:
    """A closed curve without crossings, counterclockwise; a clockwise one is turned round.

    pieces: in order, each beginning where the one before ends. s is the length in mm from the start
    of the first piece, modulo `length`. Raises OutlineError for pieces without length, a gap, a
    crossing or a spike.
    """

    def __init__(self, pieces: Sequence[Piece]) -> None:
        if not pieces:
            raise OutlineError("the outline has no pieces; at least a circle or three lines")
        self.pieces = tuple(pieces)
        require_lengths(self.pieces, CLOSED * self.size)
        require_closed(self.pieces, CLOSED * self.size)
        if self.area < 0.0:
            self.pieces = tuple(piece.reversed() for piece in reversed(self.pieces))
        require_no_spikes(self.pieces, self._turns)
        require_no_crossing(self.pieces, CLOSED * self.size)

    @classmethod
    def polygon(cls, points: Array | Sequence[Point]) -> Outline:
        """Straight lines through the points, closed; a last point equal to the first is dropped."""
        at = [(float(z), float(r)) for z, r in points]
        at = at[:-1] if len(at) > 1 and at[0] == at[-1] else at
        if len(at) < 3:
            raise OutlineError(f"{len(at)} points make no outline; at least 3 are needed")
        return cls([Line(a, b) for a, b in zip(at, at[1:] + at[:1], strict=True)])

    @classmethod
    def circle(cls, centre: Point, radius: float) -> Outline:
        """A circle; s = 0 at its lowest point."""
        (z, r), poles = centre, ((centre[0], centre[1] - radius), (centre[0], centre[1] + radius))
        return cls([Arc(poles[0], poles[1], (z, r)), Arc(poles[1], poles[0], (z, r))])

    @cached_property
    def disc(self) -> tuple[Point, float] | None:
        """Centre and radius, mm, of an outline that is a circle, in one arc or several."""
        first = self.pieces[0]
        if not isinstance(first, Arc):
            return None
        circle = Arc(first.start, first.start, first.centre)
        starts = np.array([piece.start for piece in self.pieces])
        away = np.linalg.norm(starts - np.array(circle.centre), axis=1) - circle.radius
        bent = all(abs(piece.curvature * circle.radius - 1.0) < CLOSED for piece in self.pieces)
        round_ = bent and np.abs(away).max() < CLOSED * self.size
        return (circle.centre, circle.radius) if round_ else None

    @property
    def size(self) -> float:
        """Diagonal of the box around the outline, mm."""
        a, b, c, d = self.box
        return hypot(c - a, d - b)

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Smallest z and r, largest z and r."""
        a, b, c, d = np.array([piece.box for piece in self.pieces]).T
        return float(a.min()), float(b.min()), float(c.max()), float(d.max())

    @cached_property
    def starts(self) -> Array:
        """s of the starts of the pieces, and the length: (pieces + 1,)."""
        return np.concatenate([[0.0], np.cumsum([piece.length for piece in self.pieces])])

    @property
    def length(self) -> float:
        """Of the whole outline, mm."""
        return float(self.starts[-1])

    def at(self, s: Array) -> Array:
        """Points (n, 2) at the lengths s (n,)."""
        return self._by_piece(s, lambda piece, t: piece.at(t))

    def tangent(self, s: Array) -> Array:
        """Unit tangents (n, 2) at the lengths s (n,); at a corner that of the piece behind it."""
        angle = self.heading(s)
        return np.stack([np.cos(angle), np.sin(angle)], axis=-1)

    def heading(self, s: Array) -> Array:
        """Angles (n,) of the tangents against +z, rad."""
        return self._by_piece(s, lambda piece, t: piece.heading(t)[:, None])[:, 0]

    def curvature(self, s: Array) -> Array:
        """Curvatures (n,) in 1/mm, positive where the outline bends inwards; corners have none."""
        return self._by_piece(s, lambda piece, t: np.full((len(t), 1), piece.curvature))[:, 0]

    def position(self, points: Array) -> Array:
        """s (n,) of the points of the outline nearest to those given, (n, 2)."""
        points = np.asarray(points, dtype=np.float64)
        best, result = np.full(len(points), np.inf), np.zeros(len(points))
        for start, piece in zip(self.starts, self.pieces, strict=False):
            s = piece.nearest(points)
            away = np.linalg.norm(piece.at(s) - points, axis=1)
            nearer = away < best - 1e-12 * self.size
            best, result = np.where(nearer, away, best), np.where(nearer, start + s, result)
        return result

    @cached_property
    def _turns(self) -> Array:
        """Angles (pieces,) by which the tangent turns left at the start of each piece, rad."""
        headings = [float(piece.heading(np.array([piece.length]))[0]) for piece in self.pieces]
        begins = [float(piece.heading(np.zeros(1))[0]) for piece in self.pieces]
        turn = np.array(begins) - np.roll(headings, 1)
        return np.asarray((turn + pi) % tau - pi)

    @property
    def kinks(self) -> Array:
        """s of the corners, rising."""
        return self.corners(_CORNER)

    def corners(self, minimum: float) -> Array:
        """s of the corners that turn by more than an angle, rad, rising."""
        return np.asarray(self.starts[:-1][np.abs(self._turns) > minimum])

    @property
    def area(self) -> float:
        """In mm^2."""
        return self._moment(lambda z, r: z)

    @property
    def centroid(self) -> Point:
        """Centre (z, r) of the area."""
        middle, area = self._middle, self.area
        z, r = (self._moment(f) / area for f in (lambda z, r: 0.5 * z**2, lambda z, r: z * r))
        return float(middle[0] + z), float(middle[1] + r)

    @property
    def polar_moment(self) -> float:
        """Polar moment of area about the centroid, mm^4."""
        away = np.array(self.centroid) - self._middle
        about = self._moment(lambda z, r: z**3 / 3.0 + z * r**2)
        return about - self.area * float(away @ away)

    def part(self, begin: float, end: float) -> list[Piece]:
        """The pieces between two places, counterclockwise, in order."""
        begin, selected = begin % self.length, list[Piece]()
        end = begin + (end - begin) % self.length
        bounds = [*self.starts[:-1], *(self.starts + self.length)]
        for number, (a, b) in enumerate(pairwise(bounds)):
            first, last = max(begin - a, 0.0), min(end, b) - a
            if last - first > CLOSED * self.size:
                selected.append(self.pieces[number % len(self.pieces)].part(first, last))
        return selected

    def level(self, r: float) -> Array:
        """s (n,) at which the outline is at a radius, in the order of z there; none twice."""
        a, _, c, _ = self.box
        within = CLOSED * self.size
        line = Line((a - self.size, r), (c + self.size, r))
        crossings = np.sort([p[0] for piece in self.pieces for p in meetings(line, piece, within)])
        z = crossings[np.diff(crossings, prepend=-np.inf) > 4.0 * within]
        return self.position(np.stack([z, np.full(len(z), r)], axis=1))

    def moved(self, scale: float = 1.0, shift: Point = (0.0, 0.0)) -> Outline:
        """The outline scaled about the origin by a positive factor, then shifted."""
        return Outline([piece.moved(scale, shift) for piece in self.pieces])

    @property
    def _middle(self) -> Array:
        a, b, c, d = self.box
        return np.array([0.5 * (a + c), 0.5 * (b + d)])

    def _moment(self, primitive: Callable[[Array, Array], Array]) -> float:
        """The integral of d(primitive)/dz over the area, by Green's theorem, about the middle."""
        t, w = roots_legendre(_RULE)
        total = 0.0
        for piece in self.pieces:
            s = 0.5 * piece.length * (t + 1.0)
            z, r = (piece.at(s) - self._middle).T
            rising = np.sin(piece.heading(s))
            total += 0.5 * piece.length * float(w @ (primitive(z, r) * rising))
        return total

    def _by_piece(self, s: Array, value: Callable[[Piece, Array], Array]) -> Array:
        s = np.mod(np.asarray(s, dtype=np.float64), self.length)
        index = np.clip(np.searchsorted(self.starts, s, side="right") - 1, 0, len(self.pieces) - 1)
        parts = [(index == k).nonzero()[0] for k in range(len(self.pieces))]
        shape = value(self.pieces[0], np.zeros(1)).shape[1]
        result = np.empty((len(s), shape))
        for k, part in enumerate(parts):
            if len(part):
                result[part] = value(self.pieces[k], s[part] - self.starts[k])
        return result


@dataclass(frozen=True, eq=False)
class Shape:
    """A section: its outline, the part that may carry a film, that which sealed pressure acts on.

    film: (s0, s1), from the sealed to the air side, counterclockwise. pressure: (s, s0), from the
    housing round to the start of the film, counterclockwise. All modulo the length of the outline,
    s0 < s1.
    chord: places between which, counterclockwise and with the film, a straight cut parts it.
    """

    outline: Outline
    film: tuple[float, float]
    pressure: tuple[float, float]
    name: str = "section"
    chord: tuple[float, float] | None = None

    @cached_property
    def parts(self) -> tuple[Outline, Outline]:
        """The outlines of what is on the film's side of the chord and of what is behind it.

        s = 0 of the first is where it begins on the outline, of the second where the chord does:
        both begin at the same point.
        """
        assert self.chord is not None
        begin, end = self.chord
        lower, far = self.outline.part(begin, end), self.outline.part(end, begin)
        return (
            Outline([*lower, Line(lower[-1].end, lower[0].start)]),
            Outline([Line(lower[0].start, lower[-1].end), *far]),
        )

    @classmethod
    def facing(cls, outline: Outline, crown: Point, name: str, steepest: float = 75.0) -> Shape:
        """The shape whose film may be wherever, around its lowest points, it is no steeper.

        crown: the point at which the sealed pressure ends, at the housing. steepest: degrees.
        """
        film = gentle(outline, radians(steepest))
        return cls(outline, film, (float(outline.position(np.array([crown]))[0]), film[0]), name)


def gentle(outline: Outline, steepest: float) -> tuple[float, float]:
    """The part (s0, s1) around the lowest point along which no tangent is steeper than an angle.

    s0 <= s1; s0 may be negative. Angles in rad against +z.
    """
    lowest = int(np.argmin([piece.box[1] for piece in outline.pieces]))
    at = outline.starts[lowest] + _lowest_of(outline.pieces[lowest])
    back, on = (_reach(outline, at, steepest, direction) for direction in (-1, 1))
    return float(at - back), float(at + on)


def _lowest_of(piece: Piece) -> float:
    """Length behind the start of a piece of its lowest point."""
    z = piece.at(np.array([0.5 * piece.length]))[0, 0]
    z = piece.centre[0] if isinstance(piece, Arc) else float(z)
    return float(piece.nearest(np.array([[z, piece.box[1]]]))[0])


def _reach(outline: Outline, at: float, steepest: float, direction: int) -> float:
    """Length from a place, forwards (1) or backwards (-1), on which the outline is that gentle."""
    count = len(outline.pieces)
    k = int(np.searchsorted(outline.starts, at, side="right")) - 1 if direction > 0 else (
        int(np.searchsorted(outline.starts, at, side="left")) - 1
    )  # fmt: skip
    k, gone = k % count, 0.0
    begin = (at - outline.starts[k]) % outline.length
    for _ in range(count):
        piece = outline.pieces[k]
        left = piece.length - begin if direction > 0 else begin
        angle = float(piece.heading(np.array([begin]))[0])
        angle = (angle + pi) % tau - pi
        if abs(angle) > steepest + 1e-9:
            break
        turn = piece.curvature * direction
        limit = steepest if turn > 0.0 else -steepest
        limit_distance = (limit - angle) / turn if turn else np.inf
        if limit_distance < left:
            return gone + limit_distance
        gone, k = gone + left, (k + direction) % count
        begin = 0.0 if direction > 0 else outline.pieces[k].length
    return gone
