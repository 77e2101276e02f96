"""Results from converged fields: means over elements, nodal averages, intervals along a line."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from softehl.runtime.arrays import Array, Flags, Integers


def element_means(values: Array, weights: Array) -> Array:
    """Weighted mean (n,) over the points of each element; values and weights (n, points).

    The mean itself where the weights are zero, as along the rod on a segment that stands upright.
    """
    total = weights.sum(axis=1)
    sums, means = (values * weights).sum(axis=1), values.mean(axis=1)
    return np.asarray(np.divide(sums, total, out=means, where=total != 0.0))


def relative_spread(values: Array) -> float:
    """(largest - smallest) / |mean| of values (n,), n >= 1; inf where the mean is zero."""
    mean = abs(float(values.mean()))
    width = float(np.ptp(values))
    return width / mean if mean > 0.0 else (0.0 if width == 0.0 else float("inf"))


def run_around(flags: Flags, index: int) -> slice:
    """Longest slice of consecutive true flags that holds `index`; just `index` if it is false."""
    if not flags[index]:
        return slice(index, index + 1)
    false = np.flatnonzero(~flags)
    false_left, false_right = false[false < index], false[false > index]
    first = int(false_left[-1]) + 1 if len(false_left) else 0
    last = int(false_right[0]) if len(false_right) else len(flags)
    return slice(first, last)


def interval_below(x: Array, values: Array, level: float) -> tuple[float, float]:
    """First and last x at which the piecewise linear `values` (n,) are below `level`.

    x: (n,), increasing. Both ends are nan where no value is below the level.
    """
    inside = np.flatnonzero(values < level)
    if not len(inside):
        return float("nan"), float("nan")
    first, last = int(inside[0]), int(inside[-1])
    start = x[0] if first == 0 else _crossing(x, values, level, first - 1)
    end = x[-1] if last == len(x) - 1 else _crossing(x, values, level, last)
    return float(start), float(end)


def _crossing(x: Array, values: Array, level: float, i: int) -> float:
    t = (level - values[i]) / (values[i + 1] - values[i])
    return float(x[i] + t * (x[i + 1] - x[i]))


def alternating_difference(values: Array) -> float:
    """Largest second difference of values (n,) that changes sign to its neighbour; 0 if none does.

    A pair counts with the smaller of its two magnitudes, so that a single kink does not count.
    """
    second = np.diff(values, 2)
    pairs = np.minimum(np.abs(second[:-1]), np.abs(second[1:]))
    return float(np.max(pairs, initial=0.0, where=second[:-1] * second[1:] < 0.0))


def first_below(values: Array, level: float) -> float:
    """Index, in fractions, at which the piecewise linear `values` (n,) first fall to `level`.

    0 where they begin below it, n - 1 where they never fall so far.
    """
    below = np.flatnonzero(values < level)
    if not len(below):
        return float(len(values) - 1)
    i = int(below[0])
    return i - float((level - values[i]) / (values[i - 1] - values[i])) if i else 0.0


def nodal_average(cells: Integers, values: Mapping[str, Array], nodes: int) -> dict[str, Array]:
    """Nodal values (nodes,) of each field: mean over the cells of a node of their point means.

    cells: (m, k) node numbers; values: name -> (m, points). Nodes without a cell get nan.
    """
    count = np.bincount(cells.ravel(), minlength=nodes).astype(np.float64)
    count[count == 0.0] = np.nan
    result = {}
    for name, field in values.items():
        repeated = np.repeat(field.mean(axis=1), cells.shape[1])
        result[name] = np.asarray(np.bincount(cells.ravel(), repeated, nodes) / count)
    return result


def von_mises(zz: Array, rr: Array, tt: Array, zr: Array) -> Array:
    """Von Mises stress from an axisymmetric stress; arrays of one shape."""
    normal = 0.5 * ((zz - rr) ** 2 + (rr - tt) ** 2 + (tt - zz) ** 2)
    return np.asarray(np.sqrt(normal + 3.0 * zr**2))


def local_exponent(x0: float, y0: float, x1: float, y1: float) -> float:
    """d log y / d log x between two points of positive coordinates."""
    return float(np.log(y1 / y0) / np.log(x1 / x0))
