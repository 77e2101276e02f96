"""Values of fields between the nodes at which they stand.

A field of lower order than its cells stands at their corners only: a pressure on quadratic cells.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np

from softehl.runtime.arrays import Array, Integers
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.statement.records import Block
from softehl.runtime.system import System

_NOTHING = 1e-9  # a shape function below that is zero but for rounding


def shares(system: System, place: Array) -> dict[str, tuple[Integers, Array]] | None:
    """Unknown -> numbers (k,) and weights (k,) that make its value at a place (dim,).

    Without unknowns that the cell at the place does not have; None where no cell is there.
    """
    holding = system.mesh.holding(place)
    if holding is None:
        return None
    nodes, weights = holding
    found = {}
    for name, numbers in system.numbering.nodal.items():
        there = numbers[nodes]
        if (there[np.abs(weights) > _NOTHING] >= 0).all():
            found[name] = there[there >= 0], weights[there >= 0]
            continue
        for block in _at_corners(system, name):
            if nodes.shape == block.nodes.shape[1:] and (block.nodes == nodes).all(axis=1).any():
                linear = _linear(block.kind)
                found[name] = there[: linear.shape[1]], weights @ linear
    return found


def between_nodes(
    system: System, place: Array, nodal: Mapping[str, Array]
) -> dict[str, float] | None:
    """Values at a place (dim,) of fields by their values at nodes, (points,); nan where one that
    matters is nan; None where no cell is there.
    """
    holding = system.mesh.holding(place)
    if holding is None:
        return None
    nodes, weights = holding
    some = np.abs(weights) > _NOTHING  # at a side between blocks only nodes of the side matter
    return {name: float(v[nodes[some]] @ weights[some]) for name, v in nodal.items()}


def at_every_node(system: System, x: Array) -> dict[str, Array]:
    """Unknown -> values (points,) of x, (n,), also at the other nodes of cells at whose corners it
    stands; nan where there is none.
    """
    found = {}
    for name, numbers in system.numbering.nodal.items():
        values = found[name] = np.where(numbers >= 0, x[numbers], np.nan)
        for block in _at_corners(system, name):
            linear = _linear(block.kind)
            corners = linear.shape[1]
            values[block.nodes[:, corners:]] = values[block.nodes[:, :corners]] @ linear[corners:].T
    return found


def _at_corners(system: System, name: str) -> list[Block]:
    """Blocks in which an unknown stands at the corners of the elements only."""
    found = []
    for block in system.blocks.values():
        cell = CELLS.get(block.kind)
        nodes = {slot.node for slot in block.slots if slot.name == name}
        if cell and cell.order > 1 and nodes == set(range(cell.corners)):
            found.append(block)
    return found


@cache
def _linear(kind: str) -> Array:
    """Values (nodes, corners) at all nodes of a cell by those at its corners."""
    cell = CELLS[kind]
    flat = next(
        c
        for c in CELLS.values()
        if c.dimension == cell.dimension and c.corners == cell.corners and c.order == 1
    )
    return flat.shape(cell.nodes)
