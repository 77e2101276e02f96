"""Wedges: wedge6, wedge15 and wedge18 on triangle x [-1, 1]."""

from typing import Any

from softehl.codegen.elements.element import (
    Element,
    FileNames,
    barycentric,
    lagrange_line,
    powers,
)
from softehl.codegen.elements.quadrature import wedge
from softehl.codegen.elements.reference_cell import ReferenceCell

CELL = ReferenceCell(
    name="wedge",
    corners=tuple((*p, z) for z in (-1, 1) for p in ((0, 0), (1, 0), (0, 1))),
    sides=((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    lower=(0, 0, -1),
    collapse=((1,), (), ()),
    rule=wedge,
    example="wedge(2)",
    edges=((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
)


def _linear(xi: Any, eta: Any, zeta: Any) -> list[Any]:
    """Barycentric coordinates times linear functions of the height."""
    return [t * z for z in lagrange_line(1, zeta) for t in barycentric((xi, eta))]


def _quadratic(xi: Any, eta: Any, zeta: Any) -> list[Any]:
    """Serendipity functions: no nodes inside the faces."""
    L, lower, upper = barycentric((xi, eta)), *lagrange_line(1, zeta)
    corners = [
        t * z * (2 * t - 2 + sign * zeta) for z, sign in ((lower, -1), (upper, 1)) for t in L
    ]
    edges = [4 * L[a] * L[b] * z for z in (lower, upper) for a, b in ((0, 1), (1, 2), (2, 0))]
    return [*corners, *edges, *(t * (1 - zeta**2) for t in L)]


def _biquadratic(xi: Any, eta: Any, zeta: Any) -> list[Any]:
    """Products of the functions of tri6 and line3: nodes inside the quadrilaterals, too."""
    L, (lower, upper, middle) = barycentric((xi, eta)), lagrange_line(2, zeta)
    corners = [t * (2 * t - 1) for t in L]
    edges = [4 * L[a] * L[b] for a, b in ((0, 1), (1, 2), (2, 0))]
    heights = [(corners, lower), (corners, upper), (edges, lower), (edges, upper)]
    heights += [(corners, middle), (edges, middle)]
    return [t * z for functions, z in heights for t in functions]


_FLAT_LINEAR = powers(2, largest=1, total=1, squares=0)
_FLAT_QUADRATIC = powers(2, largest=2, total=2, squares=1)
ELEMENTS = (
    Element(
        name="wedge6",
        cell=CELL,
        nodes=CELL.nodes(),
        shape=_linear,
        degree=2,
        exponents=tuple((*a, b) for b in (0, 1) for a in _FLAT_LINEAR),
        face_kinds=("tri3", "quad4"),
        files=FileNames("wedge", gmsh=6, abaqus="C3D6", vtk_mirrored=True),
    ),
    Element(
        name="wedge15",
        cell=CELL,
        nodes=CELL.nodes(*CELL.edges),
        shape=_quadratic,
        degree=4,
        exponents=(
            *((*a, b) for b in (0, 1) for a in _FLAT_QUADRATIC),
            *((*a, 2) for a in _FLAT_LINEAR),
        ),
        face_kinds=("tri6", "quad8"),
        files=FileNames(
            "wedge15",
            gmsh=18,
            abaqus="C3D15",
            gmsh_nodes=(*range(6), 6, 9, 7, 12, 14, 13, 8, 10, 11),
            vtk_mirrored=True,
        ),
    ),
    Element(
        name="wedge18",
        cell=CELL,
        nodes=CELL.nodes(*CELL.edges, *CELL.sides[2:]),
        shape=_biquadratic,
        degree=4,
        exponents=tuple((*a, b) for b in (0, 1, 2) for a in _FLAT_QUADRATIC),
        face_kinds=("tri6", "quad9"),
        files=FileNames(
            "wedge18",
            gmsh=13,
            abaqus="C3D15V",
            gmsh_nodes=(*range(6), 6, 9, 7, 12, 14, 13, 8, 10, 11, 15, 17, 16),
            vtk_mirrored=True,
        ),
    ),
)
