"""Meshes of every kind of cell: shapes, rules, sides, names, files, and what is refused."""

from __future__ import annotations

from itertools import product
from math import factorial
from pathlib import Path

import numpy as np
import pytest

from softehl.runtime.mesh.cells import CELLS, Cell, measures
from softehl.runtime.mesh.mesh import Mesh, MeshError

PLANE = [("quad", 1), ("quad", 2), ("serendipity", 2), ("triangle", 1), ("triangle", 2)]
SPACE = [("hex", 1), ("hex", 2), ("serendipity", 2), ("tetrahedron", 1), ("tetrahedron", 2)]


def made(shape: str, order: int) -> Mesh:
    """A mesh of [0, 3] x [0, 2] (x [0, 1])."""
    if (shape, order) in PLANE and shape != "serendipity":
        return Mesh.rectangle(3.0, 2.0, cells=(3, 2), order=order, shape=shape)  # type: ignore[arg-type]
    return Mesh.box((3.0, 2.0, 1.0), cells=(3, 2, 2), order=order, shape=shape)  # type: ignore[arg-type]


@pytest.mark.parametrize("cell", CELLS.values(), ids=CELLS)
def test_shapes_are_a_partition_of_unity_and_nodal(cell: Cell, rng: np.random.Generator) -> None:
    at = rng.uniform(0.1, 0.3, (5, cell.dimension))
    np.testing.assert_allclose(cell.shape(cell.nodes), np.eye(len(cell.nodes)), atol=1e-14)
    np.testing.assert_allclose(cell.shape(at).sum(axis=1), 1.0, rtol=1e-13)
    for d in range(cell.dimension):
        step = 1e-6 * np.eye(cell.dimension)[d]
        slope = (cell.shape(at + step) - cell.shape(at - step)) / 2e-6
        np.testing.assert_allclose(cell.gradient(at)[:, :, d], slope, atol=1e-9)


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
