"""Guards keep the iterates of Newton's method where the equations make sense."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from softehl.runtime.arrays import Array, Integers


class Guard(Protocol):
    """Keeps the iterates of Newton's method in the set where the equations make sense."""

    def limit(self, x: Array, dx: Array) -> float:
        """Largest admissible fraction of the step dx from x, in (0, 1]."""
        ...


@dataclass(frozen=True, eq=False)
class StaysPositive:
    """Quantities x[dofs] + offsets, such as film thicknesses, may lose one `fraction` in a step."""

    dofs: Integers
    offsets: Array
    fraction: float = 0.9

    def limit(self, x: Array, dx: Array) -> float:
        """See `Guard`: the distance to the boundary, fraction of it at most."""
        value, change = x[self.dofs] + self.offsets, dx[self.dofs]
        falling = (change < 0.0) & (value > 0.0)
        if not falling.any():
            return 1.0
        return min(1.0, self.fraction * float(np.min(value[falling] / -change[falling])))


@dataclass(frozen=True, eq=False)
class ChangesLittle:
    """Quantities x[dofs] + offsets may change by a `fraction`, or by `minimum`, at a time."""

    dofs: Integers
    offsets: Array
    fraction: float
    minimum: float

    def limit(self, x: Array, dx: Array) -> float:
        """See `Guard`."""
        allowed = np.maximum(self.fraction * np.abs(x[self.dofs] + self.offsets), self.minimum)
        change = np.abs(dx[self.dofs])
        moving = change > allowed
        return float(np.min(allowed[moving] / change[moving])) if moving.any() else 1.0


@dataclass(frozen=True, eq=False)
class KeepsOrientation:
    """Quadrilaterals must not turn inside out, nor cross the axis: the step is halved until not.

    coordinates: (n, 8) reference (z, r) of the corners; dofs: (n, 8) their displacements.
    """

    coordinates: Array
    dofs: Integers
    halvings: int = 8

    def limit(self, x: Array, dx: Array) -> float:
        """See `Guard`."""
        corners, change = self.coordinates + x[self.dofs], dx[self.dofs]
        fraction = 1.0
        for _ in range(self.halvings):
            if self._admissible(corners + fraction * change):
                return fraction
            fraction *= 0.5
        return fraction

    def _admissible(self, corners: Array) -> bool:
        points = corners.reshape(-1, 4, 2)
        forward = np.roll(points, -1, axis=1) - points
        backward = np.roll(points, 1, axis=1) - points
        jacobian = forward[..., 0] * backward[..., 1] - forward[..., 1] * backward[..., 0]
        sides = points[..., 1] * self.coordinates.reshape(-1, 4, 2)[..., 1]
        return bool(jacobian.min() > 0.0 and sides.min() > 0.0)
