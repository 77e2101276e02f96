"""A ring, a rod and a gland by name, and the measures that follow."""

from typing import Any

import pytest

from softehl.cases.seal.gland.parameters import Seal


def test_a_ring_on_a_rod_comes_with_its_standard_gland() -> None:
    p = Seal(ring="AS568-210", rod=19.0)
    assert (p.inner_diameter, p.section_diameter) == pytest.approx((18.6436, 3.5306))
    assert p.rod_diameter == 19.0
    assert p.housing_diameter == pytest.approx(19.0 + 2 * 0.121 * 25.4, abs=1e-3)
    assert p.groove_width == pytest.approx(0.185 * 25.4, abs=1e-3)
    assert p.gland == "dynamic"


def test_a_squeeze_decides_the_housing() -> None:
    p = Seal(ring="AS568-210", rod=19.0, squeeze=12.0)
    assert p.housing_diameter == pytest.approx(19.0 + 2 * 0.88 * 3.5306)
    assert p.groove_width == pytest.approx(0.185 * 25.4, abs=1e-3)
    other = Seal(
        section_diameter=5.0, inner_diameter=100.0, rod=101.0, squeeze=20.0, groove_width=7
    )
    assert other.housing_diameter == pytest.approx(109.0)


def test_what_is_used_can_be_given_again() -> None:
    """As a resumed run does, and a run of run.json's parameters."""
    p = Seal(ring="ISO 3601 50.4x3.55", rod=51, squeeze=10)
    assert Seal(**p.model_dump()) == p


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"ring": "AS568-210"}, "needs the rod that it seals, as in rod = 19"),
        ({"ring": "AS568-210", "rod": 19, "inner_diameter": 20.0}, "contradict"),
        ({"ring": "AS568-210", "rod": 19, "rod_diameter": 20.0}, "contradict"),
        ({"squeeze": 12, "housing_diameter": 57.0}, "contradict"),
        ({"rod": 51, "rod_diameter": "wide"}, "rod_diameter"),
        ({"roelands": 0.6, "pressure_viscosity": "thick"}, "pressure_viscosity"),
        ({"ring": "AS568-299", "rod": 19}, 'nearest: "AS568-284" and "AS568-309"'),
        ({"ring": "ISO 3601 50x1.2", "rod": 51}, "give squeeze and groove_width"),
        ({"ring": "AS568-210", "rod": 30}, "stretches inner_diameter"),
        ({"gland": "rotary"}, "gland"),
        ({"backup": False}, "add extrusion_gap"),
        ({"backup": True, "extrusion_gap": 0.05}, "contradict each other: a back-up ring"),
        ({"extrusion_gap": 0.45, "corner_fillet": 1.2}, "together at most half"),
        ({"extrusion_gap": 0.05, "housing_friction": 0.2}, "give one of them"),
        ({"arc_start": -30.0}, "give both, or none"),
    ],
)
def test_what_does_not_fit_is_refused_in_a_line(given: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        Seal(**given)
