"""Grooves and rings by their names and standards, and what is assumed of them."""

from __future__ import annotations

from itertools import pairwise
from math import pi
from typing import Any

import pytest

from softehl.cases.harness.case_file import read_case
from softehl.cases.harness.errors import BadInput
from softehl.cases.oring import CASE
from softehl.cases.seal.gland import catalogue
from softehl.cases.seal.gland.catalogue import as568, ring, series
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
from softehl.cases.seal.gland.trade.normalise_text import NotUnderstoodError
from softehl.cases.shipped import SHIPPED

# --- Standard glands: values of charts, rules between them, keys of depth and fill, tolerances ----


METRIC = {
    **{1.6: (1.3, 2.1), 2.4: (2.05, 3.2), 2.7: (2.3, 3.6), 3.6: (3.15, 4.8), 5.7: (5.0, 7.2)},
    **{1.8: (1.45, 2.4), 2.0: (1.65, 2.7), 2.65: (2.25, 3.6), 3.0: (2.6, 4.0), 3.55: (3.1, 4.8)},
    **{4.0: (3.5, 5.2), 5.0: (4.4, 6.6), 5.3: (4.7, 7.1), 6.0: (5.3, 7.4), 7.0: (6.1, 9.5)},
}
"""Section -> depth and width of a maker's chart, dynamic, mm."""

