"""Table of all elements for the runtime: `generated/cells.json`, from the exact definitions."""

from __future__ import annotations

import json
from typing import Any

from softehl.codegen.elements.cells import ELEMENTS
from softehl.codegen.elements.element import Element, line_nodes

NAME = "cells.json"


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
