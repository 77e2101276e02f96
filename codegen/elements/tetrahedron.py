"""Tetrahedra: tet4 and tet10 on the unit tetrahedron."""

from softehl.codegen.elements.element import Element, FileNames, powers, simplex
from softehl.codegen.elements.quadrature import tetrahedron
from softehl.codegen.elements.reference_cell import ReferenceCell

CELL = ReferenceCell(
    name="tetrahedron",
    corners=((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
    sides=((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)),
    lower=(0, 0, 0),
    collapse=((1, 2), (2,), ()),
    rule=tetrahedron,
    example="tetrahedron(2)",
    edges=((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
)
_TET4, _TET10 = CELL.nodes(), CELL.nodes(*CELL.edges)
ELEMENTS = (
    Element(
        name="tet4",
        cell=CELL,
        nodes=_TET4,
        shape=simplex(_TET4),
        degree=1,
        exponents=powers(3, largest=1, total=1, squares=0),
        face_kinds=("tri3",),
        files=FileNames("tetra", gmsh=4, abaqus="C3D4"),
    ),
    Element(
        name="tet10",
        cell=CELL,
        nodes=_TET10,
        shape=simplex(_TET10),
        degree=2,
        exponents=powers(3, largest=2, total=2, squares=1),
        face_kinds=("tri6",),
        files=FileNames(
            "tetra10", gmsh=11, abaqus="C3D10", gmsh_nodes=(0, 1, 2, 3, 4, 5, 6, 7, 9, 8)
        ),
    ),
)
