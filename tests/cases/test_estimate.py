"""The estimated error of h*: exact for the order that is assumed, near where it is not."""

import math
from fractions import Fraction
from math import isnan, nan
from typing import Any

import numpy as np
import pytest

from softehl.cases.seal.coarser_films import CoarserFilms
from softehl.cases.seal.estimate import ORDER, coarser_density, h_star_error
from softehl.cases.seal.film import FastFilm
from softehl.cases.seal.film_path import FilmPath
from softehl.cases.seal.method import run
from softehl.cases.seal.parameters import DENSITIES, ORing
from softehl.cases.seal.path import Stage, StageFailed
from softehl.cases.seal.state import Outcome, Silent
from softehl.runtime.arrays import Array
from softehl.runtime.mesh.sections import Disc, disc_mesh
from tests.cases.oring_cases import oring

CONVERGED = {1600.0: 3.1842, 100.0: 0.59552}
"""h* in um on graded meshes of density 8, p_s = 1 MPa, outstroke; 4 and 8 extrapolated."""


@pytest.fixture(scope="module")
def curve() -> Outcome:
    return run(_case(), Silent())


def _case(**changes: object) -> ORing:
    given = {"mesh": "graded", "upwinding": 1.0, "stroke": "out", "speeds": tuple(CONVERGED)}
    return oring(**{**given, **changes})


def test_coarser_meshes_exist() -> None:
    densities = [coarser_density(d) for d in DENSITIES]
    assert densities == [Fraction(2, 3), Fraction(5, 3), 2, 4, 8]
    disc = Disc(0.0, 26.0, 1.7, -34.0, 43.0)
    assert [disc_mesh(disc, d).arc for d in densities[:3]] == [18, 45, 54]
    with pytest.raises(ValueError, match="a multiple of 1/3"):
        disc_mesh(disc, Fraction(3, 2))


@pytest.mark.parametrize("density", DENSITIES)
def test_an_error_of_that_order_is_found_exactly(density: int) -> None:
    def thickness(d: float) -> float:
        return 0.7 - 0.02 / math.pow(d, ORDER)

    h = thickness(density)
    estimate = h_star_error(density, h, thickness(float(coarser_density(density))))
    assert estimate == pytest.approx(100.0 * (h - 0.7) / h, rel=1e-9)


def test_an_error_of_another_order_is_not() -> None:
    coarser = 0.7 - 0.02 / float(coarser_density(2)) ** 4
    error = 100.0 * (0.02 / 2**4) / 0.7
    assert abs(h_star_error(2, 0.7 - 0.02 / 2**4, coarser)) > 1.5 * error


def test_the_estimate_is_within_a_factor_of_two(curve: Outcome) -> None:
    for state in curve.states:
        error = 100.0 * (state.h_star_um / CONVERGED[state.rod_speed] - 1.0)
        assert 0.5 < state.h_star_error_percent / error < 2.0


def test_the_films_of_the_coarser_mesh_are_no_results(curve: Outcome) -> None:
    assert [state.rod_speed for state in curve.states] == list(CONVERGED)
    assert {state.density for state in curve.states} == {2}
    names = [stage.name for stage in curve.stages]
    assert "coarser mesh: falling speed" in names
    assert names.index("coarser mesh: contact") < names.index("falling speed")


def test_the_films_start_from_those_of_the_coarser_mesh(curve: Outcome) -> None:
    names = [stage.name for stage in curve.stages]
    assert names.count("falling speed") == 1
    assert "coarser mesh: contact to film" in names
    assert "contact to film" not in names


def test_without_an_estimate_only_the_way_is_another(curve: Outcome) -> None:
    plain = run(_case(error_estimate=False), Silent())
    assert [s.h_star_um for s in plain.states] == pytest.approx(
        [s.h_star_um for s in curve.states], rel=1e-9
    )
    assert "contact to film" in [stage.name for stage in plain.stages]
    assert all(isnan(s.h_star_error_percent) for s in plain.states)
    assert not any(stage.name.startswith("coarser") for stage in plain.stages)
    assert isnan(h_star_error(2, 1.0, nan))


def test_films_are_carried_by_pressures_that_lag(
    curve: Outcome, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nowhere(*given: Any) -> tuple[Stage, Array]:
        _, stage, _, _, x = given
        return stage, np.full_like(x, np.nan)

    monkeypatch.setattr(FastFilm, "carried", nowhere)
    outcome = run(_case(), Silent())
    names = [stage.name for stage in outcome.stages]
    assert names.count("film of another mesh") == len(CONVERGED)
    assert "contact to film" not in names
    assert [s.h_star_um for s in outcome.states] == pytest.approx(
        [s.h_star_um for s in curve.states], rel=1e-9
    )


def test_an_estimate_needs_no_path_on_the_coarser_mesh(
    curve: Outcome, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = FilmPath.films

    def no_path(path: FilmPath, *given: Any) -> StageFailed | None:
        return None if path.tolerance is not None else usual(path, *given)

    monkeypatch.setattr(FilmPath, "films", no_path)
    outcome = run(_case(), Silent())
    names = [stage.name for stage in outcome.stages]
    assert names.count("coarser mesh: film of another mesh") == len(CONVERGED)
    assert "coarser mesh: contact to film" not in names
    assert [s.h_star_error_percent for s in outcome.states] == pytest.approx(
        [s.h_star_error_percent for s in curve.states], rel=1e-3
    )


@pytest.mark.parametrize(
    ("misleading", "stage", "times"),
    [("next", "falling speed", 2), ("built", "contact to film", 1)],
    ids=["again from the first film", "from contact without any"],
)
def test_where_coarser_films_mislead_the_path_is_followed(
    misleading: str, stage: str, times: int, curve: Outcome, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = getattr(CoarserFilms, misleading)
    monkeypatch.setattr(CoarserFilms, misleading, lambda *given: -3.0 * usual(*given))
    outcome = run(_case(), Silent())
    assert outcome.converged, outcome.message
    assert [found.name for found in outcome.stages].count(stage) == times
    assert [s.h_star_um for s in outcome.states] == pytest.approx(
        [s.h_star_um for s in curve.states], rel=1e-9
    )
