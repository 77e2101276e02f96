"""Lines: line2 to line7 on [-1, 1]."""

from softehl.codegen.elements.element import (
    Element,
    FileNames,
    high_order,
    lagrange_product,
    powers,
)
from softehl.codegen.elements.quadrature import gauss
from softehl.codegen.elements.reference_cell import ReferenceCell

CELL = ReferenceCell(
    name="line",
    corners=((-1,), (1,)),
    sides=((0,), (1,)),
    lower=(-1,),
    rule=lambda degree: gauss(degree // 2 + 1, 1),
    example="gauss(2, 1)",
    edges=((0, 1),),
)
_LINE2, _LINE3 = CELL.nodes(), CELL.nodes(*CELL.edges)
ELEMENTS = (
    Element(
        name="line2",
        cell=CELL,
        nodes=_LINE2,
        shape=lagrange_product(_LINE2),
        degree=0,
        exponents=powers(1, largest=1, total=1, squares=0),
        face_kinds=("point1",),
        files=FileNames("line", gmsh=1, abaqus="T2D2 T3D2"),
    ),
    Element(
        name="line3",
        cell=CELL,
        nodes=_LINE3,
        shape=lagrange_product(_LINE3),
        degree=2,
        exponents=powers(1, largest=2, total=2, squares=1),
        face_kinds=("point1",),
        files=FileNames("line3", gmsh=8, abaqus="T2D3 T3D3", abaqus_nodes=(0, 2, 1)),
    ),
    *high_order(CELL, "line", "line", "point", CELL.edges),
)
