"""Central differences of order 10 of functions of places: their error is that of rounding.

Their step is `WIDE` of the length on which the function is smooth, as WIDE^10 is 6e-16.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from softehl.runtime.arrays import Array

WIDE = 0.03
_SLOPE = (5 / 6, -5 / 21, 5 / 84, -5 / 504, 1 / 1260)
_BEND = (5 / 3, -5 / 21, 5 / 126, -5 / 1008, 1 / 3150)


def slope(f: Callable[[float], Array], step: float) -> Array:
    """Derivative of f at 0."""
    terms = [w * (f(k * step) - f(-k * step)) for k, w in enumerate(_SLOPE, start=1)]
    return np.asarray(np.sum(terms, axis=0) / step)


def mixed(f: Callable[[float, float], Array], step: float) -> Array:
    """Mixed second derivative of f at (0, 0).

    Second derivatives along (1, 1) and along (-1, 1) differ by 4 times it.
    """
    terms = []
    for k, w in enumerate(_BEND, start=1):
        s = k * step
        terms += [w * f(s, s), w * f(-s, -s), -w * f(-s, s), -w * f(s, -s)]
    return np.asarray(np.sum(terms, axis=0) / (4.0 * step**2))
