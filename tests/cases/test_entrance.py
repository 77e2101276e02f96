"""Films whose arc begins within their inlet, against arcs that are long enough."""

from functools import cache
from typing import cast

import numpy as np
import pytest

from softehl.cases.harness.row import OK
from softehl.cases.seal.equations.loads import FilmLoads, Stroke
from softehl.cases.seal.equations.system import build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.solve.driver import run
from softehl.cases.seal.states.mesh_indicators import built_up, facing, wedge_friction
from softehl.cases.seal.states.state import CLIPPED, FilmState, Silent

FLOW, SLOPE, H_STAR = 4e-4, 0.3, 2e-3


def _straight(parts: int) -> tuple[np.ndarray, np.ndarray]:
    way = np.linspace(0.0, 1.0, parts + 1)
    return way, 0.01 + SLOPE * way


def test_the_pressure_of_the_entrance_is_at_the_end_where_oil_comes_in() -> None:
    gap = np.zeros(2)
    for stroke, ends in (("out", [3.5, 0.0]), ("in", [3.0, 0.5])):
        film = FilmLoads(3.0, cast("Stroke", stroke), 400.0, gap, entrance=0.5)
        assert film.end_pressures.tolist() == ends


@pytest.mark.parametrize("parts", [1, 7])
def test_a_straight_wedge_has_the_pressure_of_the_integral(parts: int) -> None:
    way, gap = _straight(parts)
    ends = [1.0 / h - 0.5 * H_STAR / h**2 for h in (gap[0], gap[-1])]
    expected = 6.0 * FLOW / SLOPE * (ends[0] - ends[1])
    assert built_up(way, gap, FLOW, H_STAR) == pytest.approx(expected, rel=1e-12)


def test_a_surface_that_turns_away_at_once_builds_nothing_up() -> None:
    # as a section beside the end of its arc that is pressed against the wall
    wall = facing(np.array([0.0, -7e-12, 0.0, 1e-12]), np.array([0.127, 0.165, 0.214, 0.276]))
    assert built_up(*wall, FLOW, H_STAR) == 0.0
    closes = facing(np.array([0.0, 0.1, 0.2]), np.array([0.127, 0.12, 0.3]))
    assert built_up(*closes, FLOW, H_STAR) == np.inf
    way, gap = facing(np.array([0.0, 0.1, 0.2, 0.2, 0.3]), np.array([0.1, 0.2, 0.4, 0.6, 0.7]))
    assert way.tolist() == [0.0, 0.1, 0.2]
    assert gap.tolist() == [0.1, 0.2, 0.4]


def test_friction_below_a_wedge_is_that_of_its_shear() -> None:
    system = build_system(Seal(density=1))
    way = np.linspace(0.0, 1.0, 20001)
    gap = 0.01 + SLOPE * way
    around = 2.0 * np.pi * system.rod_radius * FLOW
    shear = np.trapezoid(4.0 / gap - 3.0 * H_STAR / gap**2, way)
    found = wedge_friction(system, *_straight(3), FLOW, H_STAR)
    assert found[0] == pytest.approx(around * np.trapezoid(1.0 / gap, way), rel=1e-5)
    assert found[1] == pytest.approx(around * shear, rel=1e-5)


def test_a_gap_that_does_not_widen_is_no_wedge() -> None:
    assert built_up(np.zeros(1), np.full(1, 0.01), FLOW, H_STAR) == np.inf


@cache
def _cut(arc_end: float, speed: float) -> FilmState:
    """The paper's ring on the instroke, whose inlet is at the air end of the arc."""
    p = Seal(arc_start=-34.0, arc_end=arc_end, speeds=(speed,), stroke="in", error_estimate=False)
    (state,) = run(p, Silent()).states
    return state


def test_a_film_that_begins_with_its_wedge_is_that_of_a_longer_arc() -> None:
    whole, cut = _cut(48.0, 1600.0), _cut(28.0, 1600.0)
    assert whole.verdict == cut.verdict == OK
    # 3.1 % too thin without the pressure of the wedge, and 0.8 % less friction
    assert cut.h_star_um == pytest.approx(whole.h_star_um, rel=0.01)
    assert cut.rod_friction_N == pytest.approx(whole.rod_friction_N, rel=0.015)
    assert cut.profile.p_MPa[-1] > 0.1 > whole.profile.p_MPa[-1]


def test_the_pressure_of_a_wedge_is_that_of_the_film_on_a_longer_arc() -> None:
    whole, cut = (_cut(arc_end, 1600.0).profile for arc_end in (48.0, 28.0))
    outside = whole.x_mm > whole.x_mm[np.argmax(whole.p_MPa)]
    h, p = whole.h_um[outside], whole.p_MPa[outside]
    there = np.interp(cut.h_um[-1], h[np.argmin(h) :], p[np.argmin(h) :])
    assert cut.p_MPa[-1] == pytest.approx(there, rel=0.15)


def test_an_arc_that_ends_where_the_film_is_metered_has_no_wedge() -> None:
    assert _cut(26.0, 400.0).verdict == CLIPPED
