"""Nodes of a line: a size function, and the map of index space that obeys it.

A line of length L is to have `count` segments whose size at s is

    dx(s) = min(coarsest, min_k [min(a_k finest, most_k) + rate |s - s_k|])

with `finest` chosen such that they fill it. The rate may differ from place to place and between the
two sides of one. The map is that of the limit of many segments, so that the nodes of a mesh are
among those of the mesh of twice its density.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import brentq

from softehl.runtime.arrays import Array

STATIONS = 20001  # points at which a size function is tabulated
_STEPS = 27 * 64  # of the table of a map: nodes of every density up to 64 are entries of it


@dataclass(frozen=True)
class Spot:
    """A place to be resolved: s_k in mm, a_k the size there relative to that of other spots.

    maximum: largest size there, mm.
    """

    position: float
    size: float = 1.0
    maximum: float = np.inf


@dataclass(frozen=True, eq=False)
class Spacing:
    """A monotone map of [0, 1] onto itself: where equal steps of index space lie on a line.

    positions: (K + 1,), from 0 to 1, the images of k / K.
    """

    positions: Array

    def __call__(self, t: Array) -> Array:
        """Relative positions (n,) of the relative indices t (n,)."""
        return np.interp(t, self._indices, self.positions)

    @classmethod
    def of(cls, s: Array, index: Array) -> Self:
        """Map of a line with so many segments (n,), rising, from its beginning to s (n,)."""
        positions = np.interp(np.linspace(0.0, index[-1], _STEPS + 1), index, s) / s[-1]
        positions[-1] = 1.0
        return cls(positions)

    @cached_property
    def _indices(self) -> Array:
        return np.arange(len(self.positions)) / (len(self.positions) - 1)


def graded(
    length: float, spots: Sequence[Spot], count: int, *, coarsest: float, rate: float
) -> Spacing:
    """The map of a line of `length` (mm) with `count` segments that resolves the spots.

    coarsest: largest size, mm; rate: growth of the size with the distance from a spot.
    Raises ValueError where `count` segments of the coarsest size do not fill the line, or without
    a spot.
    """
    if not spots:
        raise ValueError("graded: no spot is given; at least one is needed")
    if count * coarsest <= length:
        raise ValueError(
            f"graded: {count} segments of at most {coarsest:g} mm do not fill {length:g} mm; "
            f"the coarsest size must be larger than {length / count:g} mm"
        )
    s = np.linspace(0.0, length, STATIONS)
    away = [rate * np.abs(s - spot.position) for spot in spots]

    def segments(log_finest: float) -> Array:
        """Number of segments (stations,) from the beginning of the line to s."""
        finest = np.exp(log_finest)
        sizes = [min(spot.size * finest, spot.maximum) for spot in spots]
        targets = [smallest + more for smallest, more in zip(sizes, away, strict=True)]
        size = np.minimum(coarsest, np.min(targets, axis=0))
        return np.asarray(cumulative_trapezoid(1.0 / size, s, initial=0))

    lower, upper = np.log(1e-6 * coarsest), np.log(coarsest)
    index = segments(brentq(lambda finest: segments(finest)[-1] - count, lower, upper))
    return Spacing.of(s, index)
