"""Meshes of outlines drawn at random: sound elements, the area, the patch test."""

from dataclasses import replace

import numpy as np
import pytest

from softehl.cases.seal.meshing.outline import Outline, Shape
from softehl.cases.seal.meshing.section_mesh import corner_jacobians
from softehl.cases.seal.meshing.section_mesher import Sizes, section_mesh
from softehl.cases.seal.meshing.spacing import Spot, graded
from softehl.cases.seal.section.layout import Layout, uniform_layout
from tests.cases.section_matrix import drawn
from tests.runtime.test_outline_mesh import imbalance

SOUND = 0.1  # least share of a corner in its element


def layout_of(number: int) -> Layout:
    """A layout with segments that are fine at two places, of any section or of a circle."""
    rng = np.random.default_rng([3, number])
    if number % 6 == 5:
        radius, inner = rng.uniform(0.9, 3.5), rng.uniform(5.0, 100.0)
        circle = Outline.circle((0.0, inner + radius), radius)
        shape = Shape.facing(circle, (0.0, inner + 2.0 * radius), "ring")
        layout = Layout(shape, shape.film, Sizes())
    else:
        layout = uniform_layout(drawn(number))
    begin, end = layout.film
    length = end - begin
    ends = rng.uniform(0.0, 0.15) * length, rng.uniform(0.85, 1.0) * length
    length, long = ends[1] - ends[0], 33 + 3 * int(rng.integers(0, 9))
    spots = [Spot(share * length) for share in rng.uniform(0.05, 0.95, 2)]
    spacing = graded(length, spots, 2 * long, coarsest=length / 12, rate=0.3)
    return layout.between(layout, ends).graded(spacing, long, 0.01)


@pytest.mark.parametrize("number", range(10))
def test_the_mesh_of_any_outline_is_sound_and_passes_the_patch_test(number: int) -> None:
    layout = layout_of(number)
    mesh, outline = layout.mesh(2), layout.shape.outline
    assert corner_jacobians(mesh).min() >= SOUND
    x, after = mesh.points[mesh.segments].transpose(1, 0, 2)
    area = 0.5 * float((x[:, 0] * after[:, 1] - after[:, 0] * x[:, 1]).sum())
    assert area == pytest.approx(outline.area, rel=3e-3)
    assert mesh.points[mesh.boundary] == pytest.approx(outline.at(mesh.positions), abs=1e-11)
    assert mesh.positions[[0, mesh.arc]] == pytest.approx(layout.film)
    assert imbalance(mesh, (0.2, -0.1)) < 1e-10


def test_a_moved_node_fails_what_the_meshes_pass() -> None:
    mesh = layout_of(5).mesh(1)
    assert imbalance(mesh, (0.2, -0.1), bow=1e-3) > 1e-5
    inside = np.setdiff1d(np.arange(len(mesh.points)), mesh.boundary)[0]
    points = mesh.points.copy()
    points[inside] += 10.0
    assert corner_jacobians(replace(mesh, points=points)).min() < 0.0


@pytest.mark.parametrize("begin", [0.0, 1.0, 4.0])
def test_a_circle_has_the_same_mesh_wherever_its_outline_begins(begin: float) -> None:
    circle = Outline.circle((0.5, 26.0), 1.7)
    turned = Outline(circle.part(begin, begin + circle.length - 1e-13))
    film = -1.0, 1.2
    shapes = [Shape(outline, film, (5.0, -1.0)) for outline in (circle, turned)]
    mesh = section_mesh(shapes[0], film, Sizes(33, None, 0.02), 1)
    moved = section_mesh(shapes[1], (film[0] - begin, film[1] - begin), Sizes(33, None, 0.02), 1)
    assert moved.points == pytest.approx(mesh.points, abs=1e-12)
    assert moved.positions + begin == pytest.approx(mesh.positions, abs=1e-12)


def test_a_density_that_has_no_mesh_is_refused() -> None:
    for number in (0, 5):
        with pytest.raises(ValueError, match="at least 2/3"):
            layout_of(number).mesh(0)
