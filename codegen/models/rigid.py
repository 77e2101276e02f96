"""Rigid bodies: nodes that move with one, moments on one, and contact of a point with its surface.

A rigid body has a reference point a, its displacement U and its rotation theta, in space a rotation
vector. A point X of the body is at a + U + R(theta) (X - a).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy as sp

from softehl.codegen.elements import quadrature
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model

_AXES = "xyz"


def link(dimension: int) -> Definition:
    """A node that moves with a rigid body, by the force lambda of the body on the node.

    Potential lambda . (u - U - (R - 1) (X - a)). With finite = 0 the rotation is small, R - 1 is
    its linear part. The first node is that of the body, the unknowns of the body are at the second.
    """
    m = Model(
        f"rigid_link_{dimension}",
        nodes=2,
        rule=quadrature.point_rule(),
        doc=link.__doc__ or "",
    )
    axes = _AXES[:dimension]
    X = [c[0] for c in m.coordinates(*axes.upper())]
    u = [c[0] for c in m.nodal_unknowns(*(f"u_{c}" for c in axes), nodes=1)]
    force = [c[0] for c in m.nodal_unknowns(*(f"lambda_{c}" for c in axes), nodes=1)]
    U, theta = _motion(m, dimension)
    a = m.data(**{f"a_{c}": "reference point [mm]" for c in axes})
    (finite,) = m.data(finite="1 for finite rotations, 0 for small ones")
    arm = [m.define(f"arm_{c}", X[k] - a[k]) for k, c in enumerate(axes)]
    turned = _times(_rotation(m, theta), arm)
    moved = [
        U[k] + finite * (turned[k] - arm[k]) + (1 - finite) * v
        for k, v in enumerate(_spin(theta, arm))
    ]
    gap = [m.define(f"gap_{c}", u[k] - moved[k]) for k, c in enumerate(axes)]
    m.potential(sum(f * g for f, g in zip(force, gap, strict=True)))
    m.offer(pseudo_load=True)
    return m.finish()


def moment() -> Definition:
    """A moment about axes that do not turn, on a rigid body in space: M . (spin of the body).

    The spin is 1/2 sum of r_i x delta r_i over the columns r_i of the rotation.
    """
    m = Model("rigid_moment", nodes=1, rule=quadrature.point_rule(), doc=moment.__doc__ or "")
    theta = [m.unknown(f"theta_{c}") for c in _AXES]
    M = sp.Matrix(m.data(**{f"M_{c}": "moment [N mm]" for c in _AXES}))
    R = _rotation(m, theta)
    terms = []
    for i in range(3):
        column = sp.Matrix([R[k][i] for k in range(3)])
        force = M.cross(column) / 2
        terms += [(-force[k], column[k]) for k in range(3)]
    m.weak_form(terms)
    return m.finish()


def touch(dimension: int) -> Definition:
    """A point of a body against the surface of a rigid one: pressure and shear stress.

    y is the point as the rigid body sees it. The surface near it is the plane n . (y - c) = 0
    (flat = 1), or a circle, sphere or cylinder about c of a radius, whose axis is n, with free
    space outside (side = 1) or inside (side = -1). With the gap g and its normal, p is
    max(0, lambda - rho g); tau' is tau + rho s, cut off at the length friction p, with s the slip
    since the step before. lambda and tau are the means of p and tau' (Poulios and Renard 2015).
    """
    name = f"rigid_touch_{dimension}"
    m = Model(name, nodes=1, rule=quadrature.point_rule(), doc=touch.__doc__ or "")
    axes = _AXES[:dimension]
    x = [m.unknown(f"x_{c}") for c in axes]
    multipliers = ["lambda", *(["tau"] if dimension == 2 else [f"tau_{c}" for c in axes])]
    lam, *tau = [m.unknown(name) for name in multipliers]
    U, theta = _motion(m, dimension)
    rho, friction, depth = m.data(
        rho="augmentation parameter [MPa/mm]",
        friction="coefficient of friction",
        depth="largest penetration that counts [mm]",
    )
    a = m.data(**{f"a_{c}": "reference point [mm]" for c in axes})
    old = m.data(**{f"old_{c}": "y in the step before [mm]" for c in axes})
    (area,) = m.data(area="reference area of the point [mm2]")
    flat, side, radius = m.data(
        flat="1 for a plane", side="1 outside, -1 inside of the radius", radius="radius [mm]"
    )
    c = m.data(**{f"c_{c}": "point of the plane, or centre [mm]" for c in axes})
    n = m.data(**{f"n_{c}": "normal of the plane, or axis" for c in axes})
    R = _rotation(m, theta)
    arm = [m.define(f"arm_{k}", x[k] - a[k] - U[k]) for k in range(dimension)]
    back = _times([list(column) for column in zip(*R, strict=True)], arm)
    y = [m.define(f"y_{k}", a[k] + v, interface=True) for k, v in enumerate(back)]
    offset = [m.define(f"apart_{k}", y[k] - c[k]) for k in range(dimension)]
    along = m.define("along", _dot(n, offset))
    radial = [m.define(f"radial_{k}", offset[k] - along * n[k]) for k in range(dimension)]
    is_flat = flat > sp.Rational(1, 2)
    square = sp.Piecewise((1, is_flat), (_dot(radial, radial), True))
    length = m.define("length", sp.sqrt(square))
    gap = sp.Piecewise((along, is_flat), (side * (length - radius), True))
    gap = m.define("gap", gap, interface=True)
    normal = [
        m.define(f"normal_{k}", sp.Piecewise((n[k], is_flat), (side * radial[k] / length, True)))
        for k in range(dimension)
    ]
    # where nothing decides, at the start, the point touches and sticks
    augmented = m.define("trial", lam - rho * gap)
    pressure = sp.Piecewise((augmented, gap + depth > 0), (0, True))
    p = m.define("p", sp.Piecewise((pressure, augmented >= 0), (0, True)))
    limit = m.define("limit", friction * p)
    slip = [y[k] - old[k] for k in range(dimension)]
    if dimension == 2:
        t = [normal[1], -normal[0]]
        stick = m.define("stick", tau[0] + rho * _dot(t, slip))
        slides = sp.Piecewise(
            (limit, stick > limit), (-limit, stick < -limit), (stick, friction > 0), (0, True)
        )
        q = m.define("q", sp.Piecewise((slides, augmented >= 0), (0, True)))
        shear, means = [q * v for v in t], [q]
    else:
        local = _times([list(column) for column in zip(*R, strict=True)], tau)
        stick = [m.define(f"stick_{k}", local[k] + rho * slip[k]) for k in range(3)]
        across = m.define("across", _dot(stick, normal))
        tangential = [m.define(f"tangential_{k}", stick[k] - across * normal[k]) for k in range(3)]
        size = m.define("size", _dot(tangential, tangential))
        slides = size > limit**2
        root = sp.sqrt(sp.Piecewise((size, slides), (1, True)))
        share = m.define(
            "share", sp.Piecewise((limit / root, slides), (1, friction > 0), (0, True))
        )
        shear = [
            m.define(f"q_{k}", sp.Piecewise((share * tangential[k], augmented >= 0), (0, True)))
            for k in range(3)
        ]
        means = _times(R, shear)
    m.weak_form(
        [
            *((area * (shear[k] - p * normal[k]), y[k]) for k in range(dimension)),
            (area * p / rho, lam),
            *((area * v / rho, w) for v, w in zip(means, tau, strict=True)),
        ]
    )
    return m.finish()


def _motion(m: Model, dimension: int) -> tuple[list[Any], list[Any]]:
    """Displacement and rotation of a rigid body."""
    axes = _AXES[:dimension]
    U = [m.unknown(f"U_{c}") for c in axes]
    names = ["theta"] if dimension == 2 else [f"theta_{c}" for c in axes]
    return U, [m.unknown(name) for name in names]


def _rotation(m: Model, theta: Sequence[Any]) -> list[list[Any]]:
    """Rotation by an angle, or by a rotation vector: its rows."""
    if len(theta) == 1:
        c, s = m.define("cos", sp.cos(theta[0])), m.define("sin", sp.sin(theta[0]))
        return [[c, -s], [s, c]]
    R = m.define("R", m.rotation(sp.Matrix(theta)))
    return [[R[i, j] for j in range(3)] for i in range(3)]


def _spin(theta: Sequence[Any], arm: Sequence[Any]) -> list[Any]:
    """Displacements of a small rotation."""
    if len(theta) == 1:
        return [-theta[0] * arm[1], theta[0] * arm[0]]
    return list(sp.Matrix(theta).cross(sp.Matrix(arm)))


def _times(rows: Sequence[Sequence[Any]], v: Sequence[Any]) -> list[Any]:
    return [_dot(row, v) for row in rows]


def _dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    return sum(v * w for v, w in zip(a, b, strict=True))
