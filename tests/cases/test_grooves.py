"""Standard glands: values of charts, rules between them, keys of depth and fill, tolerances."""

from __future__ import annotations

from math import pi
from typing import Any

import pytest

from softehl.cases.oring import CASE
from softehl.cases.seal.gland import catalogue
from softehl.cases.seal.gland.catalogue import as568
from softehl.cases.seal.gland.grooves import (
    INCH,
    KINDS,
    cup_gland,
    gland,
    squeeze,
)
from softehl.cases.seal.gland.messages import handbook
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records import Gland
from softehl.cases.seal.gland.tolerances import read_tolerances

METRIC = {
    1.8: (1.45, 2.4),
    2.0: (1.65, 2.7),
    2.65: (2.25, 3.6),
    3.0: (2.6, 4.0),
    3.55: (3.1, 4.8),
    4.0: (3.5, 5.2),
    5.0: (4.4, 6.6),
    5.3: (4.7, 7.1),
    6.0: (5.3, 7.4),
    7.0: (6.1, 9.5),
}
"""Section -> depth and width of a maker's chart, dynamic, mm."""

PNEUMATIC = {
    1.8: (1.55, 2.3),
    2.0: (1.8, 2.4),
    2.65: (2.35, 3.1),
    3.0: (2.75, 3.6),
    3.55: (3.25, 4.2),
    4.0: (3.7, 4.8),
    5.0: (4.65, 6.0),
    5.3: (4.95, 6.4),
    6.0: (5.65, 7.2),
    7.0: (6.6, 8.4),
}


def made(**given: Any) -> Seal:
    return Seal(**given)


def assumed(**given: Any) -> str:
    return " ".join(CASE.assumed(made(**given), given))


def test_glands_of_inch_sections() -> None:
    found = gland(0.139 * INCH)
    assert found.depth == pytest.approx(0.121 * INCH, abs=1e-4)
    assert found.width == pytest.approx(0.185 * INCH, abs=1e-4)
    assert gland(6.99).depth == pytest.approx(0.237 * INCH, abs=1e-4)


def test_glands_of_metric_sections() -> None:
    for chart, kind in zip((METRIC, METRIC, PNEUMATIC), KINDS, strict=True):
        for section, (depth, width) in chart.items():
            found = gland(section, kind)
            assert (found.depth, found.width) == (depth, width)
            assert not found.by_rule
    for section in METRIC:
        assert squeeze(section, PNEUMATIC[section][0]) < squeeze(section, METRIC[section][0])


def test_glands_of_x_rings_are_deeper_and_narrower() -> None:
    for section in (1.78, 2.62, 3.53, 5.33, 6.99):
        ring, quad = gland(section), gland(section, section="x_ring")
        assert quad.depth > ring.depth
        assert quad.width < ring.width
    assert gland(3.53, section="x_ring").depth == pytest.approx(3.25, abs=0.005)
    assert gland(3.53, section="x_ring").width == pytest.approx(4.0, abs=0.1)


def test_a_section_between_two_of_a_chart_has_proportions_between_theirs() -> None:
    found = gland(4.0, section="x_ring")
    assert found.by_rule
    assert squeeze(5.33, 4.978) < squeeze(4.0, found.depth) < squeeze(3.53, 3.251)
    assert 4.0 * 1.115 < found.width < 4.0 * 1.145


def test_a_u_cup_stands_between_heel_and_lips() -> None:
    found = cup_gland(5.5, 4.6, 7.15)
    assert found.depth == pytest.approx(5.05)
    assert found.width == pytest.approx(7.865)


def test_the_standard_gland_of_every_ring_is_sound() -> None:
    """No ring on a rod 2 % wider than its inside, in its gland, is warned about."""
    metric = [catalogue.ring(f"{inner}x{d}") for inner in (20, 36, 100) for d in METRIC]
    for found in [*as568().values(), *metric]:
        if found.section_diameter < 1.6 or found.inner_diameter < 3.0:
            continue
        rod = 1.02 * found.inner_diameter
        inner, section = found.inner_diameter, found.section_diameter
        ring: dict[str, Any] = {"inner_diameter": inner, "section_diameter": section}
        for groove in (gland(found.section_diameter, k) for k in KINDS):
            housing, width = rod + 2.0 * groove.depth, groove.width
            p = Gland(**ring, rod_diameter=rod, housing_diameter=housing, groove_width=width)
            assert not [*handbook(p)]


def test_a_metric_ring_has_its_gland() -> None:
    p = made(ring="36x4", rod=36.0)
    assert (p.housing_diameter, p.groove_width) == (43.0, 5.2)
    fitted = made(ring="36x4", rod="36 f7")
    assert (fitted.rod_diameter, fitted.housing_diameter) == (35.9625, 43.0)
    p = made(ring="36x4", rod=36.0, gland="pneumatic")
    assert (p.housing_diameter, p.groove_width) == (43.4, 4.8)
    assert "its standard gland (housing_diameter = 43 mm" in assumed(ring="36x4", rod=36.0)


def test_a_u_cup_by_its_groove() -> None:
    p = made(ring="U-cup 25x35x8")
    assert (p.section, p.rod_diameter, p.housing_diameter) == ("u_cup", 25.0, 35.0)
    assert p.groove_width == 8.0
    assert p.section_diameter == pytest.approx(5.435)
    assert p.inner_diameter == pytest.approx(25.0 - 0.435)
    assert Seal(**p.model_dump()) == p
    assert "gland" not in assumed(ring="U-cup 25x35x8")
    assert "rod" not in assumed(ring="U-cup 25x35x8")
    fitted = made(ring="U-cup 25x35x8", rod="25 f7", housing_diameter="35 H9")
    assert fitted.rod_diameter == pytest.approx(24.9695)
    assert fitted.housing_diameter == pytest.approx(35.031)


def test_depth_and_fill_decide_housing_and_width() -> None:
    p = made(ring="36x4", rod=36.0, groove_depth=3.4, fill=75.0)
    assert p.housing_diameter == pytest.approx(42.8)
    volume = 2 * pi**2 * 20.0 * 2.0**2
    assert volume / (0.25 * pi * (42.8**2 - 36.0**2) * p.groove_width) == pytest.approx(0.75)
    assert Seal(**p.model_dump()) == p
    square = made(section="rectangular", groove_depth=3.2, fill=80.0)
    assert square.fill_percent == pytest.approx(80.0)


def test_tolerances_of_depth_squeeze_and_fill_are_those_of_diameter_and_width() -> None:
    given: dict[str, Any] = {"sensitivity": True, "tolerances": ("squeeze 2 %", "fill 7 %")}
    p = made(ring="36x4", rod=36.0, groove_depth="3.5 ±0.04", fill=70.0, **given)
    shares = read_tolerances(p)
    moved = [pair for n in ("groove_depth", "squeeze", "fill") for pair in shares[n].items()]
    assert [key for key, _ in moved] == ["housing_diameter", "housing_diameter", "groove_width"]
    sizes = [share for _, share in moved]
    assert sizes == pytest.approx([2 * 0.04 / 43.0, 2 * 0.02 * 4.0 / 43.0, 0.1])
    shares = read_tolerances(Seal(sensitivity=True, tolerances=("groove_depth 2 %",)))
    assert shares["groove_depth"] == {"housing_diameter": pytest.approx(0.02 * 6.3 / 56.3)}
