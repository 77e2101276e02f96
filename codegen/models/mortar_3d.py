"""Contact of two deformable faces in space: mortar integrals over their common part."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy as sp

from softehl.codegen.elements import cells, quadrature
from softehl.codegen.elements.shapes import interpolate
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model

_AXES = ((0, "x"), (1, "y"), (2, "z"))
_Columns = Sequence[Sequence[Any]]


def touch() -> Definition:
    """A point of a face and its partner on another face: pressure and shear stress.

    apart: from the point to its partner. slope_a, slope_b: of the face along its parent
    coordinates, so that n is its normal; came: motion of the partner against the point since the
    step before. With g = apart n, p is max(0, lambda - rho g); tau' is tau + rho came along the
    face, cut off at the length friction p. The stress p n + tau' acts on the partner, its opposite
    on the point; lambda and tau are the means of p and tau' (Poulios and Renard 2015).
    """
    m = Model("touch", nodes=1, rule=quadrature.point_rule(), doc=touch.__doc__ or "")
    names = [f"{v}_{c}" for v in ("apart", "slope_a", "slope_b", "came") for _, c in _AXES]
    at = [m.unknown(name) for name in (*names, "lambda", "tau_x", "tau_y", "tau_z")]
    r, a, b, came, (lam, *tau) = at[:3], at[3:6], at[6:9], at[9:12], at[12:]
    rho, friction, depth, reach = m.data(
        rho="augmentation parameter [MPa/mm]",
        friction="coefficient of friction",
        depth="largest penetration that counts [mm]",
        reach="largest gap that counts [mm]",
    )
    across = [m.define(f"across_{k}", v) for k, v in enumerate(_cross(a, b))]
    length = m.define("length", sp.sqrt(_dot(across, across)))
    n = [m.define(f"n_{c}", across[k] / length) for k, c in _AXES]
    gap = m.define("gap", _dot(r, n))
    # where nothing decides, at the start, sides touch and stick
    augmented = m.define("trial", lam - rho * gap)
    pressure = sp.Piecewise((augmented, (gap - reach) * (gap + depth) < 0), (0, True))
    p = m.define("p", sp.Piecewise((pressure, augmented >= 0), (0, True)))
    stick_traction = [m.define(f"stick_{c}", tau[k] + rho * came[k]) for k, c in _AXES]
    normal_part = m.define("stick_n", _dot(stick_traction, n))
    along = [m.define(f"along_{c}", stick_traction[k] - normal_part * n[k]) for k, c in _AXES]
    square, limit = m.define("square", _dot(along, along)), m.define("limit", friction * p)
    slides = square > limit**2
    size = sp.sqrt(sp.Piecewise((square, slides), (1, True)))
    share = m.define("share", sp.Piecewise((limit / size, slides), (1, friction > 0), (0, True)))
    q = [
        m.define(f"q_{c}", sp.Piecewise((share * along[k], augmented >= 0), (0, True)))
        for k, c in _AXES
    ]
    m.weak_form(
        [
            *((p * n[k] + q[k], r[k]) for k, _ in _AXES),
            (p / rho, lam),
            *((q[k] / rho, tau[k]) for k, _ in _AXES),
        ]
    )
    return m.finish()


def face(nodes: int) -> Definition:
    """The whole face of `touch`: its multipliers where nothing meets it, and what they mean.

    lambda and tau are those of its corners, per reference area; the fields are per deformed area,
    and `area` is that of a quadrature point: sum(pressure * area) is the force.
    """
    name, doc = f"touch_side_{nodes}", face.__doc__ or ""
    cell = cells.element({3: "tri3", 4: "quad4", 6: "tri6", 8: "quad8", 9: "quad9"}[nodes])
    flat = cells.element("tri3" if nodes in (3, 6) else "quad4")
    rule = quadrature.triangle(4) if nodes in (3, 6) else quadrature.gauss(3, 2)
    m = Model(name, nodes=nodes, rule=rule, unroll=False, doc=doc)
    X = m.coordinates("X", "Y", "Z")
    u = m.nodal_unknowns("u_x", "u_y", "u_z", idle=("u_x", "u_y", "u_z"))
    multipliers = m.nodal_unknowns("lambda", "tau_x", "tau_y", "tau_z", nodes=len(flat.nodes))
    (rho,) = m.data(rho="augmentation parameter [MPa/mm]")
    at, x = m.point(), _moved(X, u)
    N, L, gradients = cell.shape(*at), flat.shape(*at), cell.gradient(*at)
    area, now = m.define("area", _area(X, gradients)), m.define("area_now", _area(x, gradients))
    values = [m.define(f"value_{k}", interpolate(L, v)) for k, v in enumerate(multipliers)]
    pairs = zip(values, multipliers, strict=True)
    m.weak_form([(-area * p * v / rho, t[a]) for p, t in pairs for a, v in enumerate(L)])
    names = ("pressure", *(f"shear_{c}" for _, c in _AXES))
    m.fields(**{name: v * area / now for name, v in zip(names, values, strict=True)})
    m.fields(**{c: interpolate(N, x[k]) for k, c in _AXES}, area=now * m.weight)
    return m.finish()


def _area(x: _Columns, gradients: Sequence[Sequence[Any]]) -> Any:
    """Per parent area, by the derivatives of the shape functions."""
    first, second = ([interpolate([g[d] for g in gradients], c) for c in x] for d in (0, 1))
    across = _cross(first, second)
    return sp.sqrt(_dot(across, across))


def _moved(X: _Columns, u: _Columns) -> list[list[Any]]:
    return [[a + b for a, b in zip(X[k], u[k], strict=True)] for k in range(3)]


def _dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    return sum(v * w for v, w in zip(a, b, strict=True))


def _cross(a: Sequence[Any], b: Sequence[Any]) -> list[Any]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
