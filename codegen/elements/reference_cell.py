"""Reference cells: corners, sides and quadrature of the shapes that elements have."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import sympy as sp

from softehl.codegen.elements.quadrature import QuadratureRule

Point: TypeAlias = tuple[sp.Rational, ...]
Groups: TypeAlias = tuple[tuple[int, ...], ...]
"""Groups of corners, by their numbers."""

_TOLERANCE = 1e-9
"""Of points and weights as doubles."""


@dataclass(frozen=True)
class ReferenceCell:
    """A shape of elements: a cube, or a cube with collapsed faces.

    Coordinate d runs from lower[d], 0 or -1, to 1. `collapse[d]` has the coordinates that shrink
    it: the cell is 0 <= x_d <= s_d or -s_d <= x_d <= s_d, where s_d is 1 minus their sum. sides:
    corners of each face, seen from outside counterclockwise; in 2-D along the boundary with the
    cell on the left. edges, faces: groups of corners between which elements of higher order have
    nodes, in the order of these. rule(degree): quadrature that is exact for polynomials of a
    degree; example: how a user writes one.
    """

    name: str
    corners: tuple[tuple[int, ...], ...]
    sides: Groups
    lower: tuple[int, ...]
    rule: Callable[[int], QuadratureRule]
    example: str
    collapse: Groups = ()
    edges: Groups = ()
    faces: Groups = ()

    def __post_init__(self) -> None:
        """Cubes have no collapsed faces."""
        object.__setattr__(self, "collapse", self.collapse or ((),) * self.dimension)

    @property
    def dimension(self) -> int:
        """Number of parent coordinates."""
        return len(self.corners[0])

    @property
    def measure(self) -> sp.Rational:
        """Length, area or volume."""
        powers = [sum(d in shrinking for shrinking in self.collapse) for d in range(self.dimension)]
        lengths = [sp.Rational(1 - low, p + 1) for low, p in zip(self.lower, powers, strict=True)]
        return sp.prod(lengths)

    def fits(self, rule: QuadratureRule) -> bool:
        """True if all points lie in the cell and the weights sum to its measure."""
        if rule.dimension != self.dimension:
            return False
        inside = all(self.contains([float(x) for x in p]) for p in rule.points)
        return inside and abs(sum(map(float, rule.weights)) - float(self.measure)) < _TOLERANCE

    def contains(self, point: list[float]) -> bool:
        """True for a point of the cell, to 1e-9."""
        for x, low, shrinking in zip(point, self.lower, self.collapse, strict=True):
            upper = 1.0 - sum(point[e] for e in shrinking)
            if not low * upper - _TOLERANCE <= x <= upper + _TOLERANCE:
                return False
        return True

    def nodes(self, *groups: tuple[int, ...]) -> tuple[Point, ...]:
        """Nodes at the corners, and at the means of groups of corners."""
        first = [tuple(sp.Integer(c) for c in corner) for corner in self.corners]
        means = [
            tuple(
                sp.Rational(sum(first[k][d] for k in group), len(group))
                for d in range(self.dimension)
            )
            for group in groups
        ]
        return (*first, *means)
