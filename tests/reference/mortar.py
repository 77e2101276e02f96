"""Contact of two sides in the plane: a side, and its common part with another one."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from tests.reference.differentiate import PI, Arguments, Matrix, Number, Vector, mp, mpf
from tests.reference.rules import gauss

Points = list[Vector]


def residual_pair(nodes: int, arguments: Arguments, dofs: Vector) -> Vector:
    """Forces at the nodes of both, then for each end of the side what lambda and tau are short of.

    data: displacements of the step before (all along x, all along y), rho, friction, depth, reach,
    ring. The side has the body on its left.
    """
    X, data = arguments.X, arguments.data
    count = len(X) // 2
    old, (rho, friction, depth, reach, ring) = data[:-5], data[-5:]
    x: Points = [[X[2 * a + c] + dofs[2 * a + c] for c in (0, 1)] for a in range(count)]
    before: Points = [[X[2 * a + c] + old[c * count + a] for c in (0, 1)] for a in range(count)]
    rest: Points = [[X[2 * a], X[2 * a + 1]] for a in range(nodes)]
    mine, other = x[:nodes], x[nodes:]
    multipliers = dofs[2 * count :]
    left, right = _clipped(_foot(mine, other[1])), _clipped(_foot(mine, other[0]))
    found = [mpf(0)] * len(dofs)
    if right <= left:
        return found
    for s, weight in zip(*gauss(4), strict=True):
        xi = left + (right - left) * (1 + s) / 2
        tangent = _slope(mine, xi)
        length = mp.sqrt(tangent[0] ** 2 + tangent[1] ** 2)
        t = [tangent[0] / length, tangent[1] / length]
        n = [t[1], -t[0]]
        at = _place(mine, xi)
        eta = _hit(other, at, t)
        gap = _dot(n, _minus(_place(other, eta), at))
        pressure = _between(multipliers[0::2], xi) - rho * gap
        if pressure <= 0 or gap >= reach or gap <= -depth:
            continue
        slip = _dot(t, _minus(_place(before[nodes:], eta), _place(before[:nodes], xi)))
        limit = friction * pressure
        shear = max(-limit, min(limit, _between(multipliers[1::2], xi) + rho * slip))
        area = weight * (right - left) / 2 * _measure(rest, xi, ring)
        shares = [*_shape(nodes, xi), *(-v for v in _shape(len(other), eta))]
        for a, share in enumerate(shares):
            for c in (0, 1):
                found[2 * a + c] += area * share * (pressure * n[c] + shear * t[c])
        for a, share in enumerate(((1 - xi) / 2, (1 + xi) / 2)):
            found[2 * count + 2 * a] += area * share * pressure / rho
            found[2 * count + 2 * a + 1] += area * share * shear / rho
    return found


def residual_side(nodes: int, arguments: Arguments, dofs: Vector) -> Vector:
    """Minus the integrals of lambda and tau over rho, each with the hats of the ends."""
    X, (rho, ring) = arguments.X, arguments.data
    rest: Points = [[X[2 * a], X[2 * a + 1]] for a in range(nodes)]
    found, multipliers = [mpf(0)] * len(dofs), dofs[2 * nodes :]
    for xi, weight in zip(*gauss(3), strict=True):
        area = weight * _measure(rest, xi, ring)
        for a, share in enumerate(((1 - xi) / 2, (1 + xi) / 2)):
            for k in (0, 1):
                value = _between(multipliers[k::2], xi)
                found[2 * nodes + 2 * a + k] -= area * share * value / rho
    return found


def fields_side(nodes: int, arguments: Arguments, dofs: Vector) -> Matrix:
    """True pressure and shear stress, place, and area of each point."""
    X, (_, ring) = arguments.X, arguments.data
    rest: Points = [[X[2 * a], X[2 * a + 1]] for a in range(nodes)]
    moved: Points = [[X[2 * a + c] + dofs[2 * a + c] for c in (0, 1)] for a in range(nodes)]
    rows, multipliers = [], dofs[2 * nodes :]
    for xi, weight in zip(*gauss(3), strict=True):
        now = _measure(moved, xi, ring)
        ratio = _measure(rest, xi, ring) / now
        values = [ratio * _between(multipliers[k::2], xi) for k in (0, 1)]
        rows.append([*values, *_place(moved, xi), now * weight])
    return rows


FAMILIES = {f"mortar_{a}{b}": a for a in (2, 3) for b in (2, 3)}
SIDES = {f"mortar_side_{a}": a for a in (2, 3)}
RESIDUALS = {
    **{name: partial(residual_pair, a) for name, a in FAMILIES.items()},
    **{name: partial(residual_side, a) for name, a in SIDES.items()},
}
FIELDS = {name: partial(fields_side, a) for name, a in SIDES.items()}


def _shape(nodes: int, xi: Number) -> Vector:
    """Lagrange polynomials at -1, 1 and, of three nodes, 0."""
    places = [mpf(-1), mpf(1), mpf(0)][:nodes]
    found = []
    for a in places:
        value = mpf(1)
        for b in places:
            value *= 1 if a == b else (xi - b) / (a - b)
        found.append(value)
    return found


def _place(points: Points, xi: Number) -> Vector:
    shares = _shape(len(points), xi)
    return [sum((s * p[c] for s, p in zip(shares, points, strict=True)), mpf(0)) for c in (0, 1)]


def _slope(points: Points, xi: Number) -> Vector:
    """Slope of the polynomial through the points: exact as a central difference of a parabola."""
    ahead, behind = _place(points, xi + 1), _place(points, xi - 1)
    return [(a - b) / 2 for a, b in zip(ahead, behind, strict=True)]


def _measure(points: Points, xi: Number, ring: Number) -> Number:
    slope = _slope(points, xi)
    around = 2 * PI * _place(points, xi)[1] if ring else 1
    return around * mp.sqrt(_dot(slope, slope))


def _foot(points: Points, y: Vector) -> Number:
    """Foot of a place on the chord; of a curved side improved by one step along its tangent."""
    ends: Points = points[:2]
    chord = _slope(ends, mpf(0))
    xi = _dot(chord, _minus(y, _place(ends, mpf(0)))) / _dot(chord, chord)
    if len(points) == 2:
        return xi
    xi = _clipped(xi)
    tangent = _slope(points, xi)
    return xi + _dot(tangent, _minus(y, _place(points, xi))) / _dot(tangent, tangent)


def _hit(points: Points, at: Vector, t: Vector) -> Number:
    """Where (x(eta) - at) . t = 0: by the values of this polynomial at -1, 0 and 1."""
    low, middle, high = (_dot(t, _minus(_place(points, mpf(s)), at)) for s in (-1, 0, 1))
    bent, along = (low + high) / 2 - middle, (high - low) / 2
    if len(points) == 2:
        return -middle / along
    return (-along - mp.sqrt(along**2 - 4 * bent * middle)) / (2 * bent)


def _clipped(xi: Number) -> Number:
    return max(mpf(-1), min(mpf(1), xi))


def _between(values: Sequence[Number], xi: Number) -> Number:
    return (values[0] * (1 - xi) + values[1] * (1 + xi)) / 2


def _dot(a: Vector, b: Vector) -> Number:
    return a[0] * b[0] + a[1] * b[1]


def _minus(a: Vector, b: Vector) -> Vector:
    return [a[0] - b[0], a[1] - b[1]]