PNEUMATIC = {
    **{1.8: (1.55, 2.3), 2.0: (1.8, 2.4), 2.65: (2.35, 3.1), 3.0: (2.75, 3.6), 3.55: (3.25, 4.2)},
    **{4.0: (3.7, 4.8), 5.0: (4.65, 6.0), 5.3: (4.95, 6.4), 6.0: (5.65, 7.2), 7.0: (6.6, 8.4)},
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
    for section in set(METRIC) & set(PNEUMATIC):
        assert squeeze(section, PNEUMATIC[section][0]) < squeeze(section, METRIC[section][0])


def test_inch_and_metric_charts_of_two_makers_agree() -> None:
    metric = {1.78: (1.45, 2.4), 2.62: (2.25, 3.6), 3.53: (3.1, 4.8), 5.33: (4.7, 7.1)}
    for section, (depth, width) in {**metric, 6.99: (6.1, 9.5)}.items():
        found = gland(section)
        assert found.depth == pytest.approx(depth, rel=0.02)
        assert found.width == pytest.approx(width, rel=0.024)


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


# --- The catalogue of rings and glands, against published dimensions and its own order ------------


SERIES = {0: (1, 50), 1: (102, 178), 2: (201, 284), 3: (309, 395), 4: (425, 475)}
# inside diameter and tolerance, inch, as makers' charts print them
PRINTED = {
    **{1: (0.029, 0.004), 12: (0.364, 0.005), 50: (5.239, 0.037), 113: (0.549, 0.007)},
    **{152: (3.237, 0.024), 178: (9.737, 0.055), 201: (0.171, 0.005), 210: (0.734, 0.010)},
    **{222: (1.484, 0.015), 226: (1.984, 0.018), 230: (2.484, 0.020), 259: (6.234, 0.040)},
    **{284: (17.955, 0.085), 325: (1.475, 0.015), 395: (25.940, 0.120), 425: (4.475, 0.033)},
    **{451: (10.975, 0.060), 475: (25.940, 0.120)},
}


def test_all_general_sizes_are_there() -> None:
    numbers = [n for first, last in SERIES.values() for n in range(first, last + 1)]
    assert list(as568()) == numbers
    assert len(numbers) == 349


def test_printed_sizes() -> None:
    for number, printed in PRINTED.items():
        found = as568()[number]
        assert found.inner_diameter == pytest.approx(printed[0] * INCH, abs=1e-4)
        assert found.inner_tolerance == pytest.approx(printed[1] * INCH, abs=1e-4)


@pytest.mark.parametrize("series", SERIES)
def test_sizes_and_tolerances_rise_in_a_series(series: int) -> None:
    first, last = SERIES[series]
    rings = [as568()[n] for n in range(first, last + 1)]
    for a, b in pairwise(rings):
        assert b.inner_diameter > a.inner_diameter
        assert a.inner_tolerance is not None
        assert b.inner_tolerance is not None
        assert b.inner_tolerance >= a.inner_tolerance


def test_rings_by_name() -> None:
    """`test_trade` has the spellings."""
    number, metric = ring("226"), ring("50,4 x 3,55")
    assert number.name == "AS568-226"
    assert (number.inner_diameter, number.section_diameter) == pytest.approx((50.3936, 3.5306))
    assert metric.name == "ISO 3601 50.4x3.55"
    assert (metric.inner_diameter, metric.section_diameter) == (50.4, 3.55)
    assert (metric.inner_tolerance, metric.section_tolerance) == (0.48, 0.10)


# sizes of makers' catalogues: inside diameter, section, mm
OF_SERIES = {
    **{"P3": (2.8, 1.9), "P10": (9.8, 1.9), "P10A": (9.8, 2.4), "P11.2": (11.0, 2.4)},
    **{"P22": (21.8, 2.4), "P22A": (21.7, 3.5), "P22.4": (22.1, 3.5), "P50": (49.7, 3.5)},
    **{"P48A": (47.6, 5.7), "P150": (149.6, 5.7), "P150A": (149.5, 8.4), "P400": (399.5, 8.4)},
    **{"G25": (24.4, 3.1), "G145": (144.4, 3.1), "G150": (149.3, 5.7), "G300": (299.3, 5.7)},
    **{"V15": (14.5, 4.0), "V175": (173.0, 4.0), "V480": (475.0, 10.0), "V1055": (1044.0, 10.0)},
    **{"S22": (21.5, 1.5), "S22.4": (21.9, 2.0), "R8": (8.9, 2.7), "R27": (37.3, 3.6)},
}


def test_rings_of_series() -> None:
    for code, sizes in OF_SERIES.items():
        for name in (code, f"O-ring {code[0]}-{code[1:]}"):
            found = ring(name)
            assert (found.inner_diameter, found.section_diameter) == sizes, name
    assert ring("JIS B 2401-1 P20").name == "JIS B 2401 P20"
    assert (ring("R28"), ring("R52")) == (as568()[325], as568()[349])
    for letter in "PGVSR":
        rings = [r for code, r in series().items() if code[0] == letter]
        by_section = [(r.section_diameter, r.inner_diameter) for r in rings]
        assert by_section == sorted(set(by_section)), letter


def test_a_ring_of_jis_has_the_groove_of_its_standard() -> None:
    """JIS B 2401-2: P20 sits between 20 and 24 mm in a groove of 3.2 mm."""
    p = made(ring="P20", rod=20.0)
    assert (p.housing_diameter, p.groove_width) == (24.0, 3.2)
    assert "its standard gland (housing_diameter = 24 mm" in assumed(ring="P20", rod=20.0)
    assert made(ring="P20", bore=24.0).housing_diameter == -20.0
    pneumatic = made(ring="P20", rod=20.0, gland="pneumatic")
    assert pneumatic.depth == pytest.approx(gland(2.4, "pneumatic").depth)
    assert "without motion" not in " ".join(CASE.warnings(p))
    assert "are for seals without motion" in " ".join(CASE.warnings(made(ring="G50", rod=50.0)))


def test_sizes_of_iso_3601_have_a_class() -> None:
    a, b = ring("ISO 3601-1-210A-N"), ring("ISO 3601-1 210B 18,64x3,53 - S")
    assert a == as568()[210]
    assert (b.inner_diameter, b.section_diameter) == (a.inner_diameter, a.section_diameter)
    assert (b.inner_tolerance, b.section_tolerance) == (0.25, 0.10)


def test_rings_by_inches() -> None:
    for name, number in {
        "1 1/2 in x 1/8 in": 222,
        '3/4" x 1" x 1/8"': 210,
        "1-1/2 x 3/16 in": 325,
        ".734 in x .139 in": 210,
        "26 in x 1/4 in": 475,
        "1/4 inch x 1/16 inch": 10,
    }.items():
        assert ring(name) == as568()[number], name
    other = ring("0.8 in x 0.11 in")
    assert (other.inner_diameter, other.section_diameter) == (20.32, 2.794)


RUBBERS = {
    **{"MS28775-210": "NBR 70", "M83248/1-210": "FKM 75", "NAS1611-210": "EPDM 80"},
    **{"Parker 2-210 N0674-70": "NBR 70", "2-210 N674-70": "NBR 70", "210 NBR 90": "NBR 90"},
}


SPELT = {
    **dict.fromkeys(("JIS B 2401-1A-P20", "1A P20", "JIS B 2401-1-NBR-70-1-P20-N"), (19.8, 2.4)),
    **{"P 10 A": (9.8, 2.4), "G100-S": (99.4, 3.1), "NAS1611-210A": (18.6436, 3.5306)},
    **dict.fromkeys(("ID 20 OD 26", "OD 26, section 3", "CS 3 OD 26", "20 mm by 3 mm"), (20, 3)),
    **{"NF T 47-501 R20": (26.2, 3.6), "SMS 1586 19.2x3": (19.2, 3.0), "20x3.55G": (20, 3.55)},
}


def test_other_spellings_of_the_same_ring() -> None:
    for name, sizes in SPELT.items():
        known = ring(name)
        assert (known.inner_diameter, known.section_diameter) == pytest.approx(sizes), name
    for name in ("OD 26 ID 28", "2-210N", "JIS class 9 P-20"):  # no hint that is another ring
        with pytest.raises(ValueError, match=r"28 and a section of -1|36x4"):
            ring(name)


def test_rings_with_their_rubber() -> None:
    for name, rubber in RUBBERS.items():
        p = made(ring=name, rod=19.0)
        assert p.section_diameter == pytest.approx(3.5306)
        assert p.compound == rubber
        assert Seal(**p.model_dump()) == p
    assert made(ring="JIS B 2401 P20 1A", rod=20.0).compound == "NBR 70"
    assert made(ring="U-cup 25x35x8 PU 95").compound == "PU 95"
    assert made(ring="X-ring 36x4, FKM 75", rod=36.0, swelling=3.0).compound == "FKM 75"
    said = assumed(ring="MS28775-210", rod=19.0)
    assert "a rubber NBR 70, as MS28775 asks for" in said
    assert made(ring="MS28775-210", rod=19.0, mu=2.0, material="neo-hooke").shear_modulus == 2.0
    with pytest.raises(ValueError, match='is of NBR 70, and compound = "FKM 75"'):
        made(ring="MS28775-210", rod=19.0, material="FKM 75")


def test_a_ring_for_another_rod_is_named() -> None:
    """As the ring of its catalogue and section that goes on this rod, or into this bore."""
    for given, other in {
        ("AS568-210", "rod=30"): "AS568-217",
        ("P20", "bore=40"): None,
        ("P30", "rod=45"): "P44",
        ("36x4", "rod=50"): "49x4",
        ("36x4", "bore=60"): "52x4",
    }.items():
        with pytest.raises(BadInput) as caught:
            read_case("oring", SHIPPED, [f"ring={given[0]}", given[1]])
        said = str(caught.value)
        assert (f'ring = "{other}" fits' in said) if other else "fits" not in said, said
        if other:
            fitting = read_case("oring", SHIPPED, [f"ring={other}", given[1]]).parameters
            assert isinstance(fitting, Seal)
            assert not [*handbook(fitting)], other


def test_small_and_large_sections_have_a_gland_by_rule() -> None:
    small = gland(as568()[1].section_diameter)
    assert small.by_rule
    assert squeeze(1.016, small.depth) == pytest.approx(squeeze(1.5, 1.25), abs=0.5)
    assert gland(8.4).width == 11.0
    assert "in proportions" in assumed(ring="AS568-001", rod=0.75)
    with pytest.raises(ValueError, match="only 1 to 10 mm"):
        gland(12.0)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("P33", 'no size of JIS B 2401 that is known here; write "P32" or "P34"'),
        ("R7", 'write "R8" or "R9"'),
        ("ISO 3601-1 210A 19x3.53", 'size 210 is 18.64x3.53, not 19x3.53; write "AS568-210"'),
        ("7/10 in x 1/8 in", 'the nearest is; write "AS568-209"'),
        ("1 in x 1/7 in", "nominal sections of AS568 are 1/16, 3/32, 1/8, 3/16, 1/4 in"),
        ("AS568-100", 'no general size -100; nearest: "AS568-050" and "AS568-102"'),
        ("-999", 'nearest: "AS568-475"'),
        ("000", 'nearest: "AS568-001"'),
        ("quad ring", 'write "36x4", "ISO 3601 50.4x3.55" or "AS568-226"'),
        ("U-cup 25x35x8", "is a U-cup, which is named by its groove"),
        ("ISO 3601 3.55x50.4", "write inside diameter x section in mm"),
    ],
)
def test_unknown_rings_name_the_nearest(name: str, says: str) -> None:
    with pytest.raises(NotUnderstoodError) as caught:
        ring(name)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def seated(*sizes: float) -> Gland:
    names = ("inner_diameter", "section_diameter", "rod_diameter", "housing_diameter")
    given: dict[str, Any] = dict(zip((*names, "groove_width"), sizes, strict=True))
    return Gland(**given)


