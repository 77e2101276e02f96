"""What seal engineers type: understood, or answered with what to write."""

from __future__ import annotations

import pytest

from softehl.cases.harness.case_file import read_case
from softehl.cases.harness.errors import BadInput
from softehl.cases.oring import CASE
from softehl.cases.seal.gland.oils import at_100_of_index, density, viscosity_index
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.tolerances import read_tolerances
from softehl.cases.shipped import SHIPPED

GLAND = ("rod=36", "squeeze=15", "groove_width=5.4")


def said(p: Seal) -> list[str]:
    return CASE.assumed(p, p.model_fields_set)


def typed(*assignments: str) -> Seal:
    parameters = read_case("oring", SHIPPED, assignments).parameters
    assert isinstance(parameters, Seal)
    return parameters


@pytest.mark.parametrize(
    "name", ["36x4", "36x4 ISO 3601", "DIN 3771 36x4", "DIN 3771 36 x 4", "O-ring 36x4 ISO 3601-1"]
)
def test_a_metric_ring_with_its_standard_before_or_behind(name: str) -> None:
    p = typed(f"ring={name}", *GLAND)
    assert (p.inner_diameter, p.section_diameter) == (36.0, 4.0)


@pytest.mark.parametrize("key", ["shore_A", "material", "compound"])
def test_a_rubber_by_polymer_and_hardness(key: str) -> None:
    p = typed(f"{key}=NBR 70")
    assert (p.compound, p.shore_A, p.material) == ("NBR 70", 70.0, "neo-hooke")
    assert p.shear_modulus == pytest.approx(1.84017, rel=1e-5)
    assert typed(f"{key}=70 Shore A").shear_modulus == p.shear_modulus
    assert Seal(**p.model_dump()) == p


def test_polyurethane_has_a_rule_of_its_own() -> None:
    """The rule of Qi, Joyce and Boyce with 95 Shore A as 46 Shore D; Gent's gives 6 % more."""
    p = typed("material=PU 95")
    assert 3.0 * p.shear_modulus == pytest.approx(10.0 ** (0.0235 * 96.0 - 0.6403), rel=1e-9)
    (told,) = (words for words in said(p) if "hardness" in words)
    assert "known to -32 and +91 %" in told
    assert typed("shore_A=90").shear_modulus < typed("material=PU 90").shear_modulus


def test_a_rubber_outside_its_temperatures_is_told() -> None:
    warm = typed("material=NBR 70", "oil=HLP 46 at 130 degC")
    assert "NBR is used from -40 to 120 degC" in " ".join(CASE.warnings(warm))
    assert "NBR" not in " ".join(CASE.warnings(typed("material=NBR 70", "oil=HLP 46 at 100 degC")))


def test_a_rod_with_a_fit_is_solved_at_the_middle_of_its_limits() -> None:
    p = typed("ring=AS568-210", "rod=19 f7", "sensitivity=true")
    assert p.rod_diameter == pytest.approx(19.0 - 0.5e-3 * (20 + 41))
    assert Seal(**p.model_dump()) == p
    moved = read_tolerances(p)["rod_diameter"]
    assert moved == {"rod_diameter": pytest.approx(0.0105 / p.rod_diameter)}
    assert CASE.foreword(p)[0] == ("rod = 19 f7: 18.959 to 18.98 mm, solved at the middle, 18.9695")


def test_a_finish_is_an_rms_height_and_its_factor_is_told() -> None:
    p = typed("roughness=Ra 0.2")
    assert p.roughness == pytest.approx((0.0, 0.250663), rel=1e-5)
    assert "0.2507 um rms, 1.253 Ra (normal distribution)" in " ".join(CASE.foreword(p))
    both = typed("roughness=Ra 0.1 and Rq 0.4")
    assert both.roughness == pytest.approx((0.125331, 0.4), rel=1e-5)
    assert typed('roughness=["Ra 0.1", 0.4]').roughness == both.roughness
    assert Seal(**both.model_dump()) == both


