"""Straight and circular pieces of an outline, in (z, r), mm, and where two of them meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import atan2, cos, hypot, pi, radians, sin, tan, tau
from typing import TypeAlias

import numpy as np

from softehl.errors import SoftehlError
from softehl.runtime.arrays import Array

Point: TypeAlias = tuple[float, float]

_STRAIGHT, _BACK = radians(0.5), radians(179.9)  # turns at which a fillet is none, or impossible


class OutlineError(SoftehlError, ValueError):
    """An outline that bounds no section: what is wrong, and where."""


@dataclass(frozen=True)
class Line:
    """A straight piece."""

    start: Point
    end: Point

    @cached_property
    def length(self) -> float:
        """In mm."""
        return hypot(self.end[0] - self.start[0], self.end[1] - self.start[1])

    @property
    def curvature(self) -> float:
        """Of a straight piece: none."""
        return 0.0

    def at(self, s: Array) -> Array:
        """Points (n, 2) at the lengths s (n,) behind the start."""
        start, end = np.array(self.start), np.array(self.end)
        return np.asarray(start + (s / self.length)[:, None] * (end - start))

    def heading(self, s: Array) -> Array:
        """Angles (n,) of the tangent against +z, rad; steady along the piece."""
        angle = atan2(self.end[1] - self.start[1], self.end[0] - self.start[0])
        return np.full(len(s), angle)

    def nearest(self, points: Array) -> Array:
        """Lengths (n,) behind the start of the nearest points of the piece to those, (n, 2)."""
        direction = (np.array(self.end) - np.array(self.start)) / self.length
        return np.asarray(np.clip((points - np.array(self.start)) @ direction, 0.0, self.length))

    def reversed(self) -> Line:
        """Piece from its end to its start."""
        return Line(self.end, self.start)

    def part(self, begin: float, end: float) -> Line:
        """The piece between two lengths behind its start."""
        return Line(*_end_points(self, begin, end))

    def moved(self, scale: float, shift: Point) -> Line:
        """The piece scaled about the origin, then shifted."""
        return Line(_moved(self.start, scale, shift), _moved(self.end, scale, shift))

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Smallest z and r, largest z and r."""
        (a, b), (c, d) = self.start, self.end
        return min(a, c), min(b, d), max(a, c), max(b, d)


