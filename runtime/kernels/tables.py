"""Curves of pages (`Model.table`): points, and how values between and outside them are found."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from softehl.runtime.arrays import Array
from softehl.runtime.kernels.run_time_arrays import ArrayDataError, RunTimeArray

INTERPOLATIONS = ("linear", "pchip", "spline")
OUTSIDE = ("constant", "linear", "error")
ENDS = ("not-a-knot", "natural")


@dataclass(frozen=True, eq=False, init=False)
class Table:
    """Points of a curve that a page calls by `m.table`, and what lies between and outside them.

    Parameters
    ----------
    x : array (m,)
        Arguments, increasing; two at least.
    y : array (m,)
        Values.
    interpolation : str, optional
        "linear"; "pchip": monotone cubic (Fritsch and Butland 1984), C1, without overshoots;
        "spline": cubic with continuous second derivatives. Default: that of the page.
    outside : str, optional
        Before the first point and behind the last: "constant", "linear" (the tangent there) or
        "error": no value. Default: that of the page.
    ends : str
        Of a spline: "not-a-knot" (one cubic over the first two intervals, and the last two) or
        "natural" (no curvature).

    Raises
    ------
    ValueError
        The points do not increase, are not finite, or there is no such interpolation.

    Notes
    -----
    `Study.add(..., k=(x, y))` is short for `k=Table(x, y)`.
    """

    x: Array
    y: Array
    interpolation: str | None = None
    outside: str | None = None
    ends: str = "not-a-knot"

    def __init__(
        self,
        x: ArrayLike,
        y: ArrayLike,
        interpolation: str | None = None,
        outside: str | None = None,
        ends: str = "not-a-knot",
    ) -> None:
        for name, value, allowed in (
            ("interpolation", interpolation, (None, *INTERPOLATIONS)),
            ("outside", outside, (None, *OUTSIDE)),
            ("ends", ends, ENDS),
        ):
            if value not in allowed:
                names = ", ".join(repr(a) for a in allowed if a)
                raise ArrayDataError(f"Table: {name} = {value!r}; allowed: {names}")
            object.__setattr__(self, name, value)
        for name, numbers in zip("xy", _points(x, y), strict=True):
            object.__setattr__(self, name, numbers)

    def __repr__(self) -> str:
        """Summary in one line."""
        kind = "" if self.interpolation is None else f", {self.interpolation}"
        return f"<Table: {len(self.x)} points from {self.x[0]:g} to {self.x[-1]:g}{kind}>"

    def __call__(self, t: Any) -> Array:
        """Return values of the curve; not-a-number where it has none.

        Parameters
        ----------
        t : array
            Arguments.

        Returns
        -------
        array
            Values, of the same shape.
        """
        t = np.asarray(t, dtype=np.float64)
        x, m = self.x, len(self.x)
        row = np.clip(np.searchsorted(x, t, side="right"), 1, m - 1)
        row = np.where(t < x[0], 0, np.where(t > x[-1], m, row))
        d = t - x[np.maximum(row - 1, 0)]
        a, b, c, e = np.moveaxis(self.coefficients[row], -1, 0)
        values: Array = a + d * (b + d * (c + d * e))
        return values

    # as `ArrayData` -----------------------------------------------------------------------------

    @property
    def values(self) -> Array:
        """Values at the points, (m,)."""
        return self.y

    @property
    def numbers(self) -> Array:
        """Knots, then rows of coefficients, as C reads them."""
        return np.concatenate([self.x, self.coefficients.ravel()])

    @property
    def bounds(self) -> tuple[Array, Array]:
        """None."""
        return np.full(len(self.y), -np.inf), np.full(len(self.y), np.inf)

    def slope(self) -> Array:
        """Derivatives of `numbers` by the values, (5 m + 4, m)."""
        by_values = self._rows(self.y, np.eye(len(self.y)))[1]
        by_values[~np.isfinite(by_values)] = 0.0
        head = np.zeros((len(self.x), len(self.y)))
        return np.concatenate([head, by_values.reshape(-1, len(self.y))])

    def with_values(self, values: Array) -> Table:
        """Return the curve with other values."""
        return replace(self, y=np.array(values, dtype=np.float64))

    def with_defaults(self, interpolation: str, outside: str) -> Table:
        """The curve with what a page says where it says nothing itself."""
        return replace(
            self,
            interpolation=self.interpolation or interpolation,
            outside=self.outside or outside,
        )

    @cached_property
    def coefficients(self) -> Array:
        """Coefficients of the cubics before, between and behind the points, (m + 1, 4)."""
        return self._rows(self.y, None)[0]

    # --------------------------------------------------------------------------------------------

    def _rows(self, y: Array, moving: Array | None) -> tuple[Array, Array]:
        """Coefficients (m + 1, 4), and their derivatives (m + 1, 4, k) along `moving` (m, k)."""
        dy = np.zeros((len(y), 0)) if moving is None else moving
        h = np.diff(self.x)
        dydx, d_dydx = self._derivatives(h, y, dy)
        rows, d_rows = _hermite(h, y, dydx), _hermite(h, dy, d_dydx)
        first, last = self._end(y, dydx, 0), self._end(y, dydx, -1)
        d_first, d_last = self._end(dy, d_dydx, 0), self._end(dy, d_dydx, -1)
        coefficients = np.concatenate([first[None], rows, last[None]])
        return coefficients, np.concatenate([d_first[None], d_rows, d_last[None]])

    def _derivatives(self, h: Array, y: Array, dy: Array) -> tuple[Array, Array]:
        """Slopes at the points (m,), of a line in the sense of its last interval, and rates."""
        if self.interpolation == "spline":
            A, B = _spline_equations(h, natural=self.ends == "natural")
            values, rates = np.linalg.solve(A, B @ y), np.linalg.solve(A, B @ dy)
            return np.asarray(values, np.float64), np.asarray(rates, np.float64)
        secants, d_secants = np.diff(y) / h, np.diff(dy, axis=0) / h[:, None]
        if self.interpolation == "pchip":
            return _pchip(h, secants, d_secants)
        return secants, d_secants

    def _end(self, y: Array, dydx: Array, k: int) -> Array:
        """Coefficients outside, (4,) or (4, k)."""
        row = np.zeros((4, *y.shape[1:]))
        row[0] = y[k]
        if self.outside == "error":
            row[0] = np.nan
        elif self.outside == "linear":
            row[1] = dydx[k]
        return row


def _points(x: Any, y: Any) -> tuple[Array, Array]:
    """Points, checked.  Raises `ArrayDataError`."""
    try:
        x, y = np.array(x, dtype=np.float64), np.array(y, dtype=np.float64)
    except (TypeError, ValueError):
        raise ArrayDataError(
            "a curve is given as two lists of numbers, ([20, 100], [1.2, 1.1])"
        ) from None
    if x.ndim != 1 or x.shape != y.shape or len(x) < 2:
        raise ArrayDataError(
            f"a curve has as many values as arguments, two at least; given {x.shape} and {y.shape}"
        )
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise ArrayDataError("a curve has points that are not finite")
    fall = np.flatnonzero(np.diff(x) <= 0)
    if len(fall):
        a, b = x[fall[0]], x[fall[0] + 1]
        raise ArrayDataError(f"the arguments of a curve must increase: {b:g} follows {a:g}")
    return x, y


def _hermite(h: Array, y: Array, dydx: Array) -> Array:
    """Cubics of the intervals, (m - 1, 4) or (m - 1, 4, k), by values and slopes; lines by secants.

    Of a line there is one slope for each interval.
    """
    h = h.reshape(-1, *[1] * (y.ndim - 1))
    secants = np.diff(y, axis=0) / h
    if len(dydx) < len(y):
        zero = np.zeros_like(secants)
        return np.stack([y[:-1], secants, zero, zero], axis=1)
    a, b = dydx[:-1], dydx[1:]
    second = (3.0 * secants - 2.0 * a - b) / h
    third = (a + b - 2.0 * secants) / h**2
    return np.stack([y[:-1], a, second, third], axis=1)


def _spline_equations(h: Array, *, natural: bool) -> tuple[Array, Array]:
    """A s = B y for the slopes s of a cubic spline with continuous second derivatives."""
    m = len(h) + 1
    A, B = np.zeros((m, m)), np.zeros((m, m))
    for k in range(1, m - 1):
        p, q = 1.0 / h[k - 1], 1.0 / h[k]
        A[k, k - 1 : k + 2] = p, 2.0 * (p + q), q
        B[k, k - 1 : k + 2] = -3.0 * p * p, 3.0 * (p * p - q * q), 3.0 * q * q
    for end, inward in ((0, 1), (m - 1, -1)):
        h0, h1 = (h[0], h[min(1, m - 2)]) if end == 0 else (h[-1], h[max(-2, 1 - m)])
        a, b = end + inward, end + 2 * inward
        if natural or m == 2:
            A[end, end], A[end, a] = 2.0, 1.0
            B[end, end], B[end, a] = -3.0 * inward / h0, 3.0 * inward / h0
        elif m == 3:  # one parabola
            if end == 0:
                A[0, :2] = 1.0, 1.0
                B[0, :2] = -2.0 / h0, 2.0 / h0
            else:
                A[2, 1:] = 1.0, 1.0
                B[2, 1:] = -2.0 / h0, 2.0 / h0
        else:  # equal third derivatives on both sides of the second point
            p, q = 1.0 / h0, 1.0 / h1
            A[end, [end, a, b]] = p * p, p * p - q * q, -q * q
            factor = 2.0 * inward
            B[end, [end, a, b]] = -factor * p**3, factor * (p**3 + q**3), -factor * q**3
    return A, B


def _pchip(h: Array, d: Array, dd: Array) -> tuple[Array, Array]:
    """Slopes of a monotone cubic and their rates, from secants d (m - 1,), dd (m - 1, k).

    Inside a weighted harmonic mean of both secants, 0 where they have different signs (Fritsch and
    Butland 1984); at the ends by three points, limited.
    """
    m = len(h) + 1
    s, ds = np.zeros(m), np.zeros((m, dd.shape[1]))
    if m == 2:
        return np.full(2, d[0]), np.repeat(dd, 2, axis=0)
    for k in range(1, m - 1):
        p, q = d[k - 1], d[k]
        if p * q > 0.0:
            v, w = 2.0 * h[k] + h[k - 1], h[k] + 2.0 * h[k - 1]
            s[k] = (v + w) / (v / p + w / q)
            ds[k] = s[k] ** 2 / (v + w) * (v / p**2 * dd[k - 1] + w / q**2 * dd[k])
    for end, a, b in ((0, 0, 1), (m - 1, m - 2, m - 3)):
        slope = ((2.0 * h[a] + h[b]) * d[a] - h[a] * d[b]) / (h[a] + h[b])
        rate = ((2.0 * h[a] + h[b]) * dd[a] - h[a] * dd[b]) / (h[a] + h[b])
        if slope * d[a] <= 0.0:
            slope, rate = 0.0, 0.0 * rate
        elif d[a] * d[b] <= 0.0 and abs(slope) > 3.0 * abs(d[a]):
            slope, rate = 3.0 * d[a], 3.0 * dd[a]
        s[end], ds[end] = slope, rate
    return s, ds


def points_of(numbers: Array) -> Array:
    """Arguments of the points of a curve as C reads it."""
    return numbers[: (len(numbers) - 4) // 5]


def with_ends(numbers: Array) -> Array:
    """A curve as C reads it, constant where it had no values outside."""
    changed, m = numbers.copy(), len(points_of(numbers))
    rows = changed[m:].reshape(-1, 4)
    step = numbers[m - 1] - numbers[m - 2]
    last = rows[-2, 0] + step * (rows[-2, 1] + step * (rows[-2, 2] + step * rows[-2, 3]))
    for row, value in ((0, rows[1, 0]), (-1, last)):
        if np.isnan(rows[row]).any():
            rows[row] = value, 0.0, 0.0, 0.0
    return changed


def table_of(array: RunTimeArray, value: Any) -> Table:
    """A curve of what a user gave.  Raises `ArrayDataError`."""
    if isinstance(value, Table):
        curve = value
    elif isinstance(value, (tuple, list)) and len(value) == 2:
        curve = Table(value[0], value[1])
    else:
        raise ArrayDataError(
            "a curve is needed, as in "
            f"{array.name}=([20, 100, 400], [1.2, 1.1, 0.9]) or softehl.Table(x, y)"
        )
    return curve.with_defaults(array.options["interpolation"], array.options["outside"])
