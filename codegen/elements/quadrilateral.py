"""Quadrilaterals: quad4, quad8, and quad9 to quad49 on [-1, 1]^2."""

from softehl.codegen.elements.element import (
    Element,
    FileNames,
    high_order,
    lagrange_product,
    powers,
    serendipity,
)
from softehl.codegen.elements.quadrature import gauss
from softehl.codegen.elements.reference_cell import ReferenceCell

CELL = ReferenceCell(
    name="square",
    corners=((-1, -1), (1, -1), (1, 1), (-1, 1)),
    sides=((0, 1), (1, 2), (2, 3), (3, 0)),
    lower=(-1, -1),
    rule=lambda degree: gauss(degree // 2 + 1, 2),
    example="gauss(2, 2)",
    edges=((0, 1), (1, 2), (2, 3), (3, 0)),
)
_GROUPS = (*CELL.edges, (0, 1, 2, 3))
_QUAD4, _QUAD8, _QUAD9 = CELL.nodes(), CELL.nodes(*CELL.edges), CELL.nodes(*_GROUPS)
ELEMENTS = (
    Element(
        name="quad4",
        cell=CELL,
        nodes=_QUAD4,
        shape=lagrange_product(_QUAD4),
        degree=2,
        exponents=powers(2, largest=1, total=2, squares=0),
        face_kinds=("line2",),
        files=FileNames("quad", gmsh=3, abaqus="CPS4 S4"),
    ),
    Element(
        name="quad8",
        cell=CELL,
        nodes=_QUAD8,
        shape=serendipity(_QUAD8),
        degree=4,
        exponents=powers(2, largest=2, total=4, squares=1),
        face_kinds=("line3",),
        files=FileNames("quad8", gmsh=16, abaqus="CPS8 S8R"),
    ),
    Element(
        name="quad9",
        cell=CELL,
        nodes=_QUAD9,
        shape=lagrange_product(_QUAD9),
        degree=4,
        exponents=powers(2, largest=2, total=4, squares=2),
        face_kinds=("line3",),
        files=FileNames("quad9", gmsh=10, abaqus="M3D9 S9R5"),
    ),
    *high_order(CELL, "quad", "quad", "line", _GROUPS),
)
