"""Unknowns and nodal fields at points of the reference body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from softehl.log import warn
from softehl.runtime.arrays import Array
from softehl.runtime.equations.interpolation import interpolate_nodal, interpolate_unknowns
from softehl.runtime.mesh.checks import place_text
from softehl.runtime.mesh.mesh import MeshError
from softehl.runtime.suggestions import join_names

if TYPE_CHECKING:
    from softehl.runtime.equations.system import System


def point_values(
    system: System, data: Array | Mapping[str, Array], points: Array, group: str | None
) -> list[dict[str, float]]:
    """Values at each point (n, dim); group: of cells, where bodies share no nodes.

    data: all unknowns, or nodal fields by name.  Raises MeshError for a point outside.
    """
    if isinstance(data, Mapping):
        local_rows = interpolate_nodal(system.everywhere, points, data, group)
    else:
        local_rows = _unknowns_at(system.everywhere, data, points, group)
    rows = system.comm.first_not_none(local_rows)
    for point, row in zip(points, rows, strict=True):
        if row is None:
            where = "the mesh" if group is None else f"the cells {group!r}"
            raise MeshError(f"{place_text(point)} lies outside {where}")
    return [row for row in rows if row is not None]


def _unknowns_at(
    system: System, x: Array, points: Array, group: str | None
) -> list[dict[str, float] | None]:
    """Unknowns at each point (n, dim), None outside; a warning where bodies differ."""
    interpolated = interpolate_unknowns(system, points, group)
    located, values = interpolated.located, interpolated.values(x)
    jump = interpolated.jump(x)
    if jump is not None:
        name, pairs = jump
        a, b = values[name][pairs]
        point = place_text(points[located.point[pairs[0]]])
        warn(
            f"{name} at {point} is {a:.6g} in one cell and {b:.6g} in another, which do not "
            f'share their nodes; the first is taken: name a group, cells="..." '
            f"({join_names(system.mesh.groups)})",
            stacklevel=4,
        )
    rows: list[dict[str, float] | None] = [None] * len(points)
    for pair in located.first.tolist():
        rows[located.point[pair]] = {
            n: float(values[n][pair])
            for n, defined in interpolated.defined.items()
            if defined[pair]
        }
    return rows
