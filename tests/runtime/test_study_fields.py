"""Pages of fields in a study: one page on every kind of cell."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest

import softehl
from softehl.runtime.arrays import Array
from softehl.runtime.mesh.mesh import Mesh
from softehl.runtime.study import Study, StudyError
from tests.runtime.field_pages import rubber

AFFINE = np.array([[0.08, 0.05, -0.02], [-0.03, 0.1, 0.04], [0.02, -0.06, 0.07]])
"""Displacement gradient of the patch tests."""


def moved(mesh: Mesh) -> Mesh:
    """The mesh with its inner nodes moved: cells are no more alike, straight or parallel."""
    size = mesh.points.max()
    inside = np.all((mesh.points > 1e-9) & (mesh.points < size - 1e-9), axis=1)
    shift = 0.04 * np.sin(7.0 * mesh.points @ np.ones((mesh.dimension, mesh.dimension)) + 1.0)
    points = mesh.points + shift * inside[:, None]
    return Mesh(points=points, cells=mesh.cells, groups=mesh.groups, sides=mesh.sides)


def patch(mesh: Mesh, geometry: str | None, gradient: Array) -> tuple[float, Array]:
    """Largest error of the displacements, and J, where the boundary is moved by a gradient."""
    study = Study(mesh, geometry=geometry)
    study.add("rubber", rubber, mu=0.4, K=0.9)
    size = mesh.dimension
    A = gradient[:size, :size]
    for side in mesh.sides:
        for axis, row in zip("xyz", A, strict=False):
            study.fix(side, **{f"u_{axis}": lambda x, t, row=row: x @ row})
    result = study.solve()
    errors = [
        np.abs(result.values(f"u_{axis}") - mesh.points @ row).max()
        for axis, row in zip("xyz", A, strict=False)
    ]
    return float(max(errors)), result.fields("rubber")["J"]


def box(shape: str, order: int, cells: int = 2) -> Mesh:
    """A unit square or cube."""
    if shape in ("triangle", "quad"):
        return Mesh.rectangle(1, 1, cells=(cells, cells), order=order, shape=shape)  # type: ignore[arg-type]
    return Mesh.box((1, 1, 1), cells=(cells,) * 3, order=order, shape=shape)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("shape", "order"),
    [
        ("triangle", 1),
        ("quad", 2),
        ("tetrahedron", 1),
        ("hex", 1),
        pytest.param("triangle", 2, marks=pytest.mark.slow),
        pytest.param("quad", 1, marks=pytest.mark.slow),
        pytest.param("tetrahedron", 2, marks=pytest.mark.slow),
        pytest.param("wedge", 1, marks=pytest.mark.slow),
        pytest.param("serendipity", 2, marks=pytest.mark.slow),
        pytest.param("hex", 2, marks=pytest.mark.slow),
    ],
)
def test_a_patch_of_any_cells_deforms_affinely(shape: str, order: int) -> None:
    mesh = moved(box(shape, order))
    size = mesh.dimension
    error, J = patch(mesh, None, AFFINE)
    assert error < 1e-12
    assert np.allclose(J, np.linalg.det(np.eye(size) + AFFINE[:size, :size]), rtol=1e-12)


def test_a_page_stands_on_several_kinds_of_cells_at_once() -> None:
    points = np.array([[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1], [0.9, 0.4]], dtype=float)
    cells = {
        "quad4": np.array([[1, 2, 5, 4]]),
        "tri3": np.array([[0, 1, 6], [1, 4, 6], [4, 3, 6], [3, 0, 6]]),
    }
    mesh = Mesh(points=points, cells=cells)
    study = Study(mesh)
    study.add("rubber", rubber, mu=0.4, K=0.9)
    A = AFFINE[:2, :2]
    edge = [0, 1, 2, 3, 4, 5]
    study.fix(edge, u_x=lambda x, t: x @ A[0], u_y=lambda x, t: x @ A[1])
    result = study.solve()
    assert np.abs(result.values("u_y") - points @ A[1]).max() < 1e-12
    for block in ("rubber:quad4", "rubber:tri3"):
        assert np.allclose(result.fields(block)["J"], np.linalg.det(np.eye(2) + A), rtol=1e-12)


def test_a_patch_that_is_not_affine_is_seen() -> None:
    mesh = moved(box("triangle", 1))
    study = Study(mesh)
    study.add("rubber", rubber, mu=0.4, K=0.9)
    for side in mesh.sides:
        study.fix(side, u_x=lambda x, t: 0.1 * x[:, 1] ** 2, u_y=0)
    assert np.ptp(study.solve().fields("rubber")["J"]) > 1e-3


def test_an_axisymmetric_body_is_stretched_around_the_x_axis() -> None:
    mesh = Mesh.rectangle(1, 1, cells=(2, 2), shape="triangle")
    error, J = patch(mesh, "axisymmetric", np.diag([0.1, 0.05, 0.0]))
    assert error < 1e-12
    assert np.allclose(J, 1.1 * 1.05**2, rtol=1e-12)


def test_a_geometry_that_the_mesh_cannot_have_is_refused() -> None:
    with pytest.raises(StudyError, match='"plane strain" or "axisymmetric"'):
        Study(Mesh.rectangle(1, 1, cells=(1, 1)), geometry="solid")
    with pytest.raises(StudyError, match="plane stress is said on a page"):
        Study(Mesh.rectangle(1, 1, cells=(1, 1)), geometry="plane stress")


@softehl.page
def laplace(m):  # type: ignore[no-untyped-def]
    """- div k grad T = 0."""
    T = m.scalar("T")
    (k,) = m.parameters(k="conductivity [W/(mm K)]")
    m.weak(k * m.grad(T), m.grad(T))


@softehl.page
def followed(m):  # type: ignore[no-untyped-def]
    """A pressure that follows the side."""
    u = m.vector("u")
    (p,) = m.parameters(p="pressure [MPa]")
    m.weak(p * m.area_vector(u), u)


@softehl.page
def convection(m):  # type: ignore[no-untyped-def]
    """Heat that leaves through a side, and a flux of given direction."""
    T = m.scalar("T")
    h, q = m.parameters(h="transfer [W/(mm^2 K)]", q="flux along x [W/mm^2]")
    m.weak(h * T + q * m.normal[0], T)


@pytest.mark.parametrize(
    ("mesh", "geometry"),
    [
        (Mesh.rectangle(1, 1, cells=(2, 2), shape="triangle", order=2), "plane strain"),
        (Mesh.box((1, 1, 1), cells=(1, 1, 1), shape="tetrahedron"), "solid"),
    ],
)
def test_a_page_on_a_side_is_the_pressure_that_follows_it(mesh: Mesh, geometry: str) -> None:
    def solved(page: bool) -> Array:
        study = Study(mesh, geometry=geometry)
        study.add("rubber", rubber, mu=0.4, K=0.9)
        for axis in "xyz"[: mesh.dimension]:
            study.fix("left", **{f"u_{axis}": 0})
        if page:
            study.add("pressure", followed, on="right", p=lambda t: 0.1 * t)
        else:
            study.pressure("right", 0.1)
        return study.solve(steps=2).values("u_x")

    assert np.abs(solved(True) - solved(False)).max() < 1e-12
    assert np.ptp(solved(False)) > 1e-2


def test_an_axisymmetric_side_has_the_pressure_of_a_thick_tube() -> None:
    mesh = Mesh.rectangle(1, 1, cells=(1, 8), order=2).map(lambda x: x + np.array([0.0, 1.0]))
    study = Study(mesh, geometry="axisymmetric")
    study.add("rubber", rubber, mu=0.4, K=0.9)
    study.add("pressure", followed, on="bottom", p=1e-5)
    for side in ("left", "right"):
        study.fix(side, u_x=0)
    moved = study.solve().at((0.5, 1.0))["u_y"]
    lame = 0.9
    inner = 1e-5 / 3 * (1 / (2 * (0.4 + lame)) * 1.0 + 4 / (2 * 0.4))
    assert moved == pytest.approx(inner, rel=1e-4)


def test_sides_have_outward_normals_and_values() -> None:
    study = Study(Mesh.rectangle(2, 1, cells=(4, 2), shape="triangle"))
    study.add("plate", laplace, k=3.0)
    study.fix("left", T=4)
    study.add("loss", convection, on="right", h=0.5, q=1.0)
    # 3 dT/dx = - (T / 2 + 1) on the right: T = 4 - a x with 3 a = (4 - 2 a) / 2 + 1
    assert study.solve().at((2.0, 0.5))["T"] == pytest.approx(4 - 2 * 3 / 4, rel=1e-12)


@pytest.mark.parametrize("shape", ["quad", "serendipity", "triangle"])
def test_a_field_of_lower_order_has_values_between_its_nodes(shape: str, tmp_path: Path) -> None:
    """A pressure that is linear: at any place, its derivative too, and in the file."""
    mesh = Mesh.rectangle(2, 1, cells=(2, 2), order=2, shape=shape)  # type: ignore[arg-type]
    study = Study(mesh)
    study.add("flow", darcy, k=2.0)
    study.fix("left", p=0)
    study.fix("right", p=3)
    result = study.solve()
    for place in ((0.3, 0.1), (0.5, 0.25), (1.5, 1.0)):
        assert result.at(place)["p"] == pytest.approx(1.5 * place[0])
        slope = result.sensitivity("p", at=place, by={"fix:right": "p"})
        assert slope["fix:right", "p"] == pytest.approx(place[0] / 2)
    assert result.along((0, 0.3), (2, 0.3), 7)["p"] == pytest.approx(np.linspace(0, 3, 7))
    assert np.isnan(result.values("p")).any(), "no unknowns stand there"
    result.write(tmp_path / "flow.vtu")
    written = meshio.read(tmp_path / "flow.vtu")
    assert written.point_data["p"] == pytest.approx(1.5 * mesh.points[:, 0])


@softehl.page(degree=2)
def darcy(m):  # type: ignore[no-untyped-def]
    """A potential of lower order."""
    p = m.scalar("p", order=1)
    (k,) = m.parameters(k="permeability")
    m.minimise(k / 2 * m.grad(p).dot(m.grad(p)))
