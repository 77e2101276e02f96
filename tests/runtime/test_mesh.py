"""Meshes: shapes, sides, what is refused, points in their cells."""

from __future__ import annotations

from itertools import product
from math import factorial
from pathlib import Path

import numpy as np
import pytest

from softehl import Study
from softehl.runtime.arrays import Array
from softehl.runtime.mesh.cells import CELLS, measures
from softehl.runtime.mesh.mesh import Mesh, MeshError
from softehl.runtime.mesh.point_location import Located, PointLocator

# --- Meshes of every kind of cell: shapes, rules, sides, names, files, and what is refused --------


PLANE = [("quad", 1), ("quad", 2), ("serendipity", 2), ("triangle", 1), ("triangle", 2)]
SPACE = [("hex", 1), ("hex", 2), ("serendipity", 2), ("tetrahedron", 1), ("tetrahedron", 2)]


def made(shape: str, order: int) -> Mesh:
    """A mesh of [0, 3] x [0, 2] (x [0, 1])."""
    if (shape, order) in PLANE and shape != "serendipity":
        return Mesh.rectangle(3.0, 2.0, cells=(3, 2), order=order, shape=shape)  # type: ignore[arg-type]
    return Mesh.box((3.0, 2.0, 1.0), cells=(3, 2, 2), order=order, shape=shape)  # type: ignore[arg-type]


@pytest.mark.parametrize("degree", [1, 2, 5, 8])
@pytest.mark.parametrize("name", ["line2", "tri3", "quad4", "tet4", "hex8", "wedge6"])
def test_rules_are_exact_to_their_degree(name: str, degree: int) -> None:
    cell = CELLS[name]
    points, weights = cell.rule(degree)
    for powers in product(range(degree + 1), repeat=cell.dimension):
        if sum(powers) <= degree:
            found = float(weights @ np.prod(points ** np.array(powers), axis=1))
            assert found == pytest.approx(exact(name, powers), abs=1e-13)


def exact(name: str, powers: tuple[int, ...]) -> float:
    """Integral of a monomial over the parent element."""

    def on_line(power: int) -> float:
        return 2.0 / (power + 1) if power % 2 == 0 else 0.0

    def on_simplex(*p: int) -> float:
        return float(np.prod([factorial(k) for k in p])) / factorial(sum(p) + len(p))

    if name in ("tri3", "tet4"):
        return on_simplex(*powers)
    if name == "wedge6":
        return on_simplex(*powers[:2]) * on_line(powers[2])
    return float(np.prod([on_line(p) for p in powers]))


def outflow(mesh: Mesh) -> float:
    """Integral of x . n over the boundary: dim times the volume, if faces look outwards."""
    total = 0.0
    for kind, faces in mesh.boundary.items():
        cell = CELLS[kind]
        points, weights = cell.rule(4)
        places = mesh.points[faces]
        slope = np.einsum("qkd,nkc->nqcd", cell.gradient(points), places)
        if mesh.dimension == 2:
            normal = np.stack([slope[:, :, 1, 0], -slope[:, :, 0, 0]], axis=2)
        else:
            normal = np.cross(slope[..., 0], slope[..., 1])
        x = np.einsum("qk,nkc->nqc", cell.shape(points), places)
        total += float(np.einsum("nqc,nqc,q->", x, normal, weights))
    return total


@pytest.mark.parametrize(("shape", "order"), [*PLANE, *SPACE])
def test_structured_meshes_and_their_sides(shape: str, order: int) -> None:
    mesh = made(shape, order)
    mesh.check()
    volume = 6.0
    assert outflow(mesh) == pytest.approx(mesh.dimension * volume, rel=1e-12)
    lengths = {"left": 2.0, "right": 2.0, "bottom": 3.0, "top": 3.0}
    if mesh.dimension == 3:
        lengths |= {"front": 3.0, "back": 3.0, "bottom": 6.0, "top": 6.0}
    for name, length in lengths.items():
        total = 0.0
        for kind, faces in mesh.faces(name).items():
            points, weights = CELLS[kind].rule(2)
            total += float((measures(CELLS[kind], mesh.points[faces], points) @ weights).sum())
        assert total == pytest.approx(length, rel=1e-12)


