"""Surfaces of rigid bodies for contact: nearest planes, circles, spheres and cylinders to points.

Near a point every surface is one of these. Of a polyline, it is the plane of the nearest segment,
or a circle of radius 0 about the nearest corner.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

import numpy as np

from softehl.errors import SoftehlError
from softehl.runtime.arrays import Array

Place: TypeAlias = Sequence[float] | Array
"""Coordinates or components (dim,)."""
_CHUNK = 1 << 20  # distances of points and segments that are computed at once
_NEAR = 1e-12
"""Of the size of a polyline: a corner that is nearer than that has no direction."""


class SurfaceError(SoftehlError, ValueError):
    """A surface that does not exist; the message says what is allowed."""


@dataclass(frozen=True, eq=False)
class Nearest:
    """The simple surface next to each of n points, as `rigid_touch` takes it.

    points: (n, dim). flat: (n,) 1 for a plane. side: (n,) 1 with free space outside of the radius,
    -1 inside. radius: (n,). centre: (n, dim), or a point of the plane. axis: (n, dim) of a
    cylinder, zero for a sphere or circle, or the normal of the plane into free space.
    """

    points: Array
    flat: Array
    side: Array
    radius: Array
    centre: Array
    axis: Array

    @property
    def gap(self) -> Array:
        """Distances (n,) of the points, negative inside of the rigid body."""
        offsets = self.points - self.centre
        along = np.einsum("nc,nc->n", offsets, self.axis)
        length = np.linalg.norm(offsets - along[:, None] * self.axis, axis=1)
        return np.asarray(np.where(self.flat > 0.0, along, self.side * (length - self.radius)))

    @property
    def columns(self) -> Array:
        """Data of the law of a point, (n, 3 + 2 dim)."""
        return np.column_stack([self.flat, self.side, self.radius, self.centre, self.axis])


class Surface(Protocol):
    """Surface of a rigid body."""

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        ...

    def nearest(self, y: Array) -> Nearest:
        """The simple surfaces next to points (n, dim)."""
        ...


class Plane:
    """A plane, in 2-D a straight line.

    Parameters
    ----------
    point : tuple of float
        A point of it (dim,) [mm].
    normal : tuple of float
        Direction (dim,) into free space, where the deformable body is.

    Raises
    ------
    SurfaceError
        An argument has another shape, or the normal no direction.
    """

    def __init__(self, point: Place, normal: Place) -> None:
        self.point = _vector("Plane", "point", point)
        self.normal = _direction("Plane", "normal", normal, len(self.point))

    def __repr__(self) -> str:
        """The call."""
        return f"Plane({_text(self.point)}, normal={_text(self.normal)})"

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return len(self.point)

    def nearest(self, y: Array) -> Nearest:
        """The simple surfaces next to points (n, dim)."""
        return _everywhere(y, 1.0, 1.0, 0.0, self.point, self.normal)


class Sphere:
    """A sphere; in 2-D a circle: in plane strain a cylinder, in axisymmetry a ring around the axis.

    With its centre on the axis the circle is a sphere in axisymmetry.

    Parameters
    ----------
    centre : tuple of float
        Centre (dim,) [mm].
    radius : float
        Radius [mm].
    inside : bool
        True if the deformable body is inside.

    Raises
    ------
    SurfaceError
        An argument is not allowed.
    """

    def __init__(self, centre: Place, radius: float, *, inside: bool = False) -> None:
        self.centre = _vector("Sphere", "centre", centre)
        self.radius, self.inside = _radius("Sphere", radius), bool(inside)

    def __repr__(self) -> str:
        """The call."""
        return f"Sphere({_text(self.centre)}, {self.radius:g}{', inside=True' * self.inside})"

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return len(self.centre)

    def nearest(self, y: Array) -> Nearest:
        """The simple surfaces next to points (n, dim)."""
        side, none = -1.0 if self.inside else 1.0, np.zeros(self.dimension)
        return _everywhere(y, 0.0, side, self.radius, self.centre, none)


class Cylinder:
    """A circular cylinder without ends, in 3-D.

    Parameters
    ----------
    point : tuple of float
        A point of its axis (3,) [mm].
    axis : tuple of float
        Direction of the axis (3,).
    radius : float
        Radius [mm].
    inside : bool
        True if the deformable body is inside.

    Raises
    ------
    SurfaceError
        An argument is not allowed.
    """

    def __init__(self, point: Place, axis: Place, radius: float, *, inside: bool = False) -> None:
        self.point = _vector("Cylinder", "point", point)
        if len(self.point) != 3:
            raise SurfaceError(
                "Cylinder: a cylinder is in space, three coordinates; in 2-D it is a circle, "
                "Sphere(centre, radius)"
            )
        self.axis = _direction("Cylinder", "axis", axis, 3)
        self.radius, self.inside = _radius("Cylinder", radius), bool(inside)

    def __repr__(self) -> str:
        """The call."""
        inside = ", inside=True" * self.inside
        return f"Cylinder({_text(self.point)}, {_text(self.axis)}, {self.radius:g}{inside})"

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return 3

    def nearest(self, y: Array) -> Nearest:
        """The simple surfaces next to points (n, dim)."""
        side = -1.0 if self.inside else 1.0
        return _everywhere(y, 0.0, side, self.radius, self.point, self.axis)


class Polyline:
    """A line of straight segments, in 3-D extruded without end.

    Parameters
    ----------
    points : array (n, dim)
        Its corners [mm]. The rigid body is on the left of the way along them: corners of a solid
        polygon run counterclockwise.
    closed : bool
        True if the last corner is joined to the first.
    along : tuple of float, optional
        In 3-D: direction of the extrusion (3,), across all segments. Seen from its tip the rigid
        body is on the left.

    Raises
    ------
    SurfaceError
        An argument is not allowed.
    """

    def __init__(self, points: Any, *, closed: bool = False, along: Place | None = None) -> None:
        try:
            corners = np.array(points, dtype=np.float64)
        except (TypeError, ValueError):
            corners = np.empty(0)
        minimum = 3 if closed else 2
        if corners.ndim != 2 or len(corners) < minimum or corners.shape[1] not in (2, 3):
            raise SurfaceError(
                f"Polyline: points of shape {np.shape(points)}: at least {minimum} corners of 2 or "
                "3 coordinates are needed"
            )
        if not np.isfinite(corners).all():
            raise SurfaceError("Polyline: points must be finite")
        if (along is not None) != (corners.shape[1] == 3):
            raise SurfaceError("Polyline: along=... is the direction of extrusion in 3-D")
        self.points, self.closed = corners, bool(closed)
        self.along = None if along is None else _direction("Polyline", "along", along, 3)
        stops = np.roll(corners, -1, axis=0) if closed else corners[1:]
        self._start = corners if closed else corners[:-1]
        chord = stops - self._start
        self._length = np.linalg.norm(chord, axis=1)
        self._size = float(np.ptp(corners, axis=0).max())
        if not (self._length > _NEAR * self._size).all():
            raise SurfaceError("Polyline: two corners that follow each other are at one place")
        self._tangent = chord / self._length[:, None]
        if self.along is None:
            self._normal = np.stack([self._tangent[:, 1], -self._tangent[:, 0]], axis=1)
        else:
            if np.abs(self._tangent @ self.along).max() > 1e-9:
                raise SurfaceError("Polyline: segments must be across the direction along=...")
            self._normal = np.cross(self._tangent, self.along)
        self._convex = self._convex_corners()

    def __repr__(self) -> str:
        """Summary in one line."""
        return f"<Polyline: {len(self.points)} corners{', closed' * self.closed}>"

    @property
    def dimension(self) -> int:
        """Number of coordinates."""
        return int(self.points.shape[1])

    def nearest(self, y: Array) -> Nearest:
        """The simple surfaces next to points (n, dim)."""
        parts = max(1, _CHUNK // len(self._start))
        rows = [self._nearest(y[k : k + parts]) for k in range(0, max(len(y), 1), parts)]
        return Nearest(y, *(np.concatenate(c) for c in zip(*rows, strict=True)))

    def _nearest(self, y: Array) -> tuple[Array, Array, Array, Array, Array]:
        """flat, side, radius, centre and axis next to points (n, dim)."""
        offset = y[:, None] - self._start
        if self.along is not None:
            offset = offset - (offset @ self.along)[..., None] * self.along
        share = np.einsum("nsc,sc->ns", offset, self._tangent)
        at = np.clip(share, 0.0, self._length)
        distance = np.linalg.norm(offset - at[..., None] * self._tangent, axis=2)
        segment = np.argmin(distance, axis=1)
        rows = np.arange(len(y))
        share, distance = share[rows, segment], distance[rows, segment]
        rounding = _NEAR * self._size
        beyond = share > self._length[segment] + rounding
        corner = (segment + beyond) % len(self.points)
        is_corner = (beyond | (share < -rounding)) & (distance > rounding)
        centre = np.where(is_corner[:, None], self.points[corner], self._start[segment])
        none = np.zeros(self.dimension) if self.along is None else self.along
        axis = np.where(is_corner[:, None], none, self._normal[segment])
        side = np.where(is_corner & ~self._convex[corner], -1.0, 1.0)
        return np.where(is_corner, 0.0, 1.0), side, np.zeros(len(y)), centre, axis

    def _convex_corners(self) -> Array:
        """True (n,) for corners that point into free space, and for the ends of an open line."""
        after = self._tangent if self.closed else self._tangent[1:]
        normal = np.roll(self._normal, 1, axis=0) if self.closed else self._normal[:-1]
        turns = np.einsum("nc,nc->n", after, normal) <= 0.0  # away from free space
        if self.closed:
            return np.asarray(turns)
        return np.concatenate([[True], turns, [True]])


def _everywhere(
    y: Array, flat: float, side: float, radius: float, centre: Array, axis: Array
) -> Nearest:
    """One simple surface for all points (n, dim)."""
    flats, sides, radii = (np.full(len(y), v) for v in (flat, side, radius))
    centres, axes = (np.broadcast_to(v, y.shape) for v in (centre, axis))
    return Nearest(y, flats, sides, radii, centres, axes)


def _vector(kind: str, name: str, value: Any) -> Array:
    try:
        vector = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        vector = np.empty(0)
    if vector.shape not in ((2,), (3,)) or not np.isfinite(vector).all():
        raise SurfaceError(f"{kind}: {name} = {value!r}: 2 or 3 finite coordinates are needed")
    return vector


def _direction(kind: str, name: str, value: Any, dimension: int) -> Array:
    vector = _vector(kind, name, value)
    length = float(np.linalg.norm(vector))
    if len(vector) != dimension or length == 0.0:
        raise SurfaceError(f"{kind}: {name} = {value!r}: a direction of {dimension} components")
    return np.asarray(vector / length)


def _radius(kind: str, value: Any) -> float:
    try:
        radius = float(value)
    except (TypeError, ValueError):
        radius = np.nan
    if not (np.isfinite(radius) and radius > 0.0):
        raise SurfaceError(f"{kind}: radius = {value!r}: a positive number is needed")
    return radius


def _text(vector: Array) -> str:
    return "(" + ", ".join(f"{v:g}" for v in vector) + ")"
