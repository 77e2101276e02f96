"""Newton's method in a trust region, between bounds, for functions with an exact Hessian.

Few variables, dear values: the subproblem is solved exactly by eigenvalues (Conn, Gould and Toint,
Trust-region methods, 2000, section 7.3). Of SciPy's methods with Hessians, those with bounds take
several times the evaluations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from softehl.runtime.arrays import Array

_START, _LARGEST = 1.0, 10.0
"""Radii of the trust region: variables are logarithms or multiples."""
_GOOD, _BAD = 0.75, 0.1
"""Ratios of the decrease to that of the model beyond which the region grows or shrinks."""

_DECREASE = 1e-14  # of the function: what a last step may gain, as of SciPy's least squares


@dataclass(frozen=True, eq=False)
class Minimum:
    """Point y (k,) at which a search ended; converged: whether its last step was small."""

    y: Array
    converged: bool


def minimise(
    value: Callable[[Array], float],
    derivatives: Callable[[Array], tuple[Array, Array]],
    start: Array,
    *,
    bounds: tuple[Array, Array],
    tolerance: float,
    more: Callable[[], bool],
) -> Minimum:
    """Return a minimum near the start.

    value: of the function, inf where it has none. derivatives: gradient (k,) and Hessian (k, k) at
    a point whose value was the latest or an earlier one. tolerance: length of a step after which
    the next one would be its square. more: whether another evaluation is allowed.
    """
    lower, upper = bounds
    y, radius = np.clip(start, lower, upper), _START
    f, (g, H) = value(y), derivatives(y)
    while True:
        free = ~(((y <= lower) & (g > 0.0)) | ((y >= upper) & (g < 0.0)))
        step = np.zeros_like(y)
        step[free] = _model_step(g[free], H[np.ix_(free, free)], radius)
        step = np.clip(y + step, lower, upper) - y
        length = float(np.linalg.norm(step))
        predicted = -float(g @ step + step @ H @ step / 2.0)
        if length <= tolerance or predicted <= _DECREASE * abs(f):
            return Minimum(y + step if predicted > 0.0 else y, converged=True)
        if not more():
            return Minimum(y, converged=False)
        tried = value(y + step)
        ratio = (f - tried) / predicted
        if ratio < _BAD:
            radius = length / 4.0
        elif ratio > _GOOD and length > 0.9 * radius:
            radius = min(2.0 * radius, _LARGEST)
        if ratio > 0.0:
            y, f = y + step, tried
            g, H = derivatives(y)


def _model_step(g: Array, H: Array, radius: float) -> Array:
    """Minimum of g . s + s . H s / 2 within the radius, (k,)."""
    if not len(g):
        return g
    sizes, vectors = np.linalg.eigh((H + H.T) / 2.0)
    parts = vectors.T @ g
    smallest = 1e-12 * float(np.abs(sizes).max(initial=0.0)) + np.finfo(float).tiny

    def step(shift: float) -> Array:
        return np.asarray(-vectors @ (parts / (sizes + shift)))

    def excess(shift: float) -> float:
        return float(np.linalg.norm(step(shift))) / radius - 1.0

    smallest_shift = max(0.0, smallest - float(sizes[0]))
    if excess(smallest_shift) <= 0.0:
        return step(smallest_shift)
    largest_shift = smallest_shift + float(np.linalg.norm(g)) / radius + abs(float(sizes[0]))
    from scipy.optimize import brentq  # late: slow to import

    return step(brentq(excess, smallest_shift, largest_shift))
