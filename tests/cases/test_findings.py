"""Statements on the paper are decided by numbers, and fail for wrong ones."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from softehl.cases.paper import claims
from softehl.cases.paper.claims import FINDINGS
from softehl.cases.paper.figure_spec import Scope
from softehl.cases.paper.lookup import Query
from softehl.cases.paper.states import RequestedState, Store, setup
from softehl.cases.paper.tables import TABLE_2, unknowns
from softehl.cases.seal.states.state import FilmRow
from tests.cases.oring_cases import film_values

Told = Callable[..., dict[str, Any]]


class Made(Query):
    """A query whose states are made up: columns of a row by density, p_s, U and other keys."""

    told: Told

    def state(self, density: int, p_s: float, speed: float, **others: Any) -> RequestedState:
        columns = {"h_star_um": 1.0, "verdict": "ok", **self.told(density, p_s, speed, **others)}
        row = FilmRow(**film_values(**columns))
        return RequestedState(setup(density, p_s, **others), speed, row)


def decided(number: int, told: Told) -> bool | None:
    query = Made(Store(Path()), Scope())
    object.__setattr__(query, "told", told)
    return FINDINGS[number - 1][2](query).holds


@pytest.mark.parametrize(("effect", "holds"), [(1.02, True), (1.004, False)])
def test_shear_counts_only_above_the_error_of_the_mesh(effect: float, holds: bool) -> None:
    def told(density: int, *_: float, shear_traction: bool = True, **__: Any) -> dict[str, Any]:
        error = 1.0 + 0.05 / density**2
        return {"h_star_um": error * (effect if shear_traction else 1.0)}

    assert decided(18, told) is holds


@pytest.mark.parametrize(
    ("index", "change", "holds"), [(0.3, 1.005, True), (0.3, 1.02, False), (0.7, 1.005, None)]
)
def test_only_mild_oscillations_leave_the_film(
    index: float, change: float, holds: bool | None
) -> None:
    def told(density: int, *_: float, **__: Any) -> dict[str, Any]:
        coarse = {"h_star_um": change, "verdict": "oscillating", "oscillation_index": index}
        return coarse if density == 4 else {}

    assert decided(32, told) is holds


@pytest.mark.parametrize(
    ("slow", "holds"),
    [((0.03, 0.05, 0.2), True), ((0.03, 0.2, 0.1), False), ((0.0, 1e-3, 0.0), None)],
)
def test_only_ripples_that_can_be_seen_are_compared(
    slow: tuple[float, ...], holds: bool | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    ripples = dict(
        zip((800.0, 400.0, 200.0, 100.0, 50.0, 25.0), (2e-7, 1e-7, 0.0, *slow), strict=True)
    )
    monkeypatch.setattr(claims, "ripple", lambda state: ripples[state.rod_speed])
    assert decided(30, lambda *_, **__: {}) is holds


@pytest.mark.parametrize(
    ("coarse", "fine", "holds"), [(1.002, 1.0, True), (1.0, 1.0, False), (1.002, 1.002, False)]
)
def test_quadrature_has_to_matter_where_it_is_said_to(
    coarse: float, fine: float, holds: bool
) -> None:
    def told(
        density: int, *_: float, pressure_order: int = 4, quadrature: str = "gauss", **__: Any
    ) -> dict[str, Any]:
        low = density < 4 and pressure_order <= 2
        return {"h_star_um": (coarse if low else fine) if quadrature == "lobatto" else 1.0}

    assert decided(39, told) is holds


@pytest.mark.parametrize("density", TABLE_2)
def test_the_papers_unknowns_are_those_of_a_boundary_twice_the_arc(density: int) -> None:
    def counted(density: int, sides: int) -> int:
        """Displacements, pressures, rod, three obstacles on the whole boundary, one moment."""
        d = density
        nodes = 360 * d**2 + sides * d // 2 + 1
        return 2 * nodes + (108 * d + 1) + (27 * d + 1) + 3 * sides * d + 1

    assert counted(density, 54) == TABLE_2[density][0]
    assert counted(density, 66) != TABLE_2[density][0]


def test_our_unknowns_are_counted_as_the_page_says() -> None:
    for d in (1, 2, 4):
        assert unknowns(d) == (720 * d**2 + 318 * d + 9, 108 * d + 1)
