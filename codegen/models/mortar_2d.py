"""Contact of two deformable sides in the plane: mortar integrals over their common part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from softehl.codegen.elements import quadrature
from softehl.codegen.elements.shapes import interpolate, line2
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model

_STEPS = 1
"""Gauss-Newton steps of a projection onto a curved side; a straight one needs none. One step of
an error e leaves e^2, and none of it where the sides touch."""
_AXES = ((0, "x"), (1, "y"))
_Sides = Sequence[Sequence[Any]]


def pair(nodes: int, others: int) -> Definition:
    """A side against a part of another: pressure and shear stress by an augmented Lagrangian.

    The first `nodes` are those of the side, which has the multipliers lambda (pressure) and tau at
    its ends; then come those of the other. A point of the side looks along its normal n: where the
    line meets the other side is its partner, at the distance g. With p = max(0, lambda - rho g)
    and the slip s since the step before along the side, tau' is tau + rho s cut off at +- friction
    p; p n + tau' t acts on the partner, its opposite on the point, and lambda and tau are the
    means of p and tau' (Poulios and Renard 2015). The integral goes over the part of the side
    whose lines meet the other one, so that parts add up; the ends of this part move with the nodes.
    """
    name, doc = f"mortar_{nodes}{others}", pair.__doc__ or ""
    rule = quadrature.gauss(4, 1)
    m = Model(name, nodes=nodes + others, rule=rule, unroll=False, doc=doc)
    X = m.coordinates("X", "Y")
    u = m.nodal_unknowns("u_x", "u_y")
    lam, tau = m.nodal_unknowns("lambda", "tau", nodes=2)
    old = m.nodal_data("u_x_old", "u_y_old", meaning="in the step before [mm]")
    rho, friction, depth, reach, ring = m.data(
        rho="augmentation parameter [MPa/mm]",
        friction="coefficient of friction",
        depth="largest penetration that counts [mm]",
        reach="largest gap that counts [mm]",
        ring="1 for rings around the x axis, 0 for plane strain",
    )
    at = _meeting(m, _moved(X, u), nodes)
    # where nothing decides, at the start, sides touch and stick
    augmented = m.define("trial", interpolate(at.L, lam) - rho * at.gap)
    pressure = sp.Piecewise((augmented, (at.gap - reach) * (at.gap + depth) < 0), (0, True))
    p = m.define("p", sp.Piecewise((pressure, augmented >= 0), (0, True)), interface=True)
    limit = m.define("limit", friction * p)
    stick = m.define("stick", interpolate(at.L, tau) + rho * at.slip(m, _moved(X, old), nodes))
    slides = sp.Piecewise(
        (limit, stick > limit), (-limit, stick < -limit), (stick, friction > 0), (0, True)
    )
    q = m.define("q", sp.Piecewise((slides, augmented >= 0), (0, True)), interface=True)
    area = m.define("area", at.half * _area(nodes, at.xi, [c[:nodes] for c in X], ring))
    force = [
        m.define(f"force_{c}", area * (p * at.n[k] + q * at.t[k]), interface=True) for k, c in _AXES
    ]
    weights = [*at.N, *(-v for v in at.M)]
    m.weak_form(
        [
            *((force[k] * v, u[k][a]) for k in (0, 1) for a, v in enumerate(weights)),
            *((area * p * at.L[a] / rho, lam[a]) for a in (0, 1)),
            *((area * q * at.L[a] / rho, tau[a]) for a in (0, 1)),
        ]
    )
    return m.finish()


def side(nodes: int) -> Definition:
    """The whole side of `pair`: its multipliers where nothing meets it, and what they mean.

    lambda and tau are per reference area; the fields are per deformed area, and `area` is that of
    a quadrature point: sum(pressure * area) is the force.
    """
    name, doc = f"mortar_side_{nodes}", side.__doc__ or ""
    m = Model(name, nodes=nodes, rule=quadrature.gauss(3, 1), unroll=False, doc=doc)
    X = m.coordinates("X", "Y")
    u = m.nodal_unknowns("u_x", "u_y", idle=("u_x", "u_y"))
    lam, tau = m.nodal_unknowns("lambda", "tau", nodes=2)
    rho, ring = m.data(
        rho="augmentation parameter [MPa/mm]",
        ring="1 for rings around the x axis, 0 for plane strain",
    )
    (xi,) = m.point()
    N, L, x = _shape(nodes, xi), line2(xi), _moved(X, u)
    area = m.define("area", _area(nodes, xi, X, ring))
    now = m.define("area_now", _area(nodes, xi, x, ring))
    p, q = m.define("p", interpolate(L, lam)), m.define("q", interpolate(L, tau))
    m.weak_form(
        [
            *((-area * p * L[a] / rho, lam[a]) for a in (0, 1)),
            *((-area * q * L[a] / rho, tau[a]) for a in (0, 1)),
        ]
    )
    m.fields(
        pressure=p * area / now,
        shear=q * area / now,
        x=interpolate(N, x[0]),
        y=interpolate(N, x[1]),
        area=now * m.weight,
    )
    return m.finish()


@dataclass(frozen=True)
class _Meeting:
    """A point of the side and its partner.

    half: length of the common part in parent coordinates, halved. xi: of the point; N, L, M: shape
    functions of the side, of the multipliers and of the other side; t, n: along and out of it.
    """

    half: Any
    xi: Any
    N: list[Any]
    L: list[Any]
    M: list[Any]
    t: list[Any]
    n: list[Any]
    gap: Any

    def slip(self, m: Model, previous: _Sides, nodes: int) -> Any:
        """Motion of the point along the side since its partner and it were at `previous`."""
        came = [interpolate(self.M, c[nodes:]) - interpolate(self.N, c[:nodes]) for c in previous]
        return m.define("slip", self.t[0] * came[0] + self.t[1] * came[1], interface=True)


def _meeting(m: Model, x: _Sides, nodes: int) -> _Meeting:
    """The point of the side at a quadrature point of the part that both have in common."""
    slave, other = [c[:nodes] for c in x], [c[nodes:] for c in x]
    (s,) = m.point()
    # the other side runs the other way
    first, last = (
        m.define(f"end_{k}", _projected(m, slave, other, k), interface=True) for k in (1, 0)
    )
    half = m.define("half", sp.Max(last - first, 0) / 2)
    xi = m.define("xi_side", (first + last) / 2 + half * s, interface=True)
    N = [m.define(f"N{a}", v) for a, v in enumerate(_shape(nodes, xi))]
    at = [m.define(f"at_{c}", interpolate(N, slave[k]), interface=True) for k, c in _AXES]
    slope = [interpolate(_slope(nodes, xi), slave[k]) for k, _ in _AXES]
    slope = [m.define(f"slope_{c}", slope[k], interface=True) for k, c in _AXES]
    length = m.define("length", sp.sqrt(slope[0] ** 2 + slope[1] ** 2))
    t = [m.define(f"t_{c}", slope[k] / length) for k, c in _AXES]
    n = [t[1], -t[0]]
    eta = m.define("eta", _partner(m, other, at, t), interface=True)
    M = [m.define(f"M{a}", v) for a, v in enumerate(_shape(len(other[0]), eta))]
    gap = sum(n[k] * (interpolate(M, other[k]) - at[k]) for k in (0, 1))
    return _Meeting(half, xi, N, line2(xi), M, t, n, m.define("gap", gap, interface=True))


def _moved(X: _Sides, u: _Sides) -> list[list[Any]]:
    return [[a + b for a, b in zip(X[k], u[k], strict=True)] for k in (0, 1)]


def _shape(nodes: int, xi: Any) -> list[Any]:
    """Shape functions of a side with its ends first."""
    if nodes == 2:
        return line2(xi)
    return [xi * (xi - 1) / 2, xi * (xi + 1) / 2, 1 - xi**2]


def _slope(nodes: int, xi: Any) -> list[Any]:
    """Their derivatives."""
    half = sp.Rational(1, 2)
    return [-half, half] if nodes == 2 else [xi - half, xi + half, -2 * xi]


def _area(nodes: int, xi: Any, x: _Sides, ring: Any) -> Any:
    """Area per parent coordinate, of rings or of the plane."""
    along = [interpolate(_slope(nodes, xi), c) for c in x]
    around = 1 + ring * (2 * sp.pi * interpolate(_shape(nodes, xi), x[1]) - 1)
    return sp.sqrt(along[0] ** 2 + along[1] ** 2) * around


def _projected(m: Model, slave: _Sides, other: _Sides, end: int) -> Any:
    """Parent coordinate on the slave side whose normal passes through an end of the other."""
    y, nodes = [c[end] for c in other], len(slave[0])
    chord = [(c[1] - c[0]) / 2 for c in slave]
    offset = [y[k] - (slave[k][0] + slave[k][1]) / 2 for k in (0, 1)]
    start = _inside((chord[0] * offset[0] + chord[1] * offset[1]) / (chord[0] ** 2 + chord[1] ** 2))
    for step in range(_STEPS if nodes == 3 else 0):
        xi = m.define(f"meets_{end}_{step}", start)
        at = [interpolate(_shape(nodes, xi), c) for c in slave]
        t = [interpolate(_slope(nodes, xi), slave[k]) for k in (0, 1)]
        t = [m.define(f"along_{end}_{step}_{k}", t[k]) for k in (0, 1)]
        ahead = t[0] * (y[0] - at[0]) + t[1] * (y[1] - at[1])
        start = _inside(xi + ahead / (t[0] ** 2 + t[1] ** 2))
    return start


def _inside(xi: Any) -> Any:
    return sp.Max(-1, sp.Min(xi, 1))


def _partner(m: Model, other: _Sides, at: Sequence[Any], t: Sequence[Any]) -> Any:
    """Parent coordinate on the other side where the line across t through a point ends."""
    half = sp.Rational(1, 2)
    along = m.define("against", sum(half * (c[1] - c[0]) * t[k] for k, c in enumerate(other)))
    if len(other[0]) == 2:
        return sum((at[k] - half * (c[0] + c[1])) * t[k] for k, c in enumerate(other)) / along
    bent = m.define("bent", sum((half * (c[0] + c[1]) - c[2]) * t[k] for k, c in enumerate(other)))
    ahead = m.define("ahead", sum((c[2] - at[k]) * t[k] for k, c in enumerate(other)))
    # the root that a straight side has; where a line misses the side it does not count
    square = sp.Max(along**2 - 4 * bent * ahead, along**2 / 100)
    return -2 * ahead / (along - sp.sqrt(square))
