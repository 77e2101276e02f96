"""Elements by name, and the reference cells on which they live.

Node order of VTK and meshio: corners, then the middles of edges, of faces, of the cell. Lines,
quadrilaterals and hexahedra of order 3 to 6 have the nodes of Gauss and Lobatto along every line;
those inside an edge, a face or the cell follow one another with x running first, then y, then z.
Quadrilaterals and hexahedra live on [-1, 1]^d, triangles and tetrahedra on the unit simplex,
wedges on triangle x [-1, 1], pyramids on the square with the apex (0, 0, 1). A module for each
shape has its elements; the runtime reads them from `generated/cells.json` (`cell_table`).
"""

from __future__ import annotations

import json
from typing import Any

from softehl.codegen.elements import (
    hexahedron,
    line,
    pyramid,
    quadrilateral,
    tetrahedron,
    triangle,
    wedge,
)
from softehl.codegen.elements.element import Element, line_nodes
from softehl.codegen.elements.quadrature import QuadratureRule
from softehl.codegen.elements.reference_cell import ReferenceCell

_MODULES = (line, quadrilateral, hexahedron, triangle, tetrahedron, wedge, pyramid)
ELEMENTS: dict[str, Element] = {e.name: e for module in _MODULES for e in module.ELEMENTS}
"""Every element by its name."""
CELLS: dict[str, ReferenceCell] = {module.CELL.name: module.CELL for module in _MODULES}
"""Every reference cell by its name."""
SHAPES = {
    "line": ("line2", "line3", "line4", "line5", "line6", "line7"),
    "quad": ("quad4", "quad9", "quad16", "quad25", "quad36", "quad49"),
    "hex": ("hex8", "hex27", "hex64", "hex125", "hex216", "hex343"),
    "tri": ("tri3", "tri6"),
    "tet": ("tet4", "tet10"),
    "wedge": ("wedge6", "wedge18"),
    "pyramid": ("pyramid5",),
}
"""Elements with all nodes of an order, from order 1 on."""


def element(name: str, order: int | None = None) -> Element:
    """Return the element of a name, or of a shape and an order.

    Parameters
    ----------
    name : str
        "hex20", or a shape: "line", "quad" and "hex" (orders 1 to 6), "tri", "tet" and "wedge"
        (1 and 2), "pyramid" (1).
    order : int, optional
        Order of the shape, element("hex", order=4).

    Returns
    -------
    Element
        The element.

    Raises
    ------
    ValueError
        There is no such element; the message names those that there are.
    """
    if order is not None:
        if name not in SHAPES:
            raise ValueError(f"no shape {name!r} of elements; there are {', '.join(SHAPES)}")
        of_shape = SHAPES[name]
        if order not in range(1, len(of_shape) + 1):
            last = f" to {len(of_shape)}" if len(of_shape) > 1 else ""
            raise ValueError(f"order = {order!r} of {name}: allowed is 1{last}")
        name = of_shape[order - 1]
    if name not in ELEMENTS:
        raise ValueError(f"no element {name!r}; there are {', '.join(ELEMENTS)}")
    return ELEMENTS[name]


def of(nodes: int, dimension: int) -> Element | None:
    """The element with so many nodes in so many dimensions."""
    same = (e for e in ELEMENTS.values() if (len(e.nodes), e.dimension) == (nodes, dimension))
    return next(same, None)


def linear(element: Element) -> Element:
    """The element of order 1 on the same reference cell."""
    return next(e for e in ELEMENTS.values() if e.cell is element.cell and e.order == 1)


_THICK = {"line": "square", "square": "cube", "triangle": "wedge"}
_BUBBLE = 5
"""Nodes of a pyramid, and of a tetrahedron with a bubble, which is no element of ours."""


def foreign(rule: QuadratureRule, nodes: int) -> str:
    """Message for a rule of another cell than the one with so many nodes.

    A line, triangle or quadrilateral that is integrated over its thickness has the rule of the cell
    with one dimension more.
    """
    element = of(nodes, rule.dimension)
    if element is None or element.cell.fits(rule) or nodes == _BUBBLE:
        return ""
    others = [cell for cell in CELLS.values() if cell.fits(rule)]
    middle = of(nodes, rule.dimension - 1)
    if middle and others and others[0].name == _THICK.get(middle.cell.name):
        return ""
    return misfit(element.cell, others[0].name) if others else ""


def misfit(cell: ReferenceCell, other: str = "") -> str:
    """Message for a rule that does not fit a reference cell, that of another one if it is named."""
    whose = f"is that of a {other}" if other else "does not fit the cell"
    return (
        f"the rule {whose}: points of a {cell.name} lie in it and its weights sum to "
        f"{cell.measure}; take e.g. quadrature.{cell.example}"
    )


CELL_TABLE = "cells.json"
"""File of the table of all elements for the runtime."""


def cell_table() -> str:
    """The table as JSON, a line for each element; numbers are the nearest doubles."""
    lines = (f' "{name}": {json.dumps(_row(e))}' for name, e in ELEMENTS.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _row(element: Element) -> dict[str, Any]:
    """Of products of lines the nodes of the line, and their numbers along the directions."""
    cell, files = element.cell, element.files
    row: dict[str, Any] = {
        "shape": cell.name,
        "corners": len(cell.corners),
        "sides": cell.sides,
        "faces": element.face_kinds,
        "lower": cell.lower,
        "collapse": cell.collapse,
        "order": element.order,
    }
    if element.lines is None:
        row["nodes"] = [[float(c) for c in node] for node in element.nodes]
        row["exponents"] = element.exponents
        row["coefficients"] = [[float(c) for c in r] for r in element.coefficients().tolist()]
    else:
        row["line"] = [float(c) for c in line_nodes(element.order)]
        row["lines"] = element.lines
    row["meshio"] = files.meshio
    row["gmsh"] = [files.gmsh, files.gmsh_nodes]
    row["abaqus"] = [files.abaqus.split(), files.abaqus_nodes]
    row["vtk_mirrored"] = files.vtk_mirrored
    return row
