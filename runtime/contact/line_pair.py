"""Pairs of lines in the plane: their common part, its points and their partners.

Formulas are those of the page `mortar_22` (`codegen/models/mortar_2d.py`); numbers carry their
derivatives by the unknowns of the element.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from softehl.runtime.arrays import Array
from softehl.runtime.contact.mortar_pair import PairPoint, Varied
from softehl.runtime.mesh.cells import CELLS, Cell

_GAUSS = 4  # points, as of the page


@dataclass(frozen=True, eq=False)
class _Dual:
    """Numbers (n,) and their derivatives (n, columns)."""

    value: Array
    slope: Array

    def __add__(self, other: _Dual | float) -> _Dual:
        if isinstance(other, _Dual):
            return _Dual(self.value + other.value, self.slope + other.slope)
        return _Dual(self.value + other, self.slope)

    def __sub__(self, other: _Dual) -> _Dual:
        return _Dual(self.value - other.value, self.slope - other.slope)

    def __mul__(self, other: _Dual | float) -> _Dual:
        if isinstance(other, _Dual):
            slope = self.value[:, None] * other.slope + other.value[:, None] * self.slope
            return _Dual(self.value * other.value, slope)
        return _Dual(other * self.value, other * self.slope)

    def __truediv__(self, other: _Dual) -> _Dual:
        ratio = self.value / other.value
        slope = (self.slope - ratio[:, None] * other.slope) / other.value[:, None]
        return _Dual(ratio, slope)

    def __neg__(self) -> _Dual:
        return _Dual(-self.value, -self.slope)

    def root(self) -> _Dual:
        """Square root."""
        value = np.sqrt(self.value)
        return _Dual(value, self.slope / (2.0 * value)[:, None])

    def at_least(self, bound: Array | float) -> _Dual:
        """The larger of both."""
        inside = self.value > bound
        return _Dual(np.maximum(self.value, bound), inside[:, None] * self.slope)

    def at_most(self, bound: float) -> _Dual:
        """The smaller of both."""
        return -((-self).at_least(-bound))


@dataclass(frozen=True, eq=False)
class LineGeometry:
    """Nodes of two lines at rest X, now x, and before, (n, nodes, 2).

    columns: derivatives are by so many unknowns; if the nodes are `varied`, the first of these move
    them, node by node. ring: areas are those of rings about the x axis.
    """

    one: Cell
    other: Cell
    X: Array
    x: Array
    previous: Array
    columns: int
    varied: bool
    ring: bool

    def points(self) -> Iterator[PairPoint]:
        """Points of Gauss's rule on the common part."""
        k = len(self.one.nodes)
        now = self._duals(self.x, varied=self.varied)
        side, other = now[:k], now[k:]
        first, last = (self._projected(side, other[end]) for end in (1, 0))
        half = ((last - first) * 0.5).at_least(0.0)
        middle = (first + last) * 0.5
        for s, weight in zip(*(v.tolist() for v in _gauss()), strict=True):
            xi = middle + half * s
            yield self._point(xi, half * weight, side, other)

    def _point(self, xi: _Dual, share: _Dual, side: _Nodes, other: _Nodes) -> PairPoint:
        k = len(self.one.nodes)
        N = _shape(self.one, xi)
        at, slope = _sum(N, side), _sum(_slope(self.one, xi), side)
        length = (slope[0] * slope[0] + slope[1] * slope[1]).root()
        t = slope[0] / length, slope[1] / length
        eta = _partner(self.other, other, at, t)
        M = _shape(self.other, eta)
        partner = _sum(M, other)
        reference, previous = self._duals(self.X), self._duals(self.previous)
        was, were = _sum(N, previous[:k]), _sum(M, previous[k:])
        along = _sum(_slope(self.one, xi), reference[:k])
        area, deformed = (along[0] * along[0] + along[1] * along[1]).root(), length
        if self.ring:
            area = area * _sum(N, reference[:k])[1] * (2.0 * np.pi)
            deformed = deformed * at[1] * (2.0 * np.pi)
        return PairPoint(
            weight=_varied(share * area),
            vectors={
                "apart": _vector(partner, at),
                "slope_a": _stacked(slope),
                "came": _vector(were, was),
            },
            area_ratio=_varied(deformed / area),
            first=_stacked(N),
            second=_stacked(M),
            corners=_stacked(_shape(CELLS["line2"], xi)),
            position=np.stack([at[0].value, at[1].value], axis=1),
        )

    def _duals(self, x: Array, *, varied: bool = False) -> _Nodes:
        """Coordinates of all nodes, which move with the first unknowns where they are varied."""
        nodes = []
        for a in range(x.shape[1]):
            pair = []
            for c in range(2):
                slope = np.zeros((len(x), self.columns))
                if varied:
                    slope[:, 2 * a + c] = 1.0
                pair.append(_Dual(x[:, a, c], slope))
            nodes.append((pair[0], pair[1]))
        return nodes

    def _projected(self, side: _Nodes, y: _Point) -> _Dual:
        """Parent coordinate on the first line whose normal passes through an end of the other."""
        chord = [(side[1][c] - side[0][c]) * 0.5 for c in (0, 1)]
        offset = [y[c] - (side[0][c] + side[1][c]) * 0.5 for c in (0, 1)]
        ahead = chord[0] * offset[0] + chord[1] * offset[1]
        xi = _inside(ahead / (chord[0] * chord[0] + chord[1] * chord[1]))
        if len(side) == 3:
            at, t = _sum(_shape(self.one, xi), side), _sum(_slope(self.one, xi), side)
            ahead = t[0] * (y[0] - at[0]) + t[1] * (y[1] - at[1])
            xi = _inside(xi + ahead / (t[0] * t[0] + t[1] * t[1]))
        return xi


