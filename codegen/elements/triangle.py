"""Triangles: tri3 and tri6 on the unit triangle."""

from softehl.codegen.elements.element import Element, FileNames, powers, simplex
from softehl.codegen.elements.quadrature import triangle
from softehl.codegen.elements.reference_cell import ReferenceCell

CELL = ReferenceCell(
    name="triangle",
    corners=((0, 0), (1, 0), (0, 1)),
    sides=((0, 1), (1, 2), (2, 0)),
    lower=(0, 0),
    collapse=((1,), ()),
    rule=triangle,
    example="triangle(2)",
    edges=((0, 1), (1, 2), (2, 0)),
)
_TRI3, _TRI6 = CELL.nodes(), CELL.nodes(*CELL.edges)
ELEMENTS = (
    Element(
        name="tri3",
        cell=CELL,
        nodes=_TRI3,
        shape=simplex(_TRI3),
        degree=1,
        exponents=powers(2, largest=1, total=1, squares=0),
        face_kinds=("line2",),
        files=FileNames("triangle", gmsh=2, abaqus="CPS3 S3"),
    ),
    Element(
        name="tri6",
        cell=CELL,
        nodes=_TRI6,
        shape=simplex(_TRI6),
        degree=2,
        exponents=powers(2, largest=2, total=2, squares=1),
        face_kinds=("line3",),
        files=FileNames("triangle6", gmsh=9, abaqus="CPS6 STRI65"),
    ),
)
