"""Glands of the sample of sections: what is drawn makes sense, and some are solved whole."""

from __future__ import annotations

import pytest

from softehl.cases.harness.row import OK
from softehl.cases.seal.states.state import OSCILLATING, UNDER_RESOLVED
from tests.cases.gland_matrix import SPEEDS, solved
from tests.cases.section_matrix import NAMES, drawn

WHOLE = {"trapezoid": 3, "rectangular": 5, "d_ring": 7}
"""One gland of a section each, by number, that is solved within half a minute of a processor."""


def test_what_is_drawn_fits_its_groove() -> None:
    for number in range(2 * len(NAMES)):
        p = drawn(number)
        depth = 0.5 * (p.housing_diameter - p.rod_diameter)
        assert p.section == NAMES[number % len(NAMES)]
        assert p.free_section.outline.area <= 0.95 * depth * p.groove_width
        assert 1.03 * p.axial_width <= p.groove_width + 1e-3
        assert 0.0 <= p.sealed_pressure <= 2.0 * p.shear_modulus + 1e-3
        assert drawn(number) == p


@pytest.mark.slow
def test_oil_gets_below_a_lip_that_lies_flat() -> None:
    found = solved(29, 150.0, drawn, stroke="out")  # a U-cup: 3 mm of lip under 0.3 MPa, and a heel
    assert {s["verdict"] for s in found["states"]} <= {OK, OSCILLATING, UNDER_RESOLVED}
    h = [s["h_star_um"] for s in found["states"]]
    assert h == pytest.approx([9.37, 2.73, 0.833], rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("section", WHOLE)
def test_a_gland_of_the_sample_is_solved_whole(section: str) -> None:
    found = solved(WHOLE[section], 120.0, drawn)
    assert found["section"] == section
    assert found["message"] == ""
    assert [s["verdict"] for s in found["states"]] == 2 * len(SPEEDS) * [OK]
    for stroke in (found["states"][:3], found["states"][3:]):
        h = [s["h_star_um"] for s in stroke]
        # the inlet alone decides: h* rises with U^0.6 where viscosity does not rise with pressure
        assert h[0] / h[1] == pytest.approx(10.0**0.6, rel=0.05)
        assert h[1] / h[2] == pytest.approx(10.0**0.6, rel=0.05)
