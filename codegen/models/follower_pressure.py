"""Follower pressure on a segment of the deformed axisymmetric boundary, (7)-(8)."""

from __future__ import annotations

import sympy as sp

from softehl.codegen.elements import quadrature, shapes
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model


def follower_pressure() -> Definition:
    """t = -p n on the deformed segment, (8); n ds = (dr, -dz) with the solid on the left."""
    m = Model(
        "follower_pressure",
        nodes=2,
        rule=quadrature.gauss(2, 1),
        unroll=True,
        doc=follower_pressure.__doc__ or "",
    )
    X = m.coordinates("Z", "R")
    u = m.nodal_unknowns("u_z", "u_r")
    (p,) = m.parameters(pressure="pressure on the deformed boundary [MPa]")
    (xi,) = m.point()
    N = shapes.line2(xi)
    x = [[a + b for a, b in zip(X[c], u[c], strict=True)] for c in (0, 1)]
    z_xi, r_xi = (m.define(f"{n}_xi", (c[1] - c[0]) / 2) for n, c in zip("zr", x, strict=True))
    ring = m.define("ring", 2 * sp.pi * p * shapes.interpolate(N, x[1]))
    m.weak_form(
        [
            (ring * r_xi, shapes.interpolate(N, u[0])),
            (-ring * z_xi, shapes.interpolate(N, u[1])),
        ]
    )
    m.offer(pseudo_load=True)
    return m.finish()
