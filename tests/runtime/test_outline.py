"""Outlines: measures against closed forms, places, and what is no outline."""

import re
from collections.abc import Callable
from math import cos, pi, sin

import numpy as np
import pytest

from softehl.cases.seal.meshing.outline import (
    Arc,
    Line,
    Outline,
    OutlineError,
    Piece,
    Shape,
    rounded,
)
from softehl.cases.seal.meshing.outline_checks import crossing

SQUARE = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]
RING = Outline.circle((0.3, 26.0), 1.7)


def stadium(a: float, r: float) -> Outline:
    """A rectangle 2 a by 2 r between half circles, its lower side first."""
    return Outline(
        [
            Line((-a, -r), (a, -r)),
            Arc((a, -r), (a, r), (a, 0.0)),
            Line((a, r), (-a, r)),
            Arc((-a, r), (-a, -r), (-a, 0.0)),
        ]
    )


def test_measures_of_a_circle() -> None:
    assert RING.length == pytest.approx(2 * pi * 1.7, rel=1e-15)
    assert RING.area == pytest.approx(pi * 1.7**2, rel=1e-14)
    assert RING.centroid == pytest.approx((0.3, 26.0), rel=1e-14)
    assert RING.polar_moment == pytest.approx(0.5 * pi * 1.7**4, rel=1e-13)


def test_measures_of_a_stadium_and_a_triangle() -> None:
    a, r = 0.7, 0.4
    shape = stadium(a, r).moved(shift=(5.0, 30.0))
    half, offset = 0.5 * pi * r**2, 4 * r / (3 * pi)
    moment = 4 * a * r * ((2 * a) ** 2 + (2 * r) ** 2) / 12
    # a half circle about its own centroid, then moved to where it is
    moment += 2 * (0.25 * pi * r**4 - half * offset**2 + half * (a + offset) ** 2)
    assert shape.area == pytest.approx(4 * a * r + pi * r**2, rel=1e-14)
    assert shape.centroid == pytest.approx((5.0, 30.0), rel=1e-14)
    assert shape.polar_moment == pytest.approx(moment, rel=1e-12)
    triangle = Outline.polygon([(0.0, 10.0), (3.0, 10.0), (0.0, 12.0)])
    assert triangle.area == pytest.approx(3.0, rel=1e-14)
    assert triangle.centroid == pytest.approx((1.0, 10.0 + 2.0 / 3.0), rel=1e-14)
    assert triangle.polar_moment == pytest.approx(3.0 * (9.0 + 4.0) / 18.0, rel=1e-12)


def test_places_and_points_belong_together() -> None:
    for shape in (RING, stadium(0.7, 0.4), Outline(rounded(SQUARE, [0.0, 0.3, 0.5, 0.1]))):
        s = np.linspace(0.0, shape.length, 333, endpoint=False)
        assert shape.position(shape.at(s)) == pytest.approx(s, abs=1e-12)
        step = 1e-6
        slope = (shape.at(s + 0.5 * step) - shape.at(s - 0.5 * step)) / step
        smooth = np.abs((s[:, None] - shape.kinks + 1e-5) % shape.length).min(initial=1, axis=1)
        assert slope[smooth > 1e-4] == pytest.approx(shape.tangent(s)[smooth > 1e-4], abs=1e-5)
        assert shape.at(s + shape.length) == pytest.approx(shape.at(s), abs=1e-12)


def test_a_point_beside_the_outline_gets_the_nearest_place() -> None:
    places = stadium(0.7, 0.4).position(np.array([[0.0, -5.0], [0.2, -0.3], [9.0, 0.0]]))
    assert places == pytest.approx([0.7, 0.9, 1.4 + 0.2 * pi])


def test_corners() -> None:
    assert Outline.polygon(SQUARE).kinks == pytest.approx([0.0, 2.0, 4.0, 6.0])
    assert len(Outline(rounded(SQUARE, 0.2)).kinks) == 0
    assert len(Outline(rounded(SQUARE, [0.0, 0.2, 0.2, 0.2])).kinks) == 1