def test_oils_by_their_din_names_and_a_viscosity_in_one_word() -> None:
    mineral = typed("oil=ISO VG 46", "temperature=50")
    for name in ("HLP 46", "HLP 46 at 50 degC"):
        assert typed(f"oil={name}", "temperature=50").viscosity == mineral.viscosity
    assert typed("oil=HLP 46 at 50 degC").temperature == 50.0
    for key in ("viscosity", "oil"):
        assert typed(f"{key}=100 mPas").viscosity == pytest.approx(1e-7, rel=1e-12)
    assert typed("viscosity=HLP 46", "temperature=50").viscosity == mineral.viscosity


def test_an_improved_oil_has_the_least_index_of_its_kind_and_says_so() -> None:
    p = typed("oil=HVLP 46", "temperature=100")
    assert p.viscosity == pytest.approx(7.825 * density(100.0) * 1e-12, rel=1e-4)
    assert "a viscosity index of 140" in " ".join(said(p))
    assert "index" not in " ".join(said(typed("oil=HVLP 46 VI 150", "temperature=100")))


def test_the_examples_of_astm_d2270() -> None:
    assert viscosity_index(22.83, 5.05) == pytest.approx(156, abs=0.6)
    for at_40, index in ((32.0, 140.0), (46.0, 100.0), (68.0, 200.0), (150.0, 140.0)):
        assert viscosity_index(at_40, at_100_of_index(at_40, index)) == pytest.approx(index)
    with pytest.raises(ValueError, match="from 100 to 400, given 90"):
        at_100_of_index(46.0, 90.0)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (("rod=36 f7",), r"is a U-cup for a rod of 25 mm, not of 35.9625; give rod = 25, or a U-"),
        (("rod=36 f7",), 'as in "U-cup 36x46x8"'),
        (("rod=20",), r"is a U-cup for a rod of 25 mm, not of 20; .* \"U-cup 20x30x8\""),
        (("bore=50 H8",), r"is a U-cup for a bore of 35 mm, not of 50.0195; .*\"U-cup 40x50x8\""),
    ],
)
def test_a_u_cup_for_another_rod_is_named(given: tuple[str, ...], says: str) -> None:
    with pytest.raises(BadInput, match=says):
        typed("ring=U-cup 25x35x8", *given)
    assert typed("ring=U-cup 25x35x8", "rod=25 f7").section == "u_cup"


GROUNDS = {
    ("rod=36", "groove_diameter=43 H11"): 43.08,
    ("rod=36", "housing_diameter=43 H11"): 43.08,
    ("bore=43", "groove_diameter=36 h11"): -35.92,
    ("bore=43 H8", "groove_diameter=36 h11"): -35.92,
    ("bore=43 H8", "housing_diameter=36 h11"): -35.92,
    ("bore=43", "groove_depth=3.5", "inner_diameter=35 ±0.2", "section_diameter=4"): -36.0,
    ("rod=36", "groove_depth=3.5 h11"): 36 + 2 * (3.5 - 0.5 * 0.075),
    ("rod=36", "groove_depth=3.5 H11"): 36 + 2 * (3.5 + 0.5 * 0.075),
}
"""Sizes of a groove with a class of ISO 286 -> housing_diameter, at the middle of the limits: IT11
is 0.16 mm from 30 to 50 mm and 0.075 mm from 3 to 6 mm."""


@pytest.mark.parametrize("given", GROUNDS, ids=" ".join)
def test_the_groove_of_a_rod_seal_is_a_hole_that_of_a_piston_seal_a_shaft(
    given: tuple[str, ...],
) -> None:
    ring = "ring=36x4" if given[0].startswith("rod") else "ring=35x4"
    p = typed(*(given if "section_diameter=4" in given else (ring, *given)))
    assert p.housing_diameter == pytest.approx(GROUNDS[given], abs=1e-9)
    assert Seal(**p.model_dump()) == p
    assert p.said


def test_names_of_rings_with_a_leading_zero_and_of_quad_rings() -> None:
    for name in ("-010", "010", "AS568-010"):
        assert typed(f"ring={name}", "rod=6.2").section_diameter == pytest.approx(1.778)
    assert typed("ring=Q4-210", "rod=19") == typed("ring=X-ring 210", "rod=19").model_copy(
        update={"ring": "Q4-210"}
    )