def test_stretch() -> None:
    assert seated(50.0, 4.0, 51.0, 58.0, 5.0).stretch_percent == pytest.approx(2.0)
    assert seated(50.39, 4.0, 50.0, 57.0, 5.0).stretch_percent == 0.0


def test_a_ring_is_stretched_on_the_ground_of_a_piston() -> None:
    p = seated(-40.0, 4.0, -40.0, -33.0, 5.2)  # an inside diameter of 32 mm
    assert p.stretch_percent == pytest.approx(100.0 / 32.0)
    assert p.fill_percent == pytest.approx(68.1, abs=0.1)


def test_squeeze() -> None:
    assert squeeze(3.53, 3.15) == pytest.approx(10.765, abs=1e-3)


def test_warnings_of_handbooks() -> None:
    ring_226 = 50.3936, 3.5306
    assert not [*handbook(seated(*ring_226, 50.0, 56.15, 4.7))]
    (over,) = handbook(seated(*ring_226, 50.0, 56.15, 3.3))
    assert over == "the ring fills 98 % of its gland; handbooks advise 60 to 95 %"
    (wide,) = handbook(seated(*ring_226, 50.0, 56.15, 9.0))
    assert wide.startswith("the ring fills 36 %")
    (tight,) = handbook(seated(*ring_226, 53.5, 59.65, 4.7))
    assert "stretched by 6.2 % on its rod" in tight


