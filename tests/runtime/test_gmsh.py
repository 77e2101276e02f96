"""Files that a real Gmsh wrote (`tests/runtime/gmsh/make.py`): every cell once, with every name."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.mesh import Mesh, MeshError

FOLDER = Path(__file__).parent / "gmsh"
VOLUMES = {"low": 0.5, "high": 0.5, "all": 1.0}
PLACES = {"left": 0.0, "held": 0.0, "right": 2.0}


def volume(mesh: Mesh, nodes: np.ndarray, kind: str) -> float:
    """By the shape functions: wrong where a cell stands twice or its nodes are out of order."""
    cell = CELLS[kind]
    points, weights = cell.rule(4)
    slopes = np.einsum("qkd,nkc->nqcd", cell.gradient(points), mesh.points[nodes])
    metric = np.einsum("nqci,nqcj->nqij", slopes, slopes)
    return float((np.sqrt(np.linalg.det(metric)) @ weights).sum())


def misplaced(mesh: Mesh) -> float:
    """How far nodes of cells with straight sides are from where their corners say."""
    worst = 0.0
    for kind, nodes in mesh.cells.items():
        cell = CELLS[kind]
        flat = {3: "tri3", 4: "quad4" if cell.dimension == 2 else "tet4", 6: "wedge6", 8: "hex8"}[
            cell.corners
        ]
        expected = np.einsum(
            "ak,nkc->nac", CELLS[flat].shape(cell.nodes), mesh.points[nodes[:, : cell.corners]]
        )
        worst = max(worst, float(np.abs(mesh.points[nodes] - expected).max()))
    return worst


def test_every_file_has_each_cell_once_with_all_its_names() -> None:
    files = [f for f in sorted(FOLDER.glob("*.msh")) if not f.name.startswith("parts")]
    assert len(files) == 33
    for file in files:
        mesh = Mesh.read(file)
        mesh.check()
        whole = 2.0**mesh.dimension
        assert misplaced(mesh) < 1e-9, file.name
        assert set(mesh.groups) == set(VOLUMES), file.name
        for name, share in VOLUMES.items():
            ((kind, nodes),) = mesh.cells_of(name).items()
            assert volume(mesh, nodes, kind) == pytest.approx(share * whole), (file.name, name)
        assert set(mesh.sides) == set(PLACES), file.name
        for name, x in PLACES.items():
            ((kind, faces),) = mesh.faces(name).items()
            assert volume(mesh, faces, kind) == pytest.approx(whole / 2.0), (file.name, name)
            np.testing.assert_allclose(mesh.points[faces][..., 0], x, atol=1e-9)


SQUARE = (FOLDER / "square_41.msh").read_text()
DAMAGED = {
    "cells of Gmsh's type 19 are not known": re.sub(r"\n2 1 2 (\d)\n", r"\n2 1 19 \1\n", SQUARE),
    "a section is shorter than it says": SQUARE.replace("$Elements\n4 ", "$Elements\n9 "),
    "version 3: save it as 4.1 or 2.2": SQUARE.replace("4.1 0 8", "3 0 8"),
    "no nodes or no cells": SQUARE[: SQUARE.index("$Elements")],
    "the file ends in": SQUARE[: SQUARE.index("$EndElements")],
}


@pytest.mark.parametrize("words", DAMAGED)
def test_a_damaged_file_is_named(words: str, tmp_path: Path) -> None:
    file = tmp_path / "damaged.msh"
    file.write_text(DAMAGED[words])
    with pytest.raises(MeshError, match=words) as error:
        Mesh.read(file)
    assert "\n" not in str(error.value)