def test_lengths_are_numbers_or_one_sequence() -> None:
    for one, other in (
        (Mesh.box(3, 2, 1, cells=(1, 1, 1)), Mesh.box((3, 2, 1), cells=(1, 1, 1))),
        (Mesh.rectangle(3, 2, cells=(1, 1)), Mesh.rectangle([3, 2], cells=(1, 1))),
    ):
        assert np.array_equal(one.points, other.points)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_members_of_a_frame(order: int) -> None:
    corners = [(0.0, 0.0), (0.0, 3.0), (4.0, 3.0), (4.0, 0.0)]
    members: dict[str, list[tuple[int, int]]] = {"columns": [(0, 1), (2, 3)], "beam": [(1, 2)]}
    mesh = Mesh.frame(corners, members, cells=2, order=order)
    (kind,) = mesh.cells
    assert np.array_equal(mesh.points[:4], corners)
    assert len(mesh.points) == 4 + 3 * (2 * order - 1)
    weights = CELLS[kind].rule(order)
    lengths = measures(CELLS[kind], mesh.points[mesh.cells[kind]], weights[0]) @ weights[1]
    of = {name: lengths[rows[kind]].sum() for name, rows in mesh.groups.items()}
    assert of == pytest.approx({"columns": 6.0, "beam": 4.0})
    polyline = Mesh.frame(corners, cells=2, order=order)
    assert len(polyline.cells[kind]) == 6


def test_a_face_that_looks_inwards_is_seen() -> None:
    mesh = made("hex", 1)
    kind, faces = next(iter(mesh.boundary.items()))
    turned = faces.copy()
    turned[faces.max(axis=1).argmax()] = turned[faces.max(axis=1).argmax(), ::-1]
    object.__setattr__(mesh, "boundary", {kind: turned})
    assert outflow(mesh) != pytest.approx(18.0, rel=1e-3)


def test_what_is_refused(tmp_path: Path) -> None:
    mesh = made("quad", 1)
    turned = Mesh(mesh.points, {"quad4": mesh.cells["quad4"][:, ::-1]})
    with pytest.raises(MeshError, match=r"6 of 6 quad4 .* number 0 at \(0.5, 0.5\)"):
        turned.check()
    with pytest.raises(MeshError, match=r"no side 'rigth' \(did you mean 'right'\?\)"):
        mesh.faces("rigth")
    with pytest.raises(MeshError, match=r"no group 'x'; there are none"):
        mesh.cells_of("x")
    with pytest.raises(MeshError, match="no face of the boundary"):
        mesh.with_side("none", lambda x: x[:, 0] > 100.0)
    with pytest.raises(MeshError, match="booleans of shape"):
        mesh.with_side("none", lambda x: x)  # type: ignore[arg-type, return-value]
    with pytest.raises(MeshError, match="order = 1: serendipity cells have order 2"):
        Mesh.rectangle(1, 1, cells=(1, 1), shape="serendipity")
    with pytest.raises(MeshError, match="allowed are quad, serendipity, triangle"):
        Mesh.rectangle(1, 1, cells=(1, 1), shape="hex")
    with pytest.raises(MeshError, match="2 whole numbers of at least 1"):
        Mesh.rectangle(1, 1, cells=(0, 1))
    with pytest.raises(MeshError, match="lengths must be positive"):
        Mesh.rectangle(-1, 1, cells=(1, 1))
    with pytest.raises(MeshError, match=r"no cells 'quad5' \(did you mean 'quad"):
        Mesh(mesh.points, {"quad5": mesh.cells["quad4"]})
    with pytest.raises(MeshError, match=r"must be \(m, 4\)"):
        Mesh(mesh.points, {"quad4": mesh.cells["quad4"][:, :3]})
    with pytest.raises(MeshError, match="from 1 to 12, must be from 0 to 11"):
        Mesh(mesh.points, {"quad4": mesh.cells["quad4"] + 1})
    with pytest.raises(MeshError, match="no mesh file"):
        Mesh.read(tmp_path / "missing.msh")
    with pytest.raises(MeshError, match=r"say how many files, as in parts=2"):
        mesh.write(tmp_path / "part.npz")
    mesh.write(tmp_path / "part.npz", parts=2)
    with pytest.raises(MeshError, match=r"parts of it are there: .*'part.npz', spread=True"):
        Mesh.read(tmp_path / "part.npz")
    with pytest.raises(MeshError, match=r"part_1.npz: one part of a mesh; all of them"):
        Mesh.read(tmp_path / "part_1.npz")
    quads = mesh.cells["quad4"]
    with pytest.raises(MeshError, match=r"1 of 7 quad4 have the nodes of one before.*number 6"):
        Mesh(mesh.points, {"quad4": np.vstack([quads, quads[:1, [1, 2, 3, 0]]])}).check()
    twice = {"right": {"line2": mesh.sides["right"]["line2"][[0, 1, 0]]}}
    with pytest.raises(MeshError, match=r"side 'right': 1 of 3 line2 have the nodes of one before"):
        Mesh(mesh.points, mesh.cells, sides=twice).check()
    with pytest.raises(MeshError, match="group 'g': the number of a quad4 stands twice"):
        Mesh(mesh.points, mesh.cells, {"g": {"quad4": np.array([1, 1])}}).check()
    with pytest.raises(MeshError, match="group 'g': whole numbers below 6, of quad4"):
        Mesh(mesh.points, mesh.cells, {"g": {"quad4": np.array([6])}}).check()
    with pytest.raises(MeshError, match=r"points are complex128 of shape \(12, 2\)"):
        mesh.map(lambda x: x + 1j)  # type: ignore[arg-type, return-value]
    with pytest.raises(MeshError, match=r"box\(1, 1\): 3 lengths are needed"):
        Mesh.box(1, 1, cells=(1, 1, 1))
    with pytest.raises(MeshError, match=r"member \(0, 2\): the points are numbered 0 to 1"):
        Mesh.frame([(0, 0), (1, 0)], [(0, 2)])
    with pytest.raises(MeshError, match="point 2 has no member"):
        Mesh.frame([(0, 0), (1, 0), (2, 0)], [(0, 1)])
    (tmp_path / "bad.msh").write_text("nothing of a mesh\n")
    with pytest.raises(MeshError, match=r"bad\.msh"):
        Mesh.read(tmp_path / "bad.msh")


