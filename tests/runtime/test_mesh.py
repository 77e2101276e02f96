"""The O-grid: counts, orientation, exact boundary, refinement, nesting."""

from dataclasses import replace

import numpy as np
import pytest

from softehl.cases.seal.meshing.o_grid import Disc, disc_mesh
from softehl.cases.seal.meshing.section_mesh import SectionMesh, corner_jacobians

ARCS = [(-34.0, 43.0), (-45.0, 45.0), (-60.0, 70.0)]
DENSITIES = [1, 2, 4, 8, 16]


def _disc(arc: tuple[float, float] = ARCS[0]) -> Disc:
    return Disc(0.0, 26.96, 1.765, *arc)


def _edges(mesh: SectionMesh) -> np.ndarray:
    x = mesh.points[mesh.quads]
    return np.asarray(np.linalg.norm(np.roll(x, -1, axis=1) - x, axis=2))


@pytest.mark.parametrize("d", DENSITIES)
def test_counts(d: int) -> None:
    mesh = disc_mesh(_disc(), d)
    assert mesh.quads.shape == (360 * d**2, 4)
    assert len(mesh.boundary) == 66 * d
    assert len(mesh.points) == 360 * d**2 + 33 * d + 1  # Euler's formula for a disc of quads
    assert mesh.arc_segments.shape == (27 * d, 2)
    assert len(mesh.outer_nodes) == 39 * d + 1
    assert len(mesh.outer_segments) == 39 * d


@pytest.mark.parametrize("d", DENSITIES)
@pytest.mark.parametrize("arc", ARCS)
def test_no_element_is_folded(d: int, arc: tuple[float, float]) -> None:
    assert corner_jacobians(disc_mesh(_disc(arc), d)).min() > 0.5


def test_jacobians_see_a_folded_element() -> None:
    mesh = disc_mesh(_disc(), 1)
    points = mesh.points.copy()
    points[mesh.quads[100, 0]] = points[mesh.quads[100, 2]] + [1e-3, 1e-3]
    folded = replace(mesh, points=points)
    assert corner_jacobians(folded).min() < 0.0


@pytest.mark.parametrize("d", DENSITIES)
def test_boundary_lies_on_the_circle_and_runs_counterclockwise(d: int) -> None:
    mesh = disc_mesh(_disc(), d)
    boundary = mesh.points[mesh.boundary] - [0.0, 26.96]
    assert np.hypot(*boundary.T) == pytest.approx(1.765, abs=1e-13)
    a, b = boundary, np.roll(boundary, -1, axis=0)
    assert np.all(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] > 0.0)


def test_boundary_is_the_boundary() -> None:
    mesh = disc_mesh(_disc(), 2)
    edges = np.stack([mesh.quads, np.roll(mesh.quads, -1, axis=1)], axis=-1).reshape(-1, 2)
    directed = {(int(a), int(b)) for a, b in edges}
    free = {edge for edge in directed if edge[::-1] not in directed}
    assert free == {(int(a), int(b)) for a, b in mesh.segments}


@pytest.mark.parametrize("d", DENSITIES)
def test_arc_segments_are_equal_and_span_the_arc(d: int) -> None:
    mesh = disc_mesh(_disc(), d)
    arc = mesh.points[mesh.arc_segments]
    lengths = np.linalg.norm(arc[:, 1] - arc[:, 0], axis=1)
    assert lengths == pytest.approx(lengths[0], rel=1e-10)
    ends = mesh.points[mesh.arc_nodes[[0, -1]]]
    angles = np.degrees(np.arctan2(ends[:, 0], 26.96 - ends[:, 1]))
    assert angles == pytest.approx([-34.0, 43.0])


@pytest.mark.parametrize("d", DENSITIES)
def test_elements_on_the_arc_are_about_as_tall_as_wide_and_the_smallest(d: int) -> None:
    mesh = disc_mesh(_disc(), d)
    edges = _edges(mesh)
    on_arc = edges[: mesh.arc]
    ratio = on_arc[:, 1] / on_arc[:, 0]
    assert ratio.min() > 0.4
    assert ratio.max() < 1.5
    assert on_arc[:, 1].max() < 0.5 * edges[:, 1].max()


def test_area_converges_to_the_circle_with_second_order() -> None:
    errors = []
    for d in (2, 4, 8):
        mesh = disc_mesh(_disc(), d)
        a, b = mesh.points[mesh.segments[:, 0]], mesh.points[mesh.segments[:, 1]]
        area = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()
        errors.append(np.pi * 1.765**2 - area)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.1)


def test_density_zero_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 2/3"):
        disc_mesh(_disc(), 0)
