"""Rare combinations of a study: groups of one kind of cells, ties to a place, one cell alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softehl
from softehl import Mesh, Study
from softehl.runtime.mesh.mesh import MeshError
from softehl.runtime.study import StudyError

MODELS = Path(__file__).parents[2] / "docs" / "models"


def two_kinds() -> Mesh:
    """A square cell beside two triangles."""
    points = np.array([[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1.0]])
    cells = {"quad4": np.array([[0, 1, 4, 3]]), "tri3": np.array([[1, 2, 5], [1, 5, 4]])}
    mesh = Mesh(points, cells).with_group("square", lambda x: x[:, 0] < 1)
    return mesh.with_group("triangles", lambda x: x[:, 0] > 1)


def test_a_group_of_one_kind_of_cells_in_a_mesh_of_two_kinds() -> None:
    """Under uniform tension both kinds have the same exact solution."""
    study = Study(two_kinds())
    study.add("a", MODELS / "mean_pressure.py", cells="square", mu=0.5, K=1e-9)
    study.add("b", material="hooke", cells="triangles", E=1.0, nu=0.0)
    study.fix(lambda x: x[:, 0] == 0, u_x=0)
    study.fix((0.0, 0.0), u_y=0)
    study.load(lambda x: x[:, 0] == 2, u_x=1e-6)
    result = study.solve()
    assert list(study.system().blocks) == ["a", "b"]
    np.testing.assert_allclose(result.values("u_x"), 1e-6 * study.mesh.points[:, 0], rtol=1e-4)
    assert result.fields("a")["p"].shape[0] == 1


def plate() -> Study:
    study = Study(Mesh.rectangle(2, 1, cells=(4, 4)))
    study.add("body", material="hooke", E=1.0, nu=0.3)
    study.fix("left", u_x=0, u_y=0)
    return study


def test_a_side_that_is_tied_to_a_place_moves_as_one() -> None:
    tied, prescribed = plate(), plate()
    tied.tie("right", (2.0, 0.5), "u_x")
    tied.load((2.0, 0.5), u_x=0.01)
    result = tied.solve()
    moved = result.values("u_x")[tied.mesh.nodes("right")]
    assert np.ptp(moved) < 1e-15
    prescribed.fix("right", u_x=lambda x, t: t * moved[0])
    other = prescribed.solve()
    assert other.reaction("right")["u_x"] == pytest.approx(0.01, rel=1e-12)
    np.testing.assert_allclose(result.values("u_y"), other.values("u_y"), atol=1e-15)
    tied.tie("top", (0.0, 0.0), "u_y", offset=0.1)  # a place elsewhere may be apart
    with pytest.raises(StudyError, match="the place is a node of the side: offset must be 0"):
        tied.tie("right", (2.0, 0.0), "u_x", offset=0.1)
    with pytest.raises(StudyError, match=r"9 and 5 nodes; sides of equal nodes .* or a side to"):
        tied.tie(np.arange(9), "left", "u_x")


@softehl.page
def bare(m: Any) -> None:
    """A linear spring of a body, without fields."""
    u = m.vector("u")
    (E,) = m.parameters(E="modulus")
    m.weak(E * (m.grad(u) + m.grad(u).T) / 2, m.grad(u))


def test_a_page_without_fields_has_none(tmp_path: Path) -> None:
    study = Study(Mesh.rectangle(1, 1, cells=(2, 1)))
    study.add("body", bare, E=1.0)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_x=0.1)
    result = study.solve()
    assert result.fields("body") == result.at_nodes("body") == {}
    result.write(tmp_path / "bare.vtu")
    with pytest.raises(KeyError, match="no block 'bodi'"):
        result.fields("bodi")


@pytest.mark.parametrize(("dimension", "kind"), [(2, "point1"), (3, "line2"), (3, "point1")])
def test_a_side_without_faces_is_named(dimension: int, kind: str) -> None:
    box = Mesh.box((1, 1, 1), cells=(1, 1, 1))
    mesh = box if dimension == 3 else Mesh.rectangle(1, 1, cells=(1, 1))
    nodes = np.arange(2 if kind == "line2" else 1)[None]
    study = Study(Mesh(mesh.points, mesh.cells, sides={**mesh.sides, "rim": {kind: nodes}}))
    words = {"point1": "nodes", "line2": "lines"}[kind]
    needed = {2: "lines", 3: "faces"}[dimension]
    message = rf"side 'rim' is of {words} \({kind}\); in {dimension}-D .* {needed} .* such as left"
    with pytest.raises(MeshError, match=message):
        study.pressure("rim", 1.0)
    with pytest.raises(MeshError, match=message):
        study.contact("left", "rim")
