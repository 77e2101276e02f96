"""Values of fields between the nodes at which they stand.

A field of lower order than its cells stands at their corners only: a pressure on quadratic cells.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.definition.problem_definition import Block
from softehl.runtime.discretisation.dofmap import DofLayout
from softehl.runtime.equations.system import System
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.point_location import Located

_NOTHING = 1e-9  # a shape function below that is zero but for rounding
_APART = 1e-9  # of the largest component of a vector: values differ by more than rounding


@dataclass(frozen=True, eq=False)
class Interpolation:
    """Values of unknowns in cells that hold places.

    layout: of the unknowns. located: pairs of a place and a cell. entries: unknown -> pairs,
    unknowns and weights (e,) each. defined: unknown -> whether a pair (m,) has a value of it.
    """

    layout: DofLayout
    located: Located
    entries: Mapping[str, tuple[Integers, Integers, Array]]
    defined: Mapping[str, Flags]

    def values(self, x: Array) -> dict[str, Array]:
        """Unknown -> values (m,) of x, (n,), nan where a cell has none."""
        pairs = len(self.located.point)
        return {
            name: np.where(self.defined[name], np.bincount(pair, weight * x[dof], pairs), np.nan)
            for name, (pair, dof, weight) in self.entries.items()
        }

    def jump(self, x: Array) -> tuple[str, Integers] | None:
        """An unknown of x that differs between two cells at a place where they have copies of
        nodes, and these two pairs; None where all unknowns are continuous.
        """
        located = self.located
        if len(located.first) == len(located.point):
            return None
        first = located.first[np.searchsorted(located.point[located.first], located.point)]
        values = self.values(x)
        vectors = zip(self.layout.vectors, self.layout.fields, strict=True)
        sizes = {name: np.abs(x[part]).max(initial=0) for names, part in vectors for name in names}
        for name, (pair, dof, weight) in self.entries.items():
            distance = np.abs(values[name] - values[name][first])
            for k in np.flatnonzero(distance > _APART * sizes[name]):
                both = [set(dof[(pair == p) & (np.abs(weight) > _NOTHING)]) for p in (k, first[k])]
                if both[0] != both[1]:
                    return name, np.array([first[k], k])
        return None


def interpolate_unknowns(system: System, points: Array, group: str | None = None) -> Interpolation:
    """Unknowns at places (n, dim), in the cells, of a group, that hold them."""
    located = system.mesh.holding(points, group)
    entries: dict[str, list[tuple[Integers, Integers, Array]]] = {}
    defined: dict[str, Any] = {
        name: np.zeros(len(located.point), np.bool_) for name in system.numbering.nodal
    }
    for kind, pairs in located.by_kind():
        cell, nodes = CELLS[kind], system.mesh.cells[kind][located.row[pairs]]
        weights = cell.shape(located.parent[pairs, : cell.dimension])
        for name, numbers in system.numbering.nodal.items():
            dofs = numbers[nodes]
            inside = np.asarray(((dofs >= 0) | (np.abs(weights) <= _NOTHING)).all(axis=1))
            parts = [(np.flatnonzero(inside), weights)]
            for block in _at_corners(system, name) if not inside.all() else ():
                if block.kind == kind:
                    lower = np.flatnonzero(~inside & _among(nodes, block.nodes))
                    linear = CELLS[kind].corner_shape
                    corners = np.zeros_like(weights)
                    corners[:, : linear.shape[1]] = weights @ linear
                    parts.append((lower, corners))
                    inside[lower] = True
            for rows, shape in parts:
                row, column = np.nonzero(dofs[rows] >= 0)
                row = rows[row]
                entry = pairs[row], dofs[row, column], shape[row, column]
                entries.setdefault(name, []).append(entry)
            defined[name][pairs] = inside
    joined = {
        n: tuple(map(np.concatenate, zip(*parts, strict=True))) for n, parts in entries.items()
    }
    return Interpolation(system.numbering.layout, located, joined, defined)  # type: ignore[arg-type]


def _among(rows: Integers, candidates: Integers) -> Flags:
    """Which rows (m, k) are among the known ones (n, k)."""
    similar = candidates[np.isin(candidates[:, 0], rows[:, 0])]
    existing = set(map(tuple, similar.tolist()))
    return np.array([tuple(row) in existing for row in rows.tolist()], dtype=np.bool_)


def interpolation_weights(system: System, point: Array) -> dict[str, tuple[Integers, Array]] | None:
    """Unknown -> numbers (k,) and weights (k,) that make its value at a place (dim,), in the first
    cell that holds it.

    Without unknowns that this cell does not have; None where no cell is there.
    """
    interpolated = interpolate_unknowns(system, np.asarray(point)[None])
    if not len(interpolated.located.point):
        return None
    in_first_cell = {
        name: entry[0] == 0
        for name, entry in interpolated.entries.items()
        if interpolated.defined[name][0]
    }
    return {
        n: (interpolated.entries[n][1][rows], interpolated.entries[n][2][rows])
        for n, rows in in_first_cell.items()
    }


def interpolate_nodal(
    system: System, points: Array, nodal: Mapping[str, Array], group: str | None = None
) -> list[dict[str, float] | None]:
    """Values at places (n, dim) of fields by their values at nodes, (points,), in the first cell
    of a group that has them; nan where none has, None where no cell is there.
    """
    located = system.mesh.holding(points, group)
    values = {name: np.empty(len(located.point)) for name in nodal}
    for kind, pairs in located.by_kind():
        cell, nodes = CELLS[kind], system.mesh.cells[kind][located.row[pairs]]
        weights = cell.shape(located.parent[pairs, : cell.dimension])
        some = np.abs(weights) > _NOTHING  # at a side between blocks only nodes of the side matter
        for name, field in nodal.items():
            values[name][pairs] = np.where(some, field[nodes] * weights, 0.0).sum(axis=1)
    rows: list[dict[str, float] | None] = [None] * len(points)
    for pair, point in enumerate(located.point.tolist()):
        row = rows[point]
        if row is None or all(map(np.isnan, row.values())):
            rows[point] = {name: float(field[pair]) for name, field in values.items()}
    return rows


def at_every_node(system: System, x: Array) -> dict[str, Array]:
    """Unknown -> values (points,) of x, (n,), also at the other nodes of cells at whose corners it
    stands; nan where there is none.
    """
    nodal_values = {}
    for name, dofs in system.numbering.nodal.items():
        values = nodal_values[name] = np.where(dofs >= 0, x[dofs], np.nan)
        for block in _at_corners(system, name):
            linear = CELLS[block.kind].corner_shape
            corners = linear.shape[1]
            values[block.nodes[:, corners:]] = values[block.nodes[:, :corners]] @ linear[corners:].T
    return nodal_values


def _at_corners(system: System, name: str) -> list[Block]:
    """Blocks in which an unknown stands at the corners of the elements only."""
    blocks = []
    for block in system.blocks.values():
        cell = CELLS.get(block.kind)
        nodes = {slot.node for slot in block.slots if slot.name == name}
        if cell and cell.order > 1 and nodes == set(range(cell.corners)):
            blocks.append(block)
    return blocks
