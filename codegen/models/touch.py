"""Contact of two deformable faces in space: a point of a face against its partner."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy as sp

from softehl.codegen.language.definition import Definition
from softehl.codegen.language.elements import quadrature
from softehl.codegen.language.elements.shapes import interpolate, quad4, quad4_gradient
from softehl.codegen.language.model import Model

_Columns = Sequence[Sequence[Any]]


def point(nodes: int, others: int) -> Definition:
    """Points of a face against one face of another side: pressure by an augmented Lagrangian.

    The first `nodes` are those of the face, which has the multiplier lambda at its nodes; then
    come those of the other. The partner of a point is where the line along its normal n meets the
    other face, at the distance g: one Newton step from the parent coordinates and the distance
    that are given, which leaves nothing where these are exact, and gives their derivatives. The
    pressure p = max(0, lambda - rho g) acts along n, and lambda is its mean (Poulios and Renard
    2015).
    """
    name, doc = f"touch_{nodes}{others}", point.__doc__ or ""
    m = Model(name, nodes=nodes + others, rule=_rule(nodes), unroll=False, doc=doc)
    X = m.coordinates("X", "Y", "Z")
    u = m.nodal_unknowns("u_x", "u_y", "u_z")
    (t,) = m.nodal_unknowns("lambda", nodes=nodes)
    rho, xi, eta, apart = m.data(
        rho="augmentation parameter [MPa/mm]",
        xi_start="first parent coordinate of the partner, nearly",
        eta_start="second parent coordinate of the partner, nearly",
        apart="distance of the partner, nearly [mm]",
    )
    x = _moved(X, u)
    at_point = m.point()
    N, n = _shape(nodes, *at_point), _normal(m, [c[:nodes] for c in x], at_point)
    at = [m.define(f"at_{k}", interpolate(N, x[k][:nodes]), interface=True) for k in range(3)]
    M, gap = _partner(m, [c[nodes:] for c in x], at, n, (xi, eta, apart))
    trial = m.define("trial", interpolate(N, t) - rho * gap)
    p = m.define("p", sp.Piecewise((trial, trial >= 0), (0, True)), interface=True)
    area = m.define("area", _area([c[:nodes] for c in X], at_point))
    shares = [*N, *(-v for v in M)]
    T = [m.define(f"T_{k}", area * p * n[k], interface=True) for k in range(3)]
    m.weak_form(
        [
            *((T[k] * v, u[k][a]) for k in range(3) for a, v in enumerate(shares)),
            *((area * p * v / rho, t[a]) for a, v in enumerate(N)),
        ]
    )
    return m.finish()


def face(nodes: int) -> Definition:
    """The whole face of `point`: its multiplier where nothing meets it, and what it means.

    lambda is per reference area; the fields are per deformed area, and `area` is that of a
    quadrature point: sum(pressure * area) is the force.
    """
    name, doc = f"touch_side_{nodes}", face.__doc__ or ""
    m = Model(name, nodes=nodes, rule=_rule(nodes), unroll=False, doc=doc)
    X = m.coordinates("X", "Y", "Z")
    u = m.nodal_unknowns("u_x", "u_y", "u_z", idle=("u_x", "u_y", "u_z"))
    (lam,) = m.nodal_unknowns("lambda", nodes=nodes)
    (rho,) = m.data(rho="augmentation parameter [MPa/mm]")
    at, x = m.point(), _moved(X, u)
    N = _shape(nodes, *at)
    area, now = m.define("area", _area(X, at)), m.define("area_now", _area(x, at))
    p = m.define("p", interpolate(N, lam))
    m.weak_form([(-area * p * v / rho, lam[a]) for a, v in enumerate(N)])
    m.fields(pressure=p * area / now)
    m.fields(**{c: interpolate(N, x[k]) for k, c in enumerate("xyz")}, area=now * m.weight)
    return m.finish()


def _partner(
    m: Model, other: _Columns, at: Sequence[Any], n: Sequence[Any], start: tuple[Any, Any, Any]
) -> tuple[list[Any], Any]:
    """Shape functions of the partner and its distance, by a Newton step from the start."""
    xi, eta, apart = start
    count = len(other[0])
    place = [interpolate(_shape(count, xi, eta), c) for c in other]
    place = [m.define(f"there_{k}", place[k]) for k in range(3)]
    a, b = (
        [m.define(f"{s}_{k}", v[k]) for k in range(3)]
        for s, v in zip("ab", _slopes(other, (xi, eta)), strict=True)
    )
    off = [m.define(f"off_{k}", at[k] + apart * n[k] - place[k]) for k in range(3)]
    # a dxi + b deta - n dg = off, by Cramer's rule
    facing = m.define("facing", _dot(_cross(a, b), n))
    first = m.define("xi_there", xi + _dot(_cross(off, b), n) / facing, interface=True)
    second = m.define("eta_there", eta + _dot(_cross(a, off), n) / facing, interface=True)
    gap = m.define("gap", apart - _dot(_cross(a, b), off) / facing, interface=True)
    return _shape(count, first, second), gap


def _normal(m: Model, x: _Columns, at: Sequence[Any]) -> list[Any]:
    """Unit normal out of the body of a face whose nodes go round counterclockwise from outside."""
    a, b = _slopes(x, at)
    a = [m.define(f"slope_a_{k}", a[k]) for k in range(3)]
    b = [m.define(f"slope_b_{k}", b[k]) for k in range(3)]
    across = [m.define(f"across_{k}", v) for k, v in enumerate(_cross(a, b))]
    length = m.define("length", sp.sqrt(_dot(across, across)))
    return [m.define(f"n_{k}", across[k] / length, interface=True) for k in range(3)]


def _rule(nodes: int) -> quadrature.QuadratureRule:
    return quadrature.triangle(4) if nodes == 3 else quadrature.gauss(3, 2)


def _shape(nodes: int, xi: Any, eta: Any) -> list[Any]:
    return [1 - xi - eta, xi, eta] if nodes == 3 else quad4(xi, eta)


def _slopes(x: _Columns, at: Sequence[Any]) -> tuple[list[Any], list[Any]]:
    """Derivatives of the place by both parent coordinates."""
    if len(x[0]) == 3:
        return [c[1] - c[0] for c in x], [c[2] - c[0] for c in x]
    gradient = quad4_gradient(*at)
    first, second = ([interpolate([g[d] for g in gradient], c) for c in x] for d in (0, 1))
    return first, second


def _area(x: _Columns, at: Sequence[Any]) -> Any:
    across = _cross(*_slopes(x, at))
    return sp.sqrt(_dot(across, across))


def _moved(X: _Columns, u: _Columns) -> list[list[Any]]:
    return [[a + b for a, b in zip(X[k], u[k], strict=True)] for k in range(3)]


def _dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    return sum(v * w for v, w in zip(a, b, strict=True))


def _cross(a: Sequence[Any], b: Sequence[Any]) -> list[Any]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
