"""Shape functions of the parent elements, as SymPy expressions."""

from __future__ import annotations

from typing import Any

import sympy as sp

QUAD_NODES = ((-1, -1), (1, -1), (1, 1), (-1, 1))
"""Parent coordinates of the 4-node quadrilateral, counterclockwise."""


def quad4(xi: Any, eta: Any) -> list[Any]:
    """Return the bilinear shape functions on [-1, 1]^2.

    Parameters
    ----------
    xi : Expr
        First coordinate.
    eta : Expr
        Second coordinate.

    Returns
    -------
    list of Expr
        N_a.
    """
    return [(1 + a * xi) * (1 + b * eta) / 4 for a, b in QUAD_NODES]


def quad4_gradient(xi: Any, eta: Any) -> list[tuple[Any, Any]]:
    """Return the gradients of the bilinear shape functions.

    Parameters
    ----------
    xi : Expr
        First coordinate.
    eta : Expr
        Second coordinate.

    Returns
    -------
    list of tuple of Expr
        (dN_a/dxi, dN_a/deta).
    """
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
    """Return the trilinear shape functions on [-1, 1]^3.

    Parameters
    ----------
    xi : Expr
        First coordinate.
    eta : Expr
        Second coordinate.
    zeta : Expr
        Third coordinate.

    Returns
    -------
    list of Expr
        N_a.
    """
    return [(1 + a * xi) * (1 + b * eta) * (1 + c * zeta) / 8 for a, b, c in HEX_NODES]


def hex8_gradient(xi: Any, eta: Any, zeta: Any) -> list[tuple[Any, Any, Any]]:
    """Return the gradients of the trilinear shape functions.

    Parameters
    ----------
    xi : Expr
        First coordinate.
    eta : Expr
        Second coordinate.
    zeta : Expr
        Third coordinate.

    Returns
    -------
    list of tuple of Expr
        (dN_a/dxi, dN_a/deta, dN_a/dzeta).
    """
    return [
        (
            a * (1 + b * eta) * (1 + c * zeta) / 8,
            b * (1 + a * xi) * (1 + c * zeta) / 8,
            c * (1 + a * xi) * (1 + b * eta) / 8,
        )
        for a, b, c in HEX_NODES
    ]


def line2(xi: Any) -> list[Any]:
    """Return the linear shape functions (26) of the paper on [-1, 1].

    Parameters
    ----------
    xi : Expr
        Coordinate.

    Returns
    -------
    list of Expr
        N_a.
    """
    half = sp.Rational(1, 2)
    return [half * (1 - xi), half * (1 + xi)]


def interpolate(shape: Any, nodal: Any) -> Any:
    """Return the sum over nodes of shape function times nodal value.

    Parameters
    ----------
    shape : list of Expr
        Shape functions.
    nodal : list of Expr
        Values at the nodes.

    Returns
    -------
    Expr
        The sum.

    Raises
    ------
    ValueError
        The lists have different lengths.
    """
    if len(shape) != len(nodal):
        raise ValueError(
            f"interpolate: {len(shape)} shape functions and {len(nodal)} nodal values; as many "
            "are needed"
        )
    terms = [n * v for n, v in zip(shape, nodal, strict=True)]
    if all(isinstance(t, sp.Basic) for t in terms):
        return sp.Add(*terms)  # one by one they would be sorted with each term
    return sum(terms)
