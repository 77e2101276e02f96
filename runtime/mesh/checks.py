"""Faults of a mesh: inverted cells, cells or faces that occur twice."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from softehl.errors import SoftehlError
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mesh.cells import CELLS, jacobians
from softehl.runtime.mesh.face_matching import is_repeated

if TYPE_CHECKING:
    from softehl.runtime.mesh.mesh import Mesh


class MeshError(SoftehlError, ValueError):
    """A mesh, or a name in it, cannot be used; the message says what is there."""


def check(mesh: Mesh) -> None:
    """See `Mesh.check`."""
    for kind, nodes in mesh.cells.items():
        _require_once(mesh, "", kind, nodes)
    for name, side in mesh.sides.items():
        for kind, faces in side.items():
            _require_once(mesh, f"side {name!r}: ", kind, faces)
    for name, group in mesh.groups.items():
        for kind, numbers in group.items():
            count = len(mesh.cells.get(kind, ()))
            if (len(numbers) and numbers.dtype.kind not in "iu") or not (
                (numbers >= 0) & (numbers < count)
            ).all():
                raise MeshError(
                    f"group {name!r}: whole numbers below {count}, of {kind}, are needed"
                )
            if len(np.unique(numbers)) < len(numbers):
                raise MeshError(f"group {name!r}: the number of a {kind} stands twice")
    for kind, nodes in mesh.cells.items():
        _require_upright(mesh, kind, nodes)


def _require_once(mesh: Mesh, where: str, kind: str, nodes: Integers) -> None:
    """Raise MeshError for the same nodes twice: a stiffness or a load would count twice."""
    again = is_repeated(nodes)
    if again.any():
        first = int(again.argmax())
        raise MeshError(
            f"{where}{int(again.sum())} of {len(nodes)} {kind} have the nodes of one before, such "
            f"as number {first} at {place_text(mesh.points[nodes[first]].mean(axis=0))}: give "
            "each once (two pages on the same cells are two calls of study.add)"
        )


def _require_upright(mesh: Mesh, kind: str, nodes: Integers) -> None:
    cell = CELLS[kind]
    if cell.dimension != mesh.dimension or not len(nodes):
        return
    points = mesh.points[nodes]
    smallest = jacobians(cell, points, cell.rule(2 * cell.order)[0]).min(axis=1)
    worst = int(smallest.argmin())
    if smallest[worst] <= 0.0:
        count = int((smallest <= 0.0).sum())
        raise MeshError(
            f"{count} of {len(nodes)} {kind} are turned inside out or flat, such as number "
            f"{worst} at {place_text(points[worst].mean(axis=0))}: number its nodes in the "
            "order of VTK (in the plane counterclockwise)"
        )


def place_text(x: Array) -> str:
    """Coordinates, for messages."""
    return "(" + ", ".join(f"{value:.4g}" for value in x) + ")"
