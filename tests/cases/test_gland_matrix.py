"""A tenth of the sample of docs/limits.md: every tenth gland up to two shear moduli."""

from __future__ import annotations

import pytest

from softehl.cases.harness.row import OK
from tests.cases.gland_matrix import SPEEDS, drawn, solved

MODULI = 2.0


def pressed(number: int) -> float:
    """p_s / mu of a gland."""
    p = drawn(number)
    return p.sealed_pressure / p.shear_modulus


TENTH = [number for number in range(0, 300, 10) if pressed(number) <= MODULI]


def test_a_tenth_of_the_sample_is_what_its_page_says() -> None:
    assert len(TENTH) == 13
    assert 118 <= sum(pressed(number) <= MODULI for number in range(300)) <= 126


@pytest.mark.slow
@pytest.mark.parametrize("number", TENTH)
def test_every_state_of_a_drawn_gland_is_ok(number: int) -> None:
    found = solved(number, limit=200.0)
    assert found["message"] == ""
    assert [state["verdict"] for state in found["states"]] == [OK] * (2 * len(SPEEDS))
    assert all(abs(state["h_star_error_percent"]) < 2.0 for state in found["states"])


@pytest.mark.slow
@pytest.mark.parametrize("number", [221, 208])
def test_an_instroke_leaves_its_corner(number: int) -> None:
    """2.2 and 4.6 shear moduli; on the mesh of contact the first has an estimate of -3.4 %."""
    found = solved(number, limit=600.0)
    assert found["message"] == ""
    assert [state["verdict"] for state in found["states"]] == [OK] * (2 * len(SPEEDS))


def test_the_arc_of_a_thick_film_is_made_longer() -> None:
    # on the first mesh its film seems to be a quarter of the 13 um that it is
    found = solved(55, 60.0, error_estimate=False, stroke="out", speeds=(1000.0,))
    (state,) = found["states"]
    assert state["verdict"] == OK, state["advice"]
    assert state["h_star_um"] == pytest.approx(13.55, rel=0.01)
