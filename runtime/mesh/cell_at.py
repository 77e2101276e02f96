"""The cell of any kind that holds a place, and its shape functions there."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mesh.cells import CELLS, Cell

_NEAR = 1e-9  # of the size of a cell: places closer than that to it are in it


def cell_at(
    points: Array, cells: Mapping[str, Integers], place: Array, near: float
) -> tuple[Integers, Array] | None:
    """The nodes (k,) of the cell that holds a place (dim,), and their shape functions there.

    Cells of the highest dimension come first. near: how far a place may be off a line in a plane,
    or off a surface in space, that holds it.
    """
    for kind, nodes in sorted(cells.items(), key=lambda item: -CELLS[item[0]].dimension):
        cell, places = CELLS[kind], points[nodes]
        low, high = places.min(axis=1), places.max(axis=1)
        margin = 0.1 * (high - low).max(axis=1, keepdims=True) + near
        around = ((low - margin <= place) & (place <= high + margin)).all(axis=1)
        for row in np.flatnonzero(around):
            parent = _parent_place(cell, places[row], place, near)
            if parent is not None:
                return nodes[row], cell.shape(parent[None])[0]
    return None


def _parent_place(cell: Cell, places: Array, place: Array, near: float) -> Array | None:
    """Parent coordinates of a place in a cell with nodes at `places`, None if it lies outside."""
    xi = cell.nodes[: cell.corners].mean(axis=0)
    for _ in range(20 if cell.dimension else 0):
        defect = cell.shape(xi[None])[0] @ places - place
        slope = np.einsum("kd,kc->cd", cell.gradient(xi[None])[0], places)
        step = np.linalg.lstsq(slope, defect, rcond=None)[0]
        xi = xi - step
        if np.abs(step).max() < 1e-13:
            break
    margin = _NEAR
    if cell.dimension < len(place):
        if np.linalg.norm(cell.shape(xi[None])[0] @ places - place) > near:
            return None
        size = float(np.ptp(places, axis=0).max())
        margin = max(margin, near / size) if size else margin
    return xi if cell.holds(xi, margin) else None
