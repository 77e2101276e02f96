"""Obstacles, tributary areas and the data of contact elements."""

import numpy as np
import pytest

from softehl.runtime.contact.rigid_obstacles import (
    contact_block,
    inner_cylinder,
    outer_cylinder,
    plane,
    tributary_areas,
)
from tests.runtime.springs import Spring

POINTS = np.array([[0.0, 25.0], [0.3, 25.1], [0.9, 25.4], [1.0, 26.0]])
SEGMENTS = np.array([[0, 1], [1, 2], [2, 3]])


@pytest.mark.parametrize(
    ("obstacle", "expected"),
    [
        (inner_cylinder("rod", 25.05), [-0.05, 0.05, 0.35, 0.95]),
        (outer_cylinder("bore", 25.5), [0.5, 0.4, 0.1, -0.5]),
        (plane("left", 0.2, faces=1), [-0.2, 0.1, 0.7, 0.8]),
        (plane("right", 0.95, faces=-1), [0.95, 0.65, 0.05, -0.05]),
    ],
)
def test_gap_is_positive_in_free_space(obstacle: object, expected: list[float]) -> None:
    assert obstacle.gap(POINTS) == pytest.approx(expected)  # type: ignore[attr-defined]


def test_a_plane_faces_one_way() -> None:
    with pytest.raises(ValueError, match="must be 1 or -1"):
        plane("wall", 0.0, faces=0)


def test_areas_add_up_to_the_surface_of_the_cones() -> None:
    ends = POINTS[SEGMENTS]
    slant = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    surface = np.pi * (ends[:, :, 1].sum(axis=1) * slant).sum()
    assert tributary_areas(POINTS, SEGMENTS, np.arange(4)).sum() == pytest.approx(
        surface, rel=1e-14
    )


def test_area_is_the_integral_of_the_shape_function() -> None:
    s, weights = np.polynomial.legendre.leggauss(4)
    shape, radius = 0.5 * (1 - s), 25.0 * 0.5 * (1 - s) + 25.1 * 0.5 * (1 + s)
    length = np.hypot(0.3, 0.1)
    exact = 2.0 * np.pi * 0.5 * length * (weights * shape * radius).sum()
    assert tributary_areas(POINTS, SEGMENTS, np.array([0])) == pytest.approx([exact], rel=1e-14)


def test_contact_elements_carry_normal_position_area_and_stiffness() -> None:
    nodes, multipliers = np.array([1, 2]), np.array([20, 21])
    block = contact_block(
        plane("wall", 2.0, faces=-1), Spring(), POINTS, (nodes, SEGMENTS, multipliers), 3.66
    )
    assert block.name == "wall"
    assert block.dofs.tolist() == [[2, 3, 20], [4, 5, 21]]
    assert block.data is not None
    assert block.data[:, :3].tolist() == [[-1.0, 0.0, -2.0]] * 2
    areas = tributary_areas(POINTS, SEGMENTS, nodes)
    assert block.data[:, 3] == pytest.approx(areas)
    assert block.data[:, 4] == pytest.approx(3.66 * 2 * np.pi * POINTS[nodes, 1] / areas)