@dataclass(frozen=True)
class Arc:
    """A circular piece about `centre`, counterclockwise or not; a whole circle if start = end."""

    start: Point
    end: Point
    centre: Point
    ccw: bool = True

    @cached_property
    def radius(self) -> float:
        """In mm, that of the start."""
        return hypot(self.start[0] - self.centre[0], self.start[1] - self.centre[1])

    @cached_property
    def first(self) -> float:
        """Angle of the start about the centre, rad."""
        return atan2(self.start[1] - self.centre[1], self.start[0] - self.centre[0])

    @cached_property
    def sweep(self) -> float:
        """Angle from start to end, rad, positive counterclockwise; a whole turn if they agree."""
        last = atan2(self.end[1] - self.centre[1], self.end[0] - self.centre[0])
        turn = (last - self.first) % tau if self.ccw else (self.first - last) % tau
        if turn == 0.0:
            turn = tau
        return turn if self.ccw else -turn

    @cached_property
    def length(self) -> float:
        """In mm."""
        return self.radius * abs(self.sweep)

    @property
    def curvature(self) -> float:
        """1/mm, positive where the piece turns left."""
        return (1.0 if self.ccw else -1.0) / self.radius

    def at(self, s: Array) -> Array:
        """Points (n, 2) at the lengths s (n,) behind the start."""
        angle = self.first + s * self.curvature
        direction = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        return np.asarray(np.array(self.centre) + self.radius * direction)

    def heading(self, s: Array) -> Array:
        """Angles (n,) of the tangent against +z, rad; steady along the piece."""
        turn = 0.5 * pi if self.ccw else -0.5 * pi
        begin = (self.first + turn + pi) % tau - pi
        return np.asarray(begin + s * self.curvature)

    def nearest(self, points: Array) -> Array:
        """Lengths (n,) behind the start of the nearest points of the piece to those, (n, 2)."""
        away = points - np.array(self.centre)
        angle = np.arctan2(away[:, 1], away[:, 0])
        turn = np.mod((angle - self.first) * (1.0 if self.ccw else -1.0), tau)
        beyond = turn > abs(self.sweep)
        nearer_end = turn - abs(self.sweep) < tau - turn
        return np.asarray(
            self.radius * np.where(beyond, np.where(nearer_end, abs(self.sweep), 0.0), turn)
        )

    def reversed(self) -> Arc:
        """Piece from its end to its start."""
        return Arc(self.end, self.start, self.centre, not self.ccw)

    def part(self, begin: float, end: float) -> Arc:
        """The piece between two lengths behind its start."""
        return Arc(*_end_points(self, begin, end), self.centre, self.ccw)

    def moved(self, scale: float, shift: Point) -> Arc:
        """The piece scaled about the origin, then shifted."""
        start, end, centre = (
            _moved(point, scale, shift) for point in (self.start, self.end, self.centre)
        )
        return Arc(start, end, centre, self.ccw)

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Smallest z and r, largest z and r."""
        points = [self.start, self.end]
        for k in range(4):
            turn = ((0.5 * pi * k - self.first) * (1.0 if self.ccw else -1.0)) % tau
            if turn < abs(self.sweep):
                z, r = ((1, 0), (0, 1), (-1, 0), (0, -1))[k]
                points.append((self.centre[0] + self.radius * z, self.centre[1] + self.radius * r))
        z_all, r_all = [z for z, _ in points], [r for _, r in points]
        return min(z_all), min(r_all), max(z_all), max(r_all)


Piece: TypeAlias = Line | Arc


def _end_points(piece: Piece, begin: float, end: float) -> tuple[Point, Point]:
    """The points at two lengths behind the start of a piece; its own ends exactly."""
    (a, b), (c, d) = piece.at(np.array([begin, end])).tolist()
    return piece.start if begin <= 0.0 else (a, b), piece.end if end >= piece.length else (c, d)


def rounded(points: Sequence[Point], radii: Sequence[float] | float) -> list[Piece]:
    """The closed polygon of the points with fillets of these radii, 0 = a corner.

    Raises OutlineError where a fillet is longer than the sides that it joins.
    """
    count = len(points)
    each = [float(radii)] * count if isinstance(radii, int | float) else [float(r) for r in radii]
    fillets = [
        _fillet(points[k - 1], points[k], points[(k + 1) % count], each[k]) for k in range(count)
    ]
    pieces: list[Piece] = []
    for k, (arc, end) in enumerate((f[1], f[2]) for f in fillets):
        begin, after = points[k], points[(k + 1) % count]
        side = hypot(after[0] - begin[0], after[1] - begin[1])
        next_cut, cut = fillets[(k + 1) % count][0], fillets[k][0]
        if cut + next_cut > side * (1.0 + 1e-9):
            raise OutlineError(
                f"the fillets of {each[k]:g} and {each[(k + 1) % count]:g} mm at the ends of a "
                f"side take {cut + next_cut:.4g} of its {side:.4g} mm; give smaller ones"
            )
        pieces += [arc] if arc else []
        following = fillets[(k + 1) % count][1]
        until = following.start if following else after
        if side - cut - next_cut > 1e-9 * side:
            pieces.append(Line(end, until))
    return pieces


def _fillet(
    previous: Point, at: Point, after: Point, radius: float
) -> tuple[float, Arc | None, Point]:
    """Shortened sides of a corner with a fillet, the fillet, and its end."""
    if radius == 0.0:
        return 0.0, None, at
    a, b = np.subtract(at, previous), np.subtract(after, at)
    a, b = a / np.hypot(a[0], a[1]), b / np.hypot(b[0], b[1])
    turn = atan2(a[0] * b[1] - a[1] * b[0], float(a @ b))
    if abs(turn) < _STRAIGHT or abs(turn) > _BACK:
        return 0.0, None, at
    cut = radius * abs(tan(0.5 * turn))
    left = 1.0 if turn > 0.0 else -1.0
    start, end = np.array(at) - cut * a, np.array(at) + cut * b
    centre = start + left * radius * np.array([-a[1], a[0]])
    corners = [(float(p[0]), float(p[1])) for p in (start, end, centre)]
    return cut, Arc(corners[0], corners[1], corners[2], turn > 0.0), corners[1]


def meetings(one: Piece, other: Piece, within: float) -> list[Point]:
    """The points that two pieces have in common, to an accuracy of `within`, mm.

    Of pieces that lie upon one another, ends that they share are named.
    """
    if isinstance(one, Line) and isinstance(other, Line):
        points = _line_line(one, other)
    elif isinstance(one, Line) and isinstance(other, Arc):
        points = _line_circle(one, other, within)
    elif isinstance(one, Arc) and isinstance(other, Line):
        points = _line_circle(other, one, within)
    else:
        assert isinstance(one, Arc)
        assert isinstance(other, Arc)
        points = _circle_circle(one, other, within)
    points += [one.start, one.end, other.start, other.end]
    return [p for p in points if _on(one, p, within) and _on(other, p, within)]


def _on(piece: Piece, point: Point, within: float) -> bool:
    at = piece.at(piece.nearest(np.array([point])))[0]
    return hypot(at[0] - point[0], at[1] - point[1]) <= within


def _line_line(one: Line, other: Line) -> list[Point]:
    a, b = np.array(one.start), np.array(one.end)
    c, d = np.array(other.start), np.array(other.end)
    u, v, w = b - a, d - c, c - a
    cross = u[0] * v[1] - u[1] * v[0]
    if abs(cross) <= 1e-12 * one.length * other.length:
        return []
    point = a + (w[0] * v[1] - w[1] * v[0]) / cross * u
    return [(float(point[0]), float(point[1]))]


def _line_circle(line: Line, arc: Arc, within: float) -> list[Point]:
    direction = (np.array(line.end) - np.array(line.start)) / line.length
    start = np.array(line.start) - np.array(arc.centre)
    middle = -float(start @ direction)
    foot = start + middle * direction
    under = arc.radius**2 - float(foot @ foot)
    if under < -2.0 * within * arc.radius:
        return []
    half = max(under, 0.0) ** 0.5
    points = [np.array(arc.centre) + foot + side * half * direction for side in (-1.0, 0.0, 1.0)]
    return [(float(p[0]), float(p[1])) for p in points]


def _circle_circle(one: Arc, other: Arc, within: float) -> list[Point]:
    z, r = other.centre[0] - one.centre[0], other.centre[1] - one.centre[1]
    distance = hypot(z, r)
    if distance <= within:
        return []
    along = (distance**2 + one.radius**2 - other.radius**2) / (2.0 * distance)
    half = max(one.radius**2 - along**2, 0.0) ** 0.5
    angle = atan2(r, z)
    c, s = cos(angle), sin(angle)
    return [
        (one.centre[0] + along * c - side * half * s, one.centre[1] + along * s + side * half * c)
        for side in (-1.0, 0.0, 1.0)
    ]


def _moved(point: Point, scale: float, shift: Point) -> Point:
    return scale * point[0] + shift[0], scale * point[1] + shift[1]