def test_places_on_lines_in_a_plane_and_surfaces_in_space() -> None:
    """Two bars of different kinds, and a triangle in space; beside them is outside."""
    points = np.array([[0.0, 0.0], [8.0, 6.0], [12.0, 6.0], [10.0, 7.0]])
    bars = Mesh(points, {"line2": np.array([[0, 1]]), "line3": np.array([[1, 2, 3]])})
    for place, expected in (((8, 6), 1), ((0, 0), 0), ((12, 6), 2), ((10, 7), 3)):
        nodes, weights = bars.locate(np.array(place, dtype=float))
        np.testing.assert_allclose(weights, nodes == expected, atol=1e-9)
    nodes, weights = bars.locate(np.array([2.0, 1.5]))
    np.testing.assert_allclose(weights @ points[nodes], [2.0, 1.5], atol=1e-12)
    curved = bars.locate(np.array([9.0, 6.75]))
    np.testing.assert_allclose(curved[1] @ points[curved[0]], [9.0, 6.75], atol=1e-9)
    for beside in ([2.0, 1.6], [-0.1, -0.075], [10.0, 6.5]):
        with pytest.raises(MeshError, match="outside the mesh"):
            bars.locate(np.array(beside))
    shell = Mesh(np.array([[0.0, 0, 0], [1, 0, 1], [0, 1, 1]]), {"tri3": np.array([[0, 1, 2]])})
    np.testing.assert_allclose(shell.locate(np.array([0.25, 0.5, 0.75]))[1], [0.25, 0.25, 0.5])
    with pytest.raises(MeshError, match="outside the mesh"):
        shell.locate(np.array([0.25, 0.5, 0.7]))


# --- Location of points: curved cells of every kind and order, boundaries, copies of nodes, -------


SHAPES = [(shape, n) for shape in ("quad", "hex") for n in (1, 2, 3, 6)]
SHAPES += [("serendipity", 2), ("triangle", 1), ("triangle", 2), ("tetrahedron", 1)]
SHAPES += [("tetrahedron", 2), ("wedge", 1), ("wedge", 2), ("lagrange_wedge", 2)]
SHAPES += [("pyramid", 1)]


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