def test_a_clockwise_outline_is_turned_round() -> None:
    turned = Outline.polygon(SQUARE[::-1])
    assert turned.area == pytest.approx(4.0)
    assert turned.at(np.array([0.0])) == pytest.approx(np.array([SQUARE[3]]))


def test_a_rounded_square() -> None:
    shape, r = Outline(rounded(SQUARE, 0.25)), 0.25
    assert shape.area == pytest.approx(4.0 - (4.0 - pi) * r**2, rel=1e-14)
    assert shape.length == pytest.approx(8.0 - (8.0 - 2.0 * pi) * r, rel=1e-14)
    full = Outline(rounded(SQUARE, 1.0))
    assert full.area == pytest.approx(pi, rel=1e-14)
    assert len(full.pieces) == 4


BAD: dict[str, Callable[[], object]] = {
    "a gap of 0.05 mm at (2, 1.95)": lambda: Outline(
        [Line((0, 0), (2, 0)), Line((2, 0), (2, 1.95)), Line((2, 2), (0, 0))]
    ),
    "crosses or touches itself at (1, 1)": lambda: Outline.polygon(
        [(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 2.0)]
    ),
    "touches itself at (1, 0)": lambda: Outline.polygon(
        [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (1.0, 0.0), (0.0, 2.0)]
    ),
    "piece 2 of the outline, at (2, 0), has no length": lambda: Outline.polygon(
        [(0.0, 0.0), (2.0, 0.0), (2.0, 0.0), (2.0, 2.0)]
    ),
    "turns back upon itself at (2, 2)": lambda: Outline.polygon(
        [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (2.0, 1.0), (0.0, 1.0)]
    ),
    "2 points make no outline": lambda: Outline.polygon([(0.0, 0.0), (1.0, 0.0)]),
    "take 2.4 of its 2 mm": lambda: rounded(SQUARE, 1.2),
}


@pytest.mark.parametrize("words", BAD)
def test_what_is_no_outline_is_named(words: str) -> None:
    with pytest.raises(OutlineError, match=re.escape(words)) as error:
        BAD[words]()
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.0])
def test_a_line_through_an_arc_is_seen(angle: float) -> None:
    """A half disc whose straight side bulges through its round one."""
    tip = -1.01 * np.array([-sin(angle), cos(angle)])
    turn = np.array([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]])
    a, b = (tuple(turn @ p) for p in ([-1.0, 0.0], [1.0, 0.0]))
    pieces: list[Piece] = [Arc(a, b, (0.0, 0.0)), Line(b, tuple(-tip)), Line(tuple(-tip), a)]
    assert Outline(pieces).area > 0.5 * pi
    with pytest.raises(OutlineError, match="crosses"):
        Outline([pieces[0], Line(b, tuple(tip)), Line(tuple(tip), a)])


def test_the_film_may_be_where_the_section_faces_the_rod() -> None:
    shape = Shape.facing(RING, (0.3, 27.7), "round")
    assert np.degrees(np.array(shape.film) / 1.7) == pytest.approx([-75.0, 75.0])
    assert shape.pressure == pytest.approx((pi * 1.7, shape.film[0]))
    flat = Shape.facing(Outline(rounded(SQUARE, 0.3)), (1.0, 2.0), "square", steepest=60.0)
    ends = flat.outline.at(np.array(flat.film))
    assert ends[0] == pytest.approx([0.3 - 0.3 * sin(pi / 3), 0.15])
    assert ends[1] == pytest.approx([1.7 + 0.3 * sin(pi / 3), 0.15])
    sharp = Shape.facing(Outline.polygon(SQUARE), (1.0, 2.0), "square")
    assert sharp.film == pytest.approx((0.0, 2.0))


def test_a_polygon_that_runs_into_itself_is_seen() -> None:
    square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    assert crossing(square) is None
    assert crossing(square[[0, 2, 1, 3]]) == pytest.approx([1.0, 1.0])
