"""What a run says that it assumed: what matters and was not given."""

from __future__ import annotations

import pytest

from softehl.cases.harness.case_file import read_case
from softehl.cases.shipped import SHIPPED

RING = ("ring=AS568-210", "rod=19")


def assumed(*assignments: str, case: str = "oring") -> list[str]:
    run = read_case(case, SHIPPED, assignments)
    return run.case.assumed(run.parameters, run.given)


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
        ('oil="46 cSt at 40 degC, 6.8 cSt at 100 degC"', "oil"),
    ],
)
def test_what_is_given_is_not_assumed(given: str, gone: str) -> None:
    more = ("temperature=40",) if given.startswith("oil") else ()
    assert gone in str(assumed(*RING))
    assert gone not in str(assumed(*RING, given, *more))


def test_another_section_has_its_proportions() -> None:
    assert "the usual proportions of section x_ring" in assumed("section=x_ring")
    assert "proportions" not in str(assumed("section=x_ring", "lobe_radius=0.9"))


def test_a_slider_assumes_nothing() -> None:
    assert assumed(case="slider") == []
