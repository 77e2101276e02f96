"""Pyramids: pyramid5 on the square [-1, 1]^2 with the apex (0, 0, 1)."""

from typing import Any

import sympy as sp

from softehl.codegen.elements.element import Element, FileNames
from softehl.codegen.elements.quadrature import pyramid
from softehl.codegen.elements.reference_cell import ReferenceCell

CELL = ReferenceCell(
    name="pyramid",
    corners=((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0, 0, 1)),
    sides=((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
    lower=(-1, -1, 0),
    collapse=((2,), (2,), ()),
    rule=pyramid,
    example="pyramid(2)",
)


def _rational(xi: Any, eta: Any, zeta: Any) -> list[Any]:
    """Bilinear on the base, linear on the sides; source: Bedrosian, Int. J. Numer. Meth. Eng. 35
    (1992) 95-108.
    """
    quarter, product = sp.Rational(1, 4), xi * eta / (1 - zeta)
    base = [
        quarter * (1 - zeta + a * xi + b * eta + a * b * product) for a, b, _ in CELL.corners[:4]
    ]
    return [*base, zeta]


ELEMENTS = (
    Element(
        name="pyramid5",
        cell=CELL,
        nodes=CELL.nodes(),
        shape=_rational,
        degree=2,
        exponents=((0, 0, 0, 0), (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (1, 1, 0, -1)),
        face_kinds=("tri3", "quad4"),
        files=FileNames("pyramid", gmsh=7, abaqus="C3D5"),
    ),
)
