"""A ring, a rod and a gland by name, and the measures that follow."""

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
