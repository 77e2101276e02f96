"""Shape functions of the parent elements, as SymPy expressions."""

from __future__ import annotations

from typing import Any

import sympy as sp

QUAD_NODES = ((-1, -1), (1, -1), (1, 1), (-1, 1))
"""Parent coordinates of the 4-node quadrilateral, counterclockwise."""


def quad4(xi: Any, eta: Any) -> list[Any]:
    """Bilinear shape functions N_a(xi, eta) on [-1, 1]^2."""
    return [(1 + a * xi) * (1 + b * eta) / 4 for a, b in QUAD_NODES]


def quad4_gradient(xi: Any, eta: Any) -> list[tuple[Any, Any]]:
    """(dN_a/dxi, dN_a/deta) of the bilinear shape functions."""
    return [(a * (1 + b * eta) / 4, b * (1 + a * xi) / 4) for a, b in QUAD_NODES]


HEX_NODES = (
    (-1, -1, -1),
    (1, -1, -1),
    (1, 1, -1),
    (-1, 1, -1),
    (-1, -1, 1),
    (1, -1, 1),
    (1, 1, 1),
    (-1, 1, 1),
)
"""Parent coordinates of the 8-node hexahedron: lower face counterclockwise, then the upper one."""


def hex8(xi: Any, eta: Any, zeta: Any) -> list[Any]:
    """Trilinear shape functions N_a(xi, eta, zeta) on [-1, 1]^3."""
    return [(1 + a * xi) * (1 + b * eta) * (1 + c * zeta) / 8 for a, b, c in HEX_NODES]


def hex8_gradient(xi: Any, eta: Any, zeta: Any) -> list[tuple[Any, Any, Any]]:
    """(dN_a/dxi, dN_a/deta, dN_a/dzeta) of the trilinear shape functions."""
    return [
        (
            a * (1 + b * eta) * (1 + c * zeta) / 8,
            b * (1 + a * xi) * (1 + c * zeta) / 8,
            c * (1 + a * xi) * (1 + b * eta) / 8,
        )
        for a, b, c in HEX_NODES
    ]


def line2(xi: Any) -> list[Any]:
    """Linear shape functions (26) on [-1, 1]."""
    half = sp.Rational(1, 2)
    return [half * (1 - xi), half * (1 + xi)]


def interpolate(shape: Any, nodal: Any) -> Any:
    """Sum over nodes of shape times nodal value."""
    if len(shape) != len(nodal):
        raise ValueError(
            f"interpolate: {len(shape)} shape functions and {len(nodal)} nodal values; as many "
            "are needed"
        )
    return sum(n * v for n, v in zip(shape, nodal, strict=True))
