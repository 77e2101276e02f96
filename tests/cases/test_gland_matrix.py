"""Every tenth of 300 random O-rings up to three shear moduli."""

from __future__ import annotations

from typing import Any

import pytest

from softehl.cases.harness.row import OK
from softehl.cases.seal.states.state import UNCERTAIN
from tests.cases.gland_matrix import SPEEDS, drawn, solved

MODULI = 3.0


def pressed(number: int) -> float:
    """p_s / mu of a gland."""
    p = drawn(number)
    return p.sealed_pressure / p.shear_modulus


def are_found(states: list[dict[str, Any]]) -> bool:
    """Whether all h* hold: states are `ok`, or `uncertain` for their friction alone."""
    return all(s["verdict"] == OK or s["advice"].startswith("friction ") for s in states)


TENTH = [number for number in range(0, 300, 10) if pressed(number) <= MODULI]


def test_a_tenth_of_the_sample_is_what_its_page_says() -> None:
    assert len(TENTH) == 21
    assert sum(pressed(number) <= MODULI for number in range(300)) == 184


@pytest.mark.slow
@pytest.mark.parametrize("number", TENTH)
def test_every_film_of_a_drawn_gland_is_found(number: int) -> None:
    found = solved(number, limit=200.0)
    assert found["message"] == ""
    assert len(found["states"]) == 2 * len(SPEEDS)
    doubted = [state for state in found["states"] if not are_found([state])]
    assert len(doubted) <= 1  # for the estimate of its error alone
    assert all(state["verdict"] == UNCERTAIN for state in doubted)


@pytest.mark.slow
@pytest.mark.parametrize("number", [54, 240])
def test_a_ring_in_a_corner_has_its_films(number: int) -> None:
    """3.5 shear moduli: meshes of films are made, and the change from contact is carried there."""
    found = solved(number, limit=600.0)
    assert found["message"] == ""
    assert len(found["states"]) == 2 * len(SPEEDS)
    assert are_found(found["states"])


def test_the_arc_of_a_thick_film_is_made_longer() -> None:
    # on the first mesh its film seems to be a quarter of the 13 um that it is
    found = solved(55, 60.0, error_estimate=False, stroke="out", speeds=(1000.0,))
    (state,) = found["states"]
    assert state["verdict"] == OK, state["advice"]
    assert state["h_star_um"] == pytest.approx(13.55, rel=0.01)
