"""Contact of two deformable sides in the plane: mortar integrals over their common part."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy as sp

from softehl.codegen.language.definition import Definition
from softehl.codegen.language.elements import quadrature
from softehl.codegen.language.elements.shapes import interpolate, line2
from softehl.codegen.language.model import Model

_STEPS = 3
"""Gauss-Newton steps of a projection onto a curved side, which a straight one needs none of."""


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
    m = Model(
        f"mortar_{nodes}{others}",
        nodes=nodes + others,
        rule=quadrature.gauss(4, 1),
        unroll=False,
        doc=pair.__doc__ or "",
    )
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
    x = [[a + b for a, b in zip(X[c], u[c], strict=True)] for c in (0, 1)]
    before = [[a + b for a, b in zip(X[c], old[c], strict=True)] for c in (0, 1)]
    side, other = [c[:nodes] for c in x], [c[nodes:] for c in x]
    (s,) = m.point()
    first, last = (m.define(f"end_{k}", _met(m, side, other, k), interface=True) for k in (1, 0))
    half = m.define("half", sp.Max(last - first, 0) / 2)
    xi = m.define("xi_side", (first + last) / 2 + half * s, interface=True)
    N, L = (m.define(f"N{a}", v) for a, v in enumerate(_shape(nodes, xi))), line2(xi)
    N = list(N)
    at = [m.define(f"at_{c}", interpolate(N, side[k]), interface=True) for k, c in enumerate("xy")]
    slope = [m.define(f"slope_{c}", interpolate(_slope(nodes, xi), side[k]), interface=True) for k, c in _AXES]
    length = m.define("length", sp.sqrt(slope[0] ** 2 + slope[1] ** 2))
    t = [m.define(f"t_{c}", slope[k] / length) for k, c in _AXES]
    n = [t[1], -t[0]]
    eta = m.define("eta", _partner(m, other, at, t), interface=True)
    M = [m.define(f"M{a}", v) for a, v in enumerate(_shape(others, eta))]
    gap = m.define("gap", sum(n[k] * (interpolate(M, other[k]) - at[k]) for k in (0, 1)), interface=True)
    trial = m.define("trial", sp.Max(interpolate(L, lam) - rho * gap, 0))
    near = sp.Piecewise((trial, gap < reach), (0, True))
    p = m.define("p", sp.Piecewise((near, gap > -depth), (0, True)), interface=True)
    came = [interpolate(M, c[nodes:]) - interpolate(N, c[:nodes]) for c in before]
    slip = m.define("slip", t[0] * came[0] + t[1] * came[1], interface=True)
    limit = m.define("limit", friction * p)
    q = m.define("q", sp.Max(-limit, sp.Min(interpolate(L, tau) + rho * slip, limit)), interface=True)
    around = [interpolate(_slope(nodes, xi), X[k][:nodes]) for k in (0, 1)]
    radius = interpolate(N, X[1][:nodes])
    area = m.define(
        "area", half * sp.sqrt(around[0] ** 2 + around[1] ** 2) * (1 + ring * (2 * sp.pi * radius - 1))
    )
    force = [m.define(f"force_{c}", area * (p * n[k] + q * t[k])) for k, c in _AXES]
    m.weak_form(
        [
            *((force[k] * N[a], u[k][a]) for k in (0, 1) for a in range(nodes)),
            *((-force[k] * M[b], u[k][nodes + b]) for k in (0, 1) for b in range(others)),
            *((area * p * L[a] / rho, lam[a]) for a in (0, 1)),
            *((area * q * L[a] / rho, tau[a]) for a in (0, 1)),
        ]
    )
    return m.finish()


def side(nodes: int) -> Definition:
    """The whole side of `pair`: its multipliers where nothing meets it, and what they mean.

    lambda and tau are per reference area; the fields are per deformed area.
    """
    m = Model(
        f"mortar_side_{nodes}",
        nodes=nodes,
        rule=quadrature.gauss(3, 1),
        unroll=False,
        doc=side.__doc__ or "",
    )
    X = m.coordinates("X", "Y")
    u = m.nodal_unknowns("u_x", "u_y", idle=("u_x", "u_y"))
    lam, tau = m.nodal_unknowns("lambda", "tau", nodes=2)
    rho, ring = m.data(
        rho="augmentation parameter [MPa/mm]",
        ring="1 for rings around the x axis, 0 for plane strain",
    )
    (xi,) = m.point()
    N, L = _shape(nodes, xi), line2(xi)
    x = [[a + b for a, b in zip(X[c], u[c], strict=True)] for c in (0, 1)]
    areas = []
    for name, places in (("area", X), ("area_now", x)):
        slope = [interpolate(_slope(nodes, xi), c) for c in places]
        around = 1 + ring * (2 * sp.pi * interpolate(N, places[1]) - 1)
        areas.append(m.define(name, sp.sqrt(slope[0] ** 2 + slope[1] ** 2) * around))
    area, now = areas
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
        area=now,
    )
    return m.finish()


_AXES = ((0, "x"), (1, "y"))


def _shape(nodes: int, xi: Any) -> list[Any]:
    """Shape functions of a side with its ends first."""
    if nodes == 2:
        return line2(xi)
    return [xi * (xi - 1) / 2, xi * (xi + 1) / 2, 1 - xi**2]


def _slope(nodes: int, xi: Any) -> list[Any]:
    """Their derivatives."""
    half = sp.Rational(1, 2)
    return [-half, half] if nodes == 2 else [xi - half, xi + half, -2 * xi]


def _met(m: Model, side: Sequence[Any], other: Sequence[Any], end: int) -> Any:
    """Where on the side the line through an end of the other one starts, from -1 to 1."""
    y = [c[end] for c in other]
    nodes = len(side[0])
    chord = [(c[1] - c[0]) / 2 for c in side]
    off = [y[k] - (side[k][0] + side[k][1]) / 2 for k in (0, 1)]
    found = _inside((chord[0] * off[0] + chord[1] * off[1]) / (chord[0] ** 2 + chord[1] ** 2))
    for step in range(_STEPS if nodes == 3 else 0):
        xi = m.define(f"meets_{end}_{step}", found)
        at = [interpolate(_shape(nodes, xi), c) for c in side]
        t = [m.define(f"along_{end}_{step}_{k}", interpolate(_slope(nodes, xi), side[k])) for k in (0, 1)]
        ahead = t[0] * (y[0] - at[0]) + t[1] * (y[1] - at[1])
        found = _inside(xi + ahead / (t[0] ** 2 + t[1] ** 2))
    return found


def _inside(xi: Any) -> Any:
    return sp.Max(-1, sp.Min(xi, 1))


def _partner(m: Model, other: Sequence[Any], at: Sequence[Any], t: Sequence[Any]) -> Any:
    """Where on the other side a line across t through a place ends."""
    half = sp.Rational(1, 2)
    along = m.define("against", sum(half * (c[1] - c[0]) * t[k] for k, c in enumerate(other)))
    if len(other[0]) == 2:
        return sum((at[k] - half * (c[0] + c[1])) * t[k] for k, c in enumerate(other)) / along
    bent = m.define("bent", sum((half * (c[0] + c[1]) - c[2]) * t[k] for k, c in enumerate(other)))
    ahead = m.define("ahead", sum((c[2] - at[k]) * t[k] for k, c in enumerate(other)))
    # the root that a straight side has; where a line misses the side it does not count
    square = sp.Max(along**2 - 4 * bent * ahead, along**2 / 100)
    return -2 * ahead / (along - sp.sqrt(square))
