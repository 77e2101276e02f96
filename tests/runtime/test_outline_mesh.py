"""Meshes of outlines: sound elements, exact boundaries, families of one density."""

from fractions import Fraction

import numpy as np
import pytest

from softehl.cases.seal.meshing.outline import Outline, Shape, rounded
from softehl.cases.seal.meshing.outline_mesh import outline_mesh
from softehl.cases.seal.meshing.section_mesh import SectionMesh, corner_jacobians
from softehl.cases.seal.meshing.spacing import Spot, graded
from softehl.runtime.mesh.mesh import MeshError
from tests.reference.calling import Part

DENSITIES = [Fraction(2, 3), 1, Fraction(5, 3), 2, 3, 4]
WEDGE = [(-1.0, 25.0), (1.2, 25.0), (1.7, 27.6), (0.4, 26.8), (-1.1, 28.5)]


def ring() -> Shape:
    return Shape.facing(Outline.circle((0.0, 26.0), 1.765), (0.0, 27.765), "round")


def horn() -> Shape:
    """Convex and concave, a sharp corner and round ones."""
    return Shape.facing(Outline(rounded(WEDGE, [0.2, 0.1, 0.0, 0.3, 0.05])), (-1.1, 28.4), "horn")


SHAPES = {"ring": ring(), "horn": horn()}


def mesh_of(shape: Shape, density: int | Fraction) -> SectionMesh:
    return outline_mesh(shape, shape.film, None, 33, density)


def area(mesh: SectionMesh) -> float:
    x = mesh.points[mesh.quads]
    a, b = x[:, 2] - x[:, 0], x[:, 3] - x[:, 1]
    return float(0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())


@pytest.mark.parametrize("density", DENSITIES)
@pytest.mark.parametrize("name", SHAPES)
def test_elements_are_sound_and_fill_the_section(name: str, density: int | Fraction) -> None:
    shape = SHAPES[name]
    mesh = mesh_of(shape, density)
    assert corner_jacobians(mesh).min() >= 0.3
    assert area(mesh) == pytest.approx(shape.outline.area, rel=0.01 / density**2)
    edges = np.sort(np.stack([mesh.quads, np.roll(mesh.quads, -1, axis=1)], 2).reshape(-1, 2), 1)
    kinds, count = np.unique(edges, axis=0, return_counts=True)
    assert set(count) == {1, 2}
    assert {tuple(e) for e in kinds[count == 1]} == {tuple(sorted(s)) for s in mesh.segments}
    assert len(mesh.points) == len(np.unique(mesh.quads))


@pytest.mark.parametrize("name", SHAPES)
def test_the_boundary_lies_on_the_outline_at_its_places(name: str) -> None:
    shape = SHAPES[name]
    mesh = mesh_of(shape, 2)
    assert mesh.arc == 66
    assert mesh.length == shape.outline.length
    assert mesh.points[mesh.boundary] == pytest.approx(shape.outline.at(mesh.positions), abs=1e-12)
    assert mesh.positions[[0, mesh.arc]] == pytest.approx(shape.film)
    assert (np.diff(mesh.positions) > 0.0).all()
    for corner in shape.outline.kinks:
        away = (mesh.positions - corner + 1e-9) % mesh.length
        assert away.min() < 1e-8


def test_the_nodes_of_the_film_are_where_the_spacing_has_them() -> None:
    shape = SHAPES["ring"]
    length = shape.film[1] - shape.film[0]
    spacing = graded(length, (Spot(1.0), Spot(3.0)), 2 * 33, coarsest=length / 12, rate=0.3)
    mesh = outline_mesh(shape, shape.film, spacing, 33, 2)
    expected = shape.film[0] + length * spacing(np.arange(67) / 66)
    assert mesh.positions[:67] == pytest.approx(expected, abs=1e-12)
    assert corner_jacobians(mesh).min() >= 0.3


def test_a_mesh_of_twice_the_density_is_of_the_same_family() -> None:
    coarse, fine = mesh_of(SHAPES["horn"], 2), mesh_of(SHAPES["horn"], 4)
    assert len(fine.quads) == 4 * len(coarse.quads)
    assert fine.positions[::2] == pytest.approx(coarse.positions, abs=1e-12)


def test_a_density_that_does_not_divide_the_segments_is_named() -> None:
    with pytest.raises(MeshError, match="density 4/3 is not allowed with 32 segments"):
        outline_mesh(ring(), (-1.0, 1.0), None, 32, Fraction(4, 3))
    with pytest.raises(MeshError, match="density 1/3 is not allowed"):
        mesh_of(ring(), Fraction(1, 3))


def imbalance(mesh: SectionMesh, stretch: tuple[float, float], bow: float = 0.0) -> float:
    """Largest force at a node inside under u = (a Z, b R) + bow Z^2 over that on an element."""
    maps = (2 * mesh.quads[:, :, None] + np.arange(2)).reshape(-1, 8)
    x = mesh.points[mesh.quads].reshape(-1, 8)
    part = Part("solid_taylor_mean", x, maps, (3.04, 0.62, 500.0))
    u = mesh.points * stretch
    u[:, 1] += bow * mesh.points[:, 0] ** 2
    forces = part.elements(u.ravel())[0]
    total = np.bincount(maps.ravel(), forces.ravel(), u.size)
    inside = np.ones(len(mesh.points), dtype=np.bool_)
    inside[mesh.boundary] = False
    return float(np.abs(total.reshape(-1, 2)[inside]).max() / np.abs(forces).max())


@pytest.mark.parametrize("name", SHAPES)
def test_the_patch_test_is_passed(name: str) -> None:
    mesh = mesh_of(SHAPES[name], 1)
    assert imbalance(mesh, (0.2, -0.1)) < 1e-11
    assert imbalance(mesh, (0.2, -0.1), bow=1e-3) > 1e-5
