"""Location of points: curved cells of every kind and order, boundaries, copies of nodes, cost."""

from __future__ import annotations

import numpy as np
import pytest

from softehl import Mesh, Study
from softehl.runtime.arrays import Array
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.mesh.mesh import MeshError
from softehl.runtime.mesh.point_location import Located, PointLocator

SHAPES = [(shape, n) for shape in ("quad", "hex") for n in (1, 2, 3, 6)]
SHAPES += [("serendipity", 2), ("triangle", 1), ("triangle", 2), ("tetrahedron", 1)]
SHAPES += [("tetrahedron", 2), ("wedge", 1), ("wedge", 2), ("pyramid", 1)]


def bent(shape: str, order: int, cells: int = 2) -> Mesh:
    """Cells between circles; by order 1 straight ones."""
    if shape in ("quad", "triangle"):
        mesh = Mesh.rectangle(1.0, 1.0, cells=(cells, cells), order=order, shape=shape)  # type: ignore[arg-type]
    else:
        mesh = Mesh.box((1.0, 1.0, 0.5), cells=(cells, cells, 1), order=order, shape=shape)  # type: ignore[arg-type]

    def move(x: Array) -> Array:
        angle, radius = 1.5 * x[:, 0], 1.0 + x[:, 1]
        rest = [x[:, 2:] + 0.2 * np.sin(2.0 * x[:, :1])] if x.shape[1] == 3 else []
        ring = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
        return np.concatenate([ring, *rest], axis=1)

    return mesh.map(move)


def positions(mesh: Mesh, found: Located) -> Array:
    """Of the points that were located, by the shape functions."""
    x = np.zeros((len(found.point), mesh.dimension))
    for kind, pairs in found.by_kind():
        cell = CELLS[kind]
        weights = cell.shape(found.parent[pairs, : cell.dimension])
        x[pairs] = np.einsum("mk,mkd->md", weights, mesh.points[mesh.cells[kind][found.row[pairs]]])
    return x


@pytest.mark.parametrize(
    ("shape", "order"),
    [pytest.param(*s, marks=[pytest.mark.slow] * (s == ("hex", 6))) for s in SHAPES],
)
def test_points_of_bent_cells_are_in_them(shape: str, order: int, rng: np.random.Generator) -> None:
    mesh = bent(shape, order)
    ((kind, nodes),) = mesh.cells.items()
    cell = CELLS[kind]
    corners = cell.nodes[: cell.corners]
    parent = rng.dirichlet(np.ones(len(corners)), 40) @ corners  # inside the parent element
    rows = rng.integers(len(nodes), size=40)
    places = np.einsum("mk,mkd->md", cell.shape(parent), mesh.points[nodes[rows]])
    found = mesh.holding(places)
    np.testing.assert_array_equal(found.point, np.arange(40))
    np.testing.assert_array_equal(found.row, rows)
    np.testing.assert_allclose(found.parent[:, : cell.dimension], parent, atol=1e-10)
    some = mesh.points[:: max(1, len(mesh.points) // 50)]
    for shift in (0.0, 4e-16, -4e-16):  # nodes, and what rounding makes of them
        on = mesh.holding(some * (1.0 + shift))
        np.testing.assert_array_equal(np.unique(on.point), np.arange(len(some)))
        np.testing.assert_allclose(positions(mesh, on), some[on.point], atol=1e-14)
        np.testing.assert_array_equal(on.first, np.flatnonzero(np.diff(on.point, prepend=-1)))
    beyond = mesh.points[mesh.nodes(lambda x: np.hypot(x[:, 0], x[:, 1]) > 2.0 - 1e-12)]
    beyond = beyond[:: max(1, len(beyond) // 20)]
    beyond[:, :2] *= 1.0 + 1e-7
    assert not len(mesh.holding(beyond).point)


def test_the_nearest_cell_is_that_of_a_search_of_all(rng: np.random.Generator) -> None:
    mesh = bent("quad", 1, 5)
    places = rng.uniform(-1.0, 3.0, (60, 2))
    locator = PointLocator(mesh.points, mesh.cells, 1e-9)
    found = locator.nearest(places)
    np.testing.assert_array_equal(found.point, np.arange(60))
    corners = mesh.points[mesh.cells["quad4"]]
    distance = np.full(60, np.inf)  # by edges and insides of all cells
    for a, b in zip(
        corners.transpose(1, 0, 2), np.roll(corners, -1, 1).transpose(1, 0, 2), strict=True
    ):
        along = np.clip(
            ((places[:, None] - a) * (b - a)).sum(-1) / ((b - a) ** 2).sum(-1), 0.0, 1.0
        )
        away = np.linalg.norm(places[:, None] - a - along[..., None] * (b - a), axis=-1)
        distance = np.minimum(distance, away.min(axis=1))
    inside = locator.holding(places).point
    distance[inside] = 0.0
    away = np.linalg.norm(positions(mesh, found) - places, axis=1)
    assert (away >= distance - 1e-12).all()
    assert np.median(away - distance) < 0.02  # the foot of a bilinear cell is not quite the nearest


def touching_bars() -> Study:
    left = Mesh.rectangle(1.0, 1.0, cells=(2, 2))
    mesh = Mesh.union(left=left, right=left.map(lambda x: x + np.array([1.0, 0.0])))
    study = Study(mesh)
    for name in ("left", "right"):
        study.add(name, material="hooke", cells=name, E=1.0, nu=0.0)
        study.fix(f"{name}:boundary", u_y=0)
    study.fix("left:boundary", u_x=0)
    study.fix("right:boundary", u_x=0.5)
    return study


def test_at_a_place_of_two_bodies_the_value_is_that_of_the_group() -> None:
    result = touching_bars().solve()
    for name, value in (("left", 0.0), ("right", 0.5)):
        assert result.at((1.0, 0.25), cells=name)["u_x"] == pytest.approx(value)
    with pytest.warns(UserWarning, match=r"u_x at \(1, 0\.25\) is 0 in one cell and 0\.5 in anoth"):
        assert result.at((1.0, 0.25))["u_x"] == pytest.approx(0.0)
    with pytest.warns(UserWarning, match=r'name a group, cells="\.\.\." \(left, right\)'):
        line = result.along((0.5, 0.25), (1.5, 0.25), 3)
    np.testing.assert_allclose(line["u_x"], [0.0, 0.0, 0.5], atol=1e-12)
    with pytest.raises(MeshError, match=r"\(1\.5, 0\.25\) lies outside the cells 'left'"):
        result.at((1.5, 0.25), cells="left")
    with pytest.raises(MeshError, match="no group 'middle'"):
        result.at((1.5, 0.25), cells="middle")


def test_a_node_at_a_place_of_two_is_not_guessed() -> None:
    study = touching_bars()
    with pytest.raises(
        MeshError, match=r"2 nodes are at \(1, 0\.5\): name one by its number, 5, 12"
    ):
        study.fix((1.0, 0.5), u_x=0)
    with pytest.raises(MeshError, match=r"2 nodes are at \(1, 0\.5\)"):
        study.mesh.node_at(np.array([1.0, 0.5]))
    split = Mesh.rectangle(1.0, 1.0, cells=(2, 2)).split()
    assert len(split.nodes_at(np.array([0.5, 0.5]))) == 4