# --- A ring, a rod and a gland by name, and the measures that follow ------------------------------


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


# --- What a run says that it assumed: what matters and was not given ------------------------------


RING = ("ring=AS568-210", "rod=19")


def assumptions(*assignments: str, case: str = "oring") -> list[str]:
    run = read_case(case, SHIPPED, assignments)
    return run.case.assumed(run.parameters, run.set_keys)


def test_of_nothing_given_everything_is_said() -> None:
    words = ["section of 3.53", "inner diameter 50.39", "rubber", "rod of 50", "gland", "back-up"]
    said = assumptions()
    assert len(said) == len(words) + 2
    for word, phrase in zip([*words, "pressure of 1 MPa", "65.9 mPa s"], said, strict=True):
        assert word in phrase
    assert assumptions(case="cycle") == said


def test_a_ring_stands_in_its_standard_gland() -> None:
    (gland,) = (words for words in assumptions(*RING) if "gland" in words)
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
    assert gone in str(assumptions(*RING))
    assert gone not in str(assumptions(*RING, given, *more))


WATER_GLYCOL = ("oil=46 cSt at 40 degC, 12 cSt at 100 degC", "temperature=40")


def test_what_is_taken_from_a_mineral_oil_is_said() -> None:
    both = "the density 870 kg/m3 at 15 degC and the pressure-viscosity coefficient 0.0214 1/MPa"
    assert f"{both}, of a mineral oil" in assumptions(*RING, *WATER_GLYCOL)
    one = str(assumptions(*RING, *WATER_GLYCOL, "oil_density=1080"))
    assert "the pressure-viscosity coefficient" in one
    assert "density 870" not in one
    known = assumptions(*RING, *WATER_GLYCOL, "oil_density=1080", "pressure_viscosity=0.003")
    assert "mineral" not in str(known)
    assert "mineral" not in str(assumptions(*RING, "oil=HLP 46", "temperature=40"))
    assert "a pressure-viscosity coefficient of 0.02 1/MPa" in assumptions(*RING, "viscosity=1e-8")


def warned(*assignments: str) -> str:
    run = read_case("oring", SHIPPED, assignments)
    return " ".join(run.case.warnings(run.parameters))


def test_rubber_and_oil_in_the_cold_are_not_what_they_are_taken_for() -> None:
    cold = "material=NBR 70", "oil=HLP 32", "temperature=-20"
    assert "is 10 K above the glass transition of NBR 70, -30 degC" in warned(*cold)
    assert "the pour point of HLP 32 may be as high as -18 degC (DIN 51524)" in warned(*cold)
    modulus = next(text for text in assumptions(*cold) if "modulus" in text)
    assert "MPa: 1.84 MPa by hardness, known to -20 and +28 %, times 6.61 at -20 degC" in modulus
    assert modulus.endswith("by a glass transition of -30 degC, typical of NBR")
    assert "of HFC 46 is extrapolated from 40 and 100" in warned("oil=HFC 46", "temperature=-20")
    unknown = "shore_A=70", *cold[1:]
    assert "rubber is stiffer in the cold; give glass_transition" in warned(*unknown)
    assert "its modulus at room temperature, not at -20 degC" in assumptions(*unknown)
    assert "pour point" not in warned("oil=HVLP 32", "temperature=-25")
    assert "may be as high as -30 degC" in warned("oil=HVLP 32", "temperature=-35")
    assert "below both viscosities" in warned(WATER_GLYCOL[0], "temperature=-10")
    assert not warned("material=NBR 70", "oil=HLP 32", "temperature=20")
