"""Contact of two faces in space: a point against its partner, and what a face has."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from tests.reference.differentiate import Arguments, Matrix, Number, Vector, mp, mpf
from tests.reference.rules import gauss

Points = list[Vector]


def residual_point(arguments: Arguments, dofs: Vector) -> Vector:
    """Stress on the partner, then what lambda and tau are made of, over rho."""
    rho, friction, depth, reach = arguments.data
    apart, a, b, came = (list(dofs[3 * k : 3 * k + 3]) for k in range(4))
    across = _cross(a, b)
    n = [v / _length(across) for v in across]
    gap = _dot(apart, n)
    pressure = dofs[12] - rho * gap
    found = [mpf(0)] * len(dofs)
    if pressure <= 0:
        return found
    if not -depth < gap < reach:
        pressure = mpf(0)
    stick = [t + rho * c for t, c in zip(dofs[13:], came, strict=True)]
    shear = _cross(n, _cross(stick, n))
    if _length(shear) > friction * pressure:
        shear = [v * friction * pressure / _length(shear) for v in shear]
    for c in range(3):
        found[c] = pressure * n[c] + shear[c]
        found[13 + c] = shear[c] / rho
    found[12] = pressure / rho
    return found


def residual_side(nodes: int, arguments: Arguments, dofs: Vector) -> Vector:
    """Minus the integrals of lambda and tau over rho, with each shape function."""
    X, (rho,) = arguments.X, arguments.data
    rest = _places(X, [mpf(0)] * len(X), range(nodes))
    found, multipliers = [mpf(0)] * len(dofs), dofs[3 * nodes :]
    for at, weight in _rule(nodes):
        L, area = _shape(_corners(nodes), at), weight * _length(_cross(*_slopes(rest, at)))
        for k in range(4):
            value = sum((a * v for a, v in zip(L, multipliers[k::4], strict=True)), mpf(0))
            for a, share in enumerate(L):
                found[3 * nodes + 4 * a + k] -= area * share * value / rho
    return found


def fields_side(nodes: int, arguments: Arguments, dofs: Vector) -> Matrix:
    """True pressure and shear stress, place, and area of each point."""
    X = arguments.X
    rest, moved = (_places(X, u, range(nodes)) for u in ([mpf(0)] * len(X), dofs))
    rows, multipliers = [], dofs[3 * nodes :]
    for at, weight in _rule(nodes):
        L = _shape(_corners(nodes), at)
        before, now = (_length(_cross(*_slopes(p, at))) for p in (rest, moved))
        values = [
            sum((a * v for a, v in zip(L, multipliers[k::4], strict=True)), mpf(0))
            for k in range(4)
        ]
        place = _sum(_shape(nodes, at), moved)
        rows.append([*(v * before / now for v in values), *place, now * weight])
    return rows


SIDES = {f"touch_side_{a}": a for a in (3, 4, 6, 8, 9)}
RESIDUALS: dict[str, Callable[[Arguments, Vector], Vector]] = {
    "touch": residual_point,
    **{name: partial(residual_side, a) for name, a in SIDES.items()},
}
FIELDS = {name: partial(fields_side, a) for name, a in SIDES.items()}


def _rule(nodes: int) -> list[tuple[Vector, Number]]:
    """Three by three points; on a triangle Gauss's, and Jacobi's for the weight 1 - y."""
    line = list(zip(*gauss(3), strict=True))
    if _corners(nodes) == 4:
        return [([x, y], v * w) for x, v in line for y, w in line]
    found = []
    for y, w in _jacobi():
        found += [([(1 + x) / 2 * (1 - y), y], v / 2 * w) for x, v in line]
    return found


def _jacobi() -> list[tuple[Number, Number]]:
    """Points and weights on [0, 1] of the weight 1 - y: zeros of 35 y^3 - 45 y^2 + 15 y - 1."""
    points = mp.polyroots([35, -45, 15, -1], maxsteps=500, extraprec=500)
    found = []
    for y in points:
        others = [z for z in points if z != y]
        # integral over [0, 1] of (1 - y) times the Lagrange polynomial of the point
        total, product = others[0] + others[1], others[0] * others[1]
        integral = mpf(1) / 12 - total / 6 + product / 2
        found.append((y, integral / ((y - others[0]) * (y - others[1]))))
    return found


def _places(X: Sequence[Number], u: Sequence[Number], nodes: range) -> Points:
    return [[X[3 * a + c] + u[3 * a + c] for c in range(3)] for a in nodes]


def _corners(nodes: int) -> int:
    return 3 if nodes in (3, 6) else 4


def _shape(nodes: int, at: Sequence[Number]) -> Vector:
    """The linear ones, less shares of those in the middle of edges and of the face."""
    x, y = at
    if nodes in (3, 6):
        linear = [1 - x - y, x, y]
        edges = [4 * linear[a] * linear[a - 2] for a in range(3)]
    else:
        ends = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        linear = [(1 + a * x) * (1 + b * y) / 4 for a, b in ends]
        edges = [(1 - x**2) * (1 - y) / 2, (1 - y**2) * (1 + x) / 2]
        edges += [(1 - x**2) * (1 + y) / 2, (1 - y**2) * (1 - x) / 2]
    if nodes in (3, 4):
        return linear
    inner = [(1 - x**2) * (1 - y**2)] if nodes == 9 else []
    edges = [e - sum(inner) / 2 for e in edges]
    return [v - (edges[a] + edges[a - 1]) / 2 - sum(inner) / 4 for a, v in enumerate(linear)] + [
        *edges,
        *inner,
    ]


def _slopes(points: Points, at: Sequence[Number]) -> tuple[Vector, Vector]:
    """Exact as central differences: along each parent coordinate the place is quadratic."""
    found = []
    for d in (0, 1):
        ahead, behind = ([v + s * (k == d) for k, v in enumerate(at)] for s in (1, -1))
        pairs = zip(*(_sum(_shape(len(points), p), points) for p in (ahead, behind)), strict=True)
        found.append([(a - b) / 2 for a, b in pairs])
    return found[0], found[1]


def _sum(shares: Vector, points: Points) -> Vector:
    return [sum((s * p[c] for s, p in zip(shares, points, strict=True)), mpf(0)) for c in range(3)]


def _cross(a: Vector, b: Vector) -> Vector:
    return [a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2] for k in range(3)]


def _dot(a: Vector, b: Vector) -> Number:
    return sum((v * w for v, w in zip(a, b, strict=True)), mpf(0))


def _length(a: Vector) -> Number:
    return mp.sqrt(sum((v * v for v in a), mpf(0)))
