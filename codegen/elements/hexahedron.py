"""Hexahedra: hex8, hex20, and hex27 to hex343 on [-1, 1]^3."""

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

_SQUARE = ((-1, -1), (1, -1), (1, 1), (-1, 1))
CELL = ReferenceCell(
    name="cube",
    corners=tuple((*p, z) for z in (-1, 1) for p in _SQUARE),
    sides=((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
    lower=(-1, -1, -1),
    rule=lambda degree: gauss(degree // 2 + 1, 3),
    example="gauss(2, 3)",
    edges=(
        *((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)),
        *((0, 4), (1, 5), (2, 6), (3, 7)),
    ),
    faces=((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7)),
)
_GROUPS = (*CELL.edges, *CELL.faces, tuple(range(8)))
_HEX8, _HEX20, _HEX27 = CELL.nodes(), CELL.nodes(*CELL.edges), CELL.nodes(*_GROUPS)
_GMSH_HEX20 = (*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15)
ELEMENTS = (
    Element(
        name="hex8",
        cell=CELL,
        nodes=_HEX8,
        shape=lagrange_product(_HEX8),
        degree=2,
        exponents=powers(3, largest=1, total=3, squares=0),
        face_kinds=("quad4",),
        files=FileNames("hexahedron", gmsh=5, abaqus="C3D8"),
    ),
    Element(
        name="hex20",
        cell=CELL,
        nodes=_HEX20,
        shape=serendipity(_HEX20),
        degree=4,
        exponents=powers(3, largest=2, total=6, squares=1),
        face_kinds=("quad8",),
        files=FileNames("hexahedron20", gmsh=17, abaqus="C3D20", gmsh_nodes=_GMSH_HEX20),
    ),
    Element(
        name="hex27",
        cell=CELL,
        nodes=_HEX27,
        shape=lagrange_product(_HEX27),
        degree=4,
        exponents=powers(3, largest=2, total=6, squares=3),
        face_kinds=("quad9",),
        files=FileNames(
            "hexahedron27",
            gmsh=12,
            abaqus="C3D27",
            gmsh_nodes=(*_GMSH_HEX20, 22, 23, 21, 24, 20, 25, 26),
            abaqus_nodes=(*range(20), 26, 24, 23, 25, 21, 22, 20),
        ),
    ),
    *high_order(CELL, "hex", "hexahedron", "quad", _GROUPS),
)
