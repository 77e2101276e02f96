"""Meshes of sections that a cut parts into two regions."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from softehl.cases.seal.meshing.outline import Outline, Shape, rounded
from softehl.cases.seal.meshing.section_mesh import SectionMesh, corner_jacobians
from softehl.cases.seal.meshing.spacing import Spacing, Spot, graded
from softehl.cases.seal.meshing.two_region_mesh import BODY, CAP, parted_mesh
from tests.runtime.test_outline_mesh import imbalance

DENSITIES = [Fraction(5, 3), 1, 2, 4]


def capped() -> Shape:
    """A trapezoid, 3.5 mm high, with a cut 0.7 mm above its foot."""
    corners = [(-1.2, 25.0), (1.4, 25.0), (1.8, 28.5), (-1.6, 28.5)]
    shape = Shape.facing(Outline(rounded(corners, 0.3)), (0.0, 28.5), "capped")
    begin, end = shape.outline.level(25.7)
    return replace(shape, chord=(float(begin), float(end)))


SHAPE = capped()
LENGTH = SHAPE.film[1] - SHAPE.film[0]
FINE = graded(LENGTH, [Spot(0.2 * LENGTH), Spot(0.8 * LENGTH)], 66, coarsest=0.2, rate=0.3)


def mesh_of(density: int | Fraction, spacing: Spacing | None = None) -> SectionMesh:
    return parted_mesh(SHAPE, SHAPE.film, spacing, 33, density)


def area(mesh: SectionMesh, region: str) -> float:
    x = mesh.points[mesh.quads[mesh.regions[region]]]
    a, b = x[:, 2] - x[:, 0], x[:, 3] - x[:, 1]
    return float(0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())


@pytest.mark.parametrize("density", DENSITIES)
def test_both_regions_are_filled_and_joined(density: int | Fraction) -> None:
    mesh = mesh_of(density, FINE)
    assert corner_jacobians(mesh).min() >= 0.2  # segments of the film are longer than its fillets
    for region, part in zip((CAP, BODY), SHAPE.parts, strict=True):
        assert area(mesh, region) == pytest.approx(part.area, rel=0.01 / density**2)
    edges = np.sort(np.stack([mesh.quads, np.roll(mesh.quads, -1, axis=1)], 2).reshape(-1, 2), 1)
    kinds, count = np.unique(edges, axis=0, return_counts=True)
    assert set(count) == {1, 2}
    assert {tuple(e) for e in kinds[count == 1]} == {tuple(sorted(s)) for s in mesh.segments}
    assert len(mesh.points) == len(np.unique(mesh.quads))


@pytest.mark.parametrize("density", DENSITIES)
def test_its_boundary_is_the_outline_and_its_cut_is_straight(density: int | Fraction) -> None:
    mesh, outline = mesh_of(density), SHAPE.outline
    assert mesh.points[mesh.boundary] == pytest.approx(outline.at(mesh.positions), abs=1e-12)
    assert mesh.positions[0] == SHAPE.film[0]
    assert np.diff(mesh.positions).min() > 0.0
    assert mesh.positions[-1] < mesh.positions[0] + mesh.length
    shared = np.intersect1d(mesh.quads[mesh.regions[CAP]], mesh.quads[mesh.regions[BODY]])
    assert mesh.points[shared, 1] == pytest.approx(25.7, abs=1e-9)
    below = mesh.quads[mesh.regions[CAP]]
    assert mesh.points[below, 1].max() <= 25.7 + 1e-9


def test_meshes_of_doubled_density_share_the_nodes_of_the_cut() -> None:
    shared = []
    for mesh in (mesh_of(1), mesh_of(2)):
        nodes = np.unique(mesh.quads[mesh.regions[CAP]])
        z, r = mesh.points[nodes].T
        shared.append(z[np.abs(r - 25.7) < 1e-9].round(9))
    assert len(shared[0]) > 5
    assert np.isin(shared[0], shared[1]).all()


def test_the_patch_test_is_passed() -> None:
    assert imbalance(mesh_of(1), (0.2, -0.1)) < 1e-11


def test_the_level_of_an_outline() -> None:
    circle = Outline.circle((0.5, 26.0), 2.0)
    assert circle.at(circle.level(26.0)) == pytest.approx(np.array([[-1.5, 26.0], [2.5, 26.0]]))
    assert len(circle.level(28.5)) == 0
    assert len(SHAPE.outline.level(25.7)) == 2


def test_a_part_of_an_outline_has_its_length_and_ends() -> None:
    outline = SHAPE.outline
    for begin, end in ((0.3, 4.0), (4.0, 0.3), (9.0, 2.5)):
        pieces = outline.part(begin, end)
        assert sum(p.length for p in pieces) == pytest.approx((end - begin) % outline.length)
        assert pieces[0].start == pytest.approx(outline.at(np.array([begin]))[0])
        assert pieces[-1].end == pytest.approx(outline.at(np.array([end]))[0])
