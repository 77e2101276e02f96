"""What a run says that it assumed: what matters and was not given."""

from __future__ import annotations

import pytest

from softehl.cases.harness.case_file import read_case
from softehl.cases.shipped import SHIPPED

RING = ("ring=AS568-210", "rod=19")


def assumed(*assignments: str, case: str = "oring") -> list[str]:
    run = read_case(case, SHIPPED, assignments)
    return run.case.assumed(run.parameters, run.set_keys)


def test_of_nothing_given_everything_is_said() -> None:
    words = ["section of 3.53", "inner diameter 50.39", "rubber", "rod of 50", "gland", "back-up"]
    said = assumed()
    assert len(said) == len(words) + 2
    for word, phrase in zip([*words, "pressure of 1 MPa", "65.9 mPa s"], said, strict=True):
        assert word in phrase
    assert assumed(case="cycle") == said


def test_a_ring_stands_in_its_standard_gland() -> None:
    (gland,) = (words for words in assumed(*RING) if "gland" in words)
    assert gland == "its standard gland (housing_diameter = 25.1468 mm, groove_width = 4.699 mm)"


@pytest.mark.parametrize(
    ("given", "gone"),
    [
        ("gland=dynamic", "gland"),
        ("squeeze=15", "housing_diameter"),
        ("groove_width=5", "groove_width"),
        ("shore_A=70", "rubber"),
        ("mu_1=2", "rubber"),
        ("backup=true", "back-up"),
        ("extrusion_gap=0.1", "back-up"),
        ("sealed_pressure=2", "pressure"),
        ("viscosity=1e-8", "oil"),
        ('oil="46 cSt at 40 degC, 6.8 cSt at 100 degC"', "an oil of"),
    ],
)
def test_what_is_given_is_not_assumed(given: str, gone: str) -> None:
    more = ("temperature=40",) if given.startswith("oil") else ()
    assert gone in str(assumed(*RING))
    assert gone not in str(assumed(*RING, given, *more))


WATER_GLYCOL = ("oil=46 cSt at 40 degC, 12 cSt at 100 degC", "temperature=40")


def test_what_is_taken_from_a_mineral_oil_is_said() -> None:
    both = "the density 870 kg/m3 at 15 degC and the pressure-viscosity coefficient 0.0214 1/MPa"
    assert f"{both}, of a mineral oil" in assumed(*RING, *WATER_GLYCOL)
    one = str(assumed(*RING, *WATER_GLYCOL, "oil_density=1080"))
    assert "the pressure-viscosity coefficient" in one
    assert "density 870" not in one
    known = assumed(*RING, *WATER_GLYCOL, "oil_density=1080", "pressure_viscosity=0.003")
    assert "mineral" not in str(known)
    assert "mineral" not in str(assumed(*RING, "oil=HLP 46", "temperature=40"))
    assert "a pressure-viscosity coefficient of 0.02 1/MPa" in assumed(*RING, "viscosity=1e-8")


def warned(*assignments: str) -> str:
    run = read_case("oring", SHIPPED, assignments)
    return " ".join(run.case.warnings(run.parameters))


def test_rubber_and_oil_in_the_cold_are_not_what_they_are_taken_for() -> None:
    cold = warned("material=NBR 70", "oil=HLP 32", "temperature=-35")
    assert "rubber is stiffer in the cold, the more the nearer to -50 degC" in cold
    assert "the pour point of HLP 32 may be as high as -18 degC (DIN 51524)" in cold
    said = "its modulus at room temperature, not at -35 degC"
    assert said in assumed("material=NBR 70", "oil=HLP 32", "temperature=-35")
    assert "pour point" not in warned("oil=HVLP 32", "temperature=-25")
    assert "may be as high as -30 degC" in warned("oil=HVLP 32", "temperature=-35")
    assert "below both viscosities" in warned(WATER_GLYCOL[0], "temperature=-10")
    assert not warned("material=NBR 70", "oil=HLP 32", "temperature=20")
