"""Several meshes as one: bodies side by side, with names of their own."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from softehl.runtime.arrays import Integers
from softehl.runtime.mesh.mesh import Mesh, MeshError


def union(parts: Mapping[str, Mesh]) -> Mesh:
    """See `Mesh.union`."""
    if not parts:
        raise MeshError("union: give meshes by name, Mesh.union(disc=disc, block=block)")
    invalid = [name for name, part in parts.items() if not isinstance(part, Mesh)]
    if invalid:
        raise MeshError(
            f"union: {invalid[0]} is {type(parts[invalid[0]]).__name__}, must be a Mesh"
        )
    dimensions = {name: part.dimension for name, part in parts.items()}
    if len(set(dimensions.values())) > 1:
        counts_text = ", ".join(f"{name} has {count}" for name, count in dimensions.items())
        raise MeshError(f"union: meshes of one number of coordinates are needed; {counts_text}")
    cells: dict[str, list[Integers]] = {}
    groups: dict[str, dict[str, Integers]] = {}
    sides: dict[str, dict[str, Integers]] = {}
    first = 0
    for name, part in parts.items():
        offset = {kind: sum(map(len, cells.get(kind, ()))) for kind in part.cells}
        groups[name] = {k: offset[k] + np.arange(len(v)) for k, v in part.cells.items()}
        for group, numbers in part.groups.items():
            groups[f"{name}:{group}"] = {k: offset[k] + v for k, v in numbers.items()}
        for side, faces in {"boundary": part.boundary, **part.sides}.items():
            sides[f"{name}:{side}"] = {k: first + v for k, v in faces.items()}
        for kind, nodes in part.cells.items():
            cells.setdefault(kind, []).append(first + nodes)
        first += len(part.points)
    return Mesh(
        np.concatenate([part.points for part in parts.values()]),
        {kind: np.concatenate(rows) for kind, rows in cells.items()},
        groups,
        sides,
    )
