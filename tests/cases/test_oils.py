"""Oils by grade or two viscosities: Walther's line, density, pressure; what is refused."""

from __future__ import annotations

from math import exp, log, log10

import pytest

from softehl.cases.seal.gland.oils import (
    Walther,
    barus,
    barus_of_roelands,
    density,
    read_oil,
)
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.trade.oil_names import GRADES

VG46 = (
    "ISO VG 46",
    "vg46",
    "46 cSt at 40 degC, 6.8 cSt at 100 degC",
    "6.8cSt @ 100 C, 46cSt @ 40C",
)


@pytest.mark.parametrize("text", VG46)
def test_walthers_line_of_vg_46(text: str) -> None:
    """Numbers of the issue, to 0.01 %."""
    law = read_oil(text)
    assert pytest.approx(9.41799, rel=1e-4) == law.A
    assert pytest.approx(3.68444, rel=1e-4) == law.B
    assert law(20.0) == pytest.approx(133.84, rel=1e-4)
    assert law(60.0) == pytest.approx(20.623, rel=1e-4)
    assert law(40.0) == pytest.approx(46.0, rel=1e-12)
    assert law(61.0) != pytest.approx(20.623, rel=1e-2)


def test_grades_are_of_one_family() -> None:
    """Viscosity at 100 degC over that at 40 falls steadily, and the slope B with it."""
    slopes = [read_oil(f"ISO VG {grade}").B for grade in GRADES]
    assert all(3.3 < b < 4.2 for b in slopes)
    ratios = [hot / grade for grade, hot in GRADES.items()]
    assert ratios == sorted(ratios, reverse=True)


def test_a_case_takes_the_dynamic_viscosity() -> None:
    p = Seal(oil="ISO VG 46", temperature=60.0)
    rho = 870.0 - 0.65 * 45.0
    assert density(60.0) == pytest.approx(rho)
    assert p.viscosity == pytest.approx(20.623 * rho * 1e-12, rel=1e-4)
    assert p.pressure_viscosity == pytest.approx(1e-2 * (0.6 + 0.965 * log10(17.338)), rel=1e-3)
    heavy = Seal(oil="ISO VG 46", temperature=60.0, oil_density=900.0)
    assert heavy.viscosity / p.viscosity == pytest.approx((rho + 30.0) / rho)
    own = Seal(oil="ISO VG 46", temperature=60.0, pressure_viscosity=0.015)
    assert own.pressure_viscosity == 0.015
    assert Seal(**p.model_dump()) == p


def test_without_an_oil_table_1_holds() -> None:
    p = Seal()
    assert (p.viscosity, p.pressure_viscosity, p.temperature) == (6.59e-8, 0.02, None)


def test_roelands_at_the_pressures_of_seals() -> None:
    """His exponent against Barus with the same start: 0.2 % at 10 MPa, 2 % at 30 MPa."""
    eta, z = 40e-9, 0.6
    alpha = barus_of_roelands(eta, z)

    def ratio(p: float) -> float:
        roelands = (log(eta * 1e6) + 9.67) * ((1.0 + p / 196.2) ** z - 1.0)
        return exp(roelands - alpha * p)

    assert alpha == pytest.approx(0.0197, rel=0.01)
    assert 0.995 < ratio(10.0) < 0.9985
    assert 0.97 < ratio(30.0) < 0.99
    p = Seal(oil="ISO VG 46", temperature=40.0, roelands=z)
    assert p.pressure_viscosity == pytest.approx(barus_of_roelands(p.viscosity, z))
    assert Seal(**p.model_dump()) == p


def test_wooster() -> None:
    assert barus(40e-9) == pytest.approx(0.02146, rel=1e-3)


def test_a_line_needs_two_temperatures() -> None:
    with pytest.raises(ValueError, match="two temperatures"):
        Walther.through((46.0, 40.0), (6.8, 40.0))