_Point = tuple[_Dual, _Dual]
_Nodes = Sequence[_Point]


def _gauss() -> tuple[Array, Array]:
    return np.polynomial.legendre.leggauss(_GAUSS)


def _inside(xi: _Dual) -> _Dual:
    return xi.at_most(1.0).at_least(-1.0)


def _shape(cell: Cell, xi: _Dual) -> list[_Dual]:
    """Shape functions of a line with its ends first."""
    values, derivatives = cell.shape(xi.value[:, None]), cell.gradient(xi.value[:, None])[:, :, 0]
    return [_Dual(v, d[:, None] * xi.slope) for v, d in zip(values.T, derivatives.T, strict=True)]


def _slope(cell: Cell, xi: _Dual) -> list[_Dual]:
    """Their derivatives; differences are exact, they are at most linear."""
    at = xi.value[:, None]
    values = cell.gradient(at)[:, :, 0]
    second = (cell.gradient(at + 0.5) - cell.gradient(at - 0.5))[:, :, 0]
    return [_Dual(v, d[:, None] * xi.slope) for v, d in zip(values.T, second.T, strict=True)]


def _partner(cell: Cell, other: _Nodes, at: _Point, t: _Point) -> _Dual:
    """Parent coordinate on the other line where the line across t through a point ends."""

    def along(values: Sequence[_Dual]) -> _Dual:
        return values[0] * t[0] + values[1] * t[1]

    half = along([(other[1][c] - other[0][c]) * 0.5 for c in (0, 1)])
    middle = [(other[0][c] + other[1][c]) * 0.5 for c in (0, 1)]
    if len(cell.nodes) == 2:
        return along([at[c] - middle[c] for c in (0, 1)]) / half
    bent = along([middle[c] - other[2][c] for c in (0, 1)])
    ahead = along([other[2][c] - at[c] for c in (0, 1)])
    # the root that a straight side has; where a line misses the side it does not count
    square = (half * half - bent * ahead * 4.0).at_least(half.value**2 / 100.0)
    return ahead * -2.0 / (half - square.root())


def _sum(weights: Sequence[_Dual], nodes: _Nodes) -> _Point:
    x, y = (
        sum(
            (w * p[c] for w, p in zip(weights[1:], nodes[1:], strict=True)),
            start=weights[0] * nodes[0][c],
        )
        for c in (0, 1)
    )
    return x, y


def _varied(a: _Dual) -> Varied:
    return a.value, a.slope


def _stacked(values: Sequence[_Dual]) -> Varied:
    return np.stack([v.value for v in values], axis=1), np.stack([v.slope for v in values], axis=1)


def _vector(a: _Point, b: _Point) -> Varied:
    return _stacked([a[0] - b[0], a[1] - b[1]])
