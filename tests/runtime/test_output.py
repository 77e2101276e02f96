"""Files for ParaView: cells in the order of VTK, fields at nodes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from softehl import Mesh
from softehl.runtime.arrays import Array
from softehl.runtime.results.output import VtuFields

SIZE = (2.0, 1.0, 3.0)
FACES = {
    "tetra": ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)),
    "hexahedron": (
        *((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4)),
        *((3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7)),
    ),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
}
"""Corners of faces as VTK's documentation lists them, seen from outside counterclockwise."""


def volume(corners: Array, kind: str) -> float:
    """Flux of x / 3 through the faces of a cell, which are plane."""
    total = 0.0
    for face in FACES[kind]:
        x = corners[list(face)]
        area = sum(np.cross(x[k] - x[0], x[k + 1] - x[0]) for k in range(1, len(x) - 1)) / 2
        total += float(x[0] @ area) / 3
    return total


@pytest.mark.parametrize("suffix", [".vtu", ".vtk", "result"])
def test_volumes_by_the_faces_of_vtk_are_positive(suffix: str, tmp_path: Path) -> None:
    shapes: dict[str, dict[str, Any]] = {
        **{"wedge": {"shape": "wedge"}, "tetra": {"shape": "tetrahedron"}, "hexahedron": {}},
        **{"tetra10": {"shape": "tetrahedron", "order": 2}, "hexahedron27": {"order": 2}},
        **{"hexahedron20": {"shape": "serendipity", "order": 2}, "high": {"order": 3}},
    }
    for name, given in shapes.items():
        mesh = Mesh.box(SIZE, cells=(1, 2, 1), **given)
        path = tmp_path / f"{name}.vtu"
        if suffix == "result":
            VtuFields(mesh.points, mesh.cells, {}, {}).write(path)
        elif name != "high":
            mesh.write(path := path.with_suffix(suffix))
            kind, nodes = next(iter(mesh.cells.items()))
            np.testing.assert_array_equal(Mesh.read(path).cells[kind], nodes)
        else:
            continue
        found = meshio.read(path)
        cells = found.cells[0]  # then those of its sides
        kind = cells.type.rstrip("0123456789")
        volumes = [
            volume(found.points[nodes[: {"tetra": 4}.get(kind, 8)]], kind) for nodes in cells.data
        ]
        assert min(volumes) > 0.0, name
        assert sum(volumes) == pytest.approx(6.0, rel=1e-12), name


def test_wedges_of_files_in_the_order_of_gmsh_are_read_too(tmp_path: Path) -> None:
    mesh = Mesh.box(SIZE, cells=(1, 1, 1), shape="wedge")
    meshio.write(tmp_path / "a.vtu", meshio.Mesh(mesh.points, [("wedge", mesh.cells["wedge6"])]))
    read = Mesh.read(tmp_path / "a.vtu")
    read.check()
    np.testing.assert_array_equal(read.cells["wedge6"], mesh.cells["wedge6"])
