"""Two hundred spellings of rings, fits, oils, rubbers and finishes: read right, or refused."""

from __future__ import annotations

import re
from math import pi, sqrt

import pytest

from softehl.cases.seal.gland.trade.finish_names import read_finish
from softehl.cases.seal.gland.trade.fit_names import DEVIATIONS, GRADES, STEPS, band, read_fit
from softehl.cases.seal.gland.trade.oil_names import dynamic, read_oil_name
from softehl.cases.seal.gland.trade.ring_names import Kind, RingName, read_ring
from softehl.cases.seal.gland.trade.rubber_names import RubberName, read_rubber
from softehl.cases.seal.gland.trade.text import NotUnderstoodError

METRIC = (36.0, 4.0, None)
RINGS = {
    "36x4": METRIC,
    "36 x 4": METRIC,
    "36 x 4 mm": METRIC,
    "36mm x 4mm": METRIC,
    "36 mm x 4 mm": METRIC,
    "36X4": METRIC,
    "36\u00d74": METRIC,
    "36*4": METRIC,
    "36,0x4,0": METRIC,
    "36.0 x 4.00": METRIC,
    "ISO 3601 36x4": METRIC,
    "36x4 ISO 3601": METRIC,
    "ISO 3601-1 36x4": METRIC,
    "ISO 3601-1:2012 36 x 4": METRIC,
    "DIN ISO 3601 36x4": METRIC,
    "DIN ISO 3601-1 - 36 x 4": METRIC,
    "ISO3601 36x4": METRIC,
    "DIN 3771 36x4": METRIC,
    "DIN 3771 36 x 4": METRIC,
    "DIN3771-36x4": METRIC,
    "GB/T 3452.1 36x4": METRIC,
    "ID 36 CS 4": METRIC,
    "ID=36 mm, CS=4 mm": METRIC,
    "O-ring 36x4": (36.0, 4.0, "round"),
    "o ring 36 x 4": (36.0, 4.0, "round"),
    "O-Ring 36x4 ISO 3601-1": (36.0, 4.0, "round"),
    "OR 36x4": (36.0, 4.0, "round"),
    "DIN 3771 36 x 3.55": (36.0, 3.55, None),
    "DIN 3771 36 x 3,55": (36.0, 3.55, None),
    "ISO 3601-1 226A 50,39x3,53 N": (50.39, 3.53, None),
    "Ø36x4": METRIC,
    "Φ36\u00d74": METRIC,
    "ISO 3601-1A 36x4": METRIC,
    "DIN 3770 36x4": METRIC,
    "XR 36x4": (36.0, 4.0, "x_ring"),
    "X-ring 36x4": (36.0, 4.0, "x_ring"),
    "36 x 4 X-Ring": (36.0, 4.0, "x_ring"),
    "quad ring 36 x 4": (36.0, 4.0, "x_ring"),
}
DASH: dict[str, Kind | None] = {
    **dict.fromkeys(("AS568-210", "as568-210", "AS568A-210", "AS 568-210", "AS568 210")),
    **dict.fromkeys(("SAE AS568-210", "AS568 dash 210", "2-210", "-210", "210", "dash 210")),
    **dict.fromkeys(
        ("BS 210", "BS1806-210", "size 210", "No. 210", "#210", "Parker 2-210", "AS568\u2013210")
    ),
    **dict.fromkeys(("O-ring 210", "O-ring AS568-210", "OR 210"), "round"),
    **dict.fromkeys(
        ("X-ring AS568-210", "Q4210", "quad-ring 4210", "Quad-Ring® 4210", "quad ring 210"),
        "x_ring",
    ),
}
CUPS = ("U-cup 25x35x8", "u cup 25 x 35 x 8 mm", "25x35x8", "U-ring 25x35x8")
NO_RINGS = {
    "": "36x4",
    "36": "AS568-036",
    "4x36x": "36x4",
    "OR 36-4": "36x4",
    "36/4": "AS568-226",
    "ring 36 by 4": "36x4",
    "36x4 NBR 70": 'material = "NBR 70"; write "36x4"',
    "36x4 FKM": 'another key: material, polymer and hardness; write "36x4"',
    "D-ring 36x4": 'another key: section = "d_ring"; write "36x4"',
    "square ring 36x4": 'another key: section = "rectangular"; write "36x4"',
    "D-ring AS568-210": 'section = "d_ring"; write "AS568-210"',
    "O-Ring Ø36x4 NBR70": 'write "36x4"',
    "U-cup 25-35-8": 'write "U-cup 25x35x8"',
    "NI 25x35x8": 'write "U-cup 25x35x8"',
    "JIS B 2401 P-20": "size of JIS B 2401 (P20)",
    "Stepseal": "36x4",
    "P36": "JIS B 2401",
    "G 50": "JIS B 2401",
    "1 1/4 in x 1/8 in": "AS568-226",
    "quad ring": "36x4",
    "U-cup 25x5": "U-cup 25x35x8",
    "25x35x8x2": "AS568-226",
    "-36x4": 'write "36x4"',
    "AS568-2100": 'is no size of AS568, which have three digits; write "AS568-226"',
}
FITS = {
    "36 f7": (35.950, 35.975),
    "36f7": (35.950, 35.975),
    "36 mm f7": (35.950, 35.975),
    "Ø36 f7": (35.950, 35.975),
    "⌀ 36 f 7": (35.950, 35.975),
    "φ36 f7": (35.950, 35.975),
    "d36f7": (35.950, 35.975),
    "36 f7 (ISO 286)": (35.950, 35.975),
    "36 (-0.025/-0.05)": (35.950, 35.975),
    "35.95 to 35.975": (35.950, 35.975),
    "35.975 to 35.95": (35.950, 35.975),
    "35.95-35.975 mm": (35.950, 35.975),
    "36,0 f7": (35.950, 35.975),
    "36-f7": (35.950, 35.975),
    "36 f8": (35.936, 35.975),
    "36 h8": (35.961, 36.0),
    "36 h9": (35.938, 36.0),
    "36 e8": (35.911, 35.950),
    "36 d9": (35.858, 35.920),
    "36 g6": (35.975, 35.991),
    "36 js7": (35.9875, 36.0125),
    "18 f7": (17.966, 17.984),
    "18.1 f7": (18.059, 18.080),
    "500 f7": (499.869, 499.932),
    "36 -0.025/-0.050": (35.950, 35.975),
    "36 -0.05 / -0.025": (35.950, 35.975),
    "36 -0,025 -0,050": (35.950, 35.975),
    "36 0/-0.039": (35.961, 36.0),
    "36 +0/-0.039": (35.961, 36.0),
    "36 ±0.05": (35.95, 36.05),
    "36 +-0.05 mm": (35.95, 36.05),
    "36 +/- 0.05": (35.95, 36.05),
}
HOLES = {
    "40 H8": (40.0, 40.039),
    "40H8": (40.0, 40.039),
    "Ø 40 H8": (40.0, 40.039),
    "40 H7": (40.0, 40.025),
    "43 H9": (43.0, 43.062),
    "40 F7": (40.025, 40.050),
    "40 JS9": (39.969, 40.031),
    "40 +0.039/0": (40.0, 40.039),
    "40 0/+0.039": (40.0, 40.039),
}
NO_FITS = {
    "36 F7": '"36 F7" has the letter of a hole: a shaft has small letters; write "36 f7"',
    "36 k6": "36 ±0.05",
    "36 u8": "36 f7",
    "36 f4": "36 f7",
    "36 Js7": "36 js7",
    "600 f7": "600 ±0.05",
    "36 f7/H8": "36 f7",
    "36 H8/f7": "36 f7",
    "36 ±10": "36 ±0.05",
}
PLAIN = ("36 mm", "36", "0.036 m", "1.5 in")
OILS = {
    **dict.fromkeys(
        ("ISO VG 46", "iso vg 46", "VG 46", "VG46", "ISO-VG 46", "ISO VG46"), (46, None)
    ),
    **dict.fromkeys(
        (
            "HLP 46",
            "HLP46",
            "HLP-46",
            "HLPD 46",
            "HL 46",
            "HM 46",
            "CLP 46",
            "L-HM 46",
            "AW 46",
            "AW ISO 46",
        ),
        (46, None),
    ),
    **dict.fromkeys(("DIN 51524-2 HLP 46", "DIN 51524 HLP 46", "ISO 11158 HM 46"), (46, None)),
    **dict.fromkeys(("ISO HM 46", "HLP ISO VG 46", "HLP VG 46", "ISO 46"), (46, None)),
    **dict.fromkeys(("HVLP 46", "hvlp46", "HVLP ISO VG 46", "HVLP-D 46"), (46, 140.0)),
    **dict.fromkeys(("ISO VG 46 VI 140", "HLP 46, VI=140", "VG 46 (VI 140)"), (46, 140.0)),
}
FAHRENHEIT = "AW 46 at 122 F"
WARM = (
    FAHRENHEIT,
    "HLP 46 bei 50 °C",
    "HLP 46 (50 °C)",
    "HLP 46 at 50 degC",
    "ISO VG 46 @ 50°C",
    "VG 46, 50 C",
    "HLP 46 / 50 °C",
)
POINTS = (
    "46 cSt at 40 degC, 6.8 cSt at 100 degC",
    "46 cSt at 40 °C; 6.8 cSt at 100 °C",
    "46 mm2/s at 40 C and 6.8 mm2/s at 100 C",
    "46 mm²/s @ 40°C, 6,8 mm²/s @ 100°C",
    "46cSt 40C, 6.8cSt 100C",
    "46 cSt @ 104 F, 6.8 cSt @ 212 °F",
)
NO_OILS = {
    "oil": "ISO VG 46",
    "46": "ISO VG 46",
    "Tellus 46": "ISO VG 46",
    "Mobil DTE 25": "ISO VG of its data sheet",
    "SAE 30": "does not say its viscosity",
    "MIL-H-5606": "6.8 cSt at 100 degC",
    "Shell Tellus S2 M 68": "ISO VG 68",
    "46 cSt": "6.8 cSt at 100 degC",
    "46 cSt at 40 degC": "one viscosity says nothing of another temperature",
    "HV 46": "HVLP 46",
    "HEES 46": "data sheet",
    "HFC 46": "data sheet",
    "SAE 10W-40": "data sheet",
    "ATF": "data sheet",
    "water": "data sheet",
    "grease": "base oil",
    "NLGI 2": "base oil",
    "lithium grease NLGI 2": "base oil",
    "Klüber grease": "base oil",
    "46 cSt at 400 degC, 6.8 cSt at 100 degC": "out of range",
}
VISCOSITIES = (
    "100 cps",
    "100 mPa*s",
    "100 mPas",
    "100 mPa s",
    "100 mPa·s",
    "100 cP",
    "0.1 Pa s",
    "0,1 Pas",
)
RUBBERS = {
    **dict.fromkeys(("NBR 70", "NBR70", "nbr-70", "NBR 70 Shore A", "NBR 70 ShA"), ("NBR", 70.0)),
    **dict.fromkeys(("70 NBR", "70 Shore A NBR", "NBR Shore A 70", "NBR 70A"), ("NBR", 70.0)),
    **dict.fromkeys(("NBR 70 IRHD", "NBR, Shore A 70", "NBR 70°ShA", "nitrile 70"), ("NBR", 70.0)),
    **dict.fromkeys(("Buna-N 70", "Perbunan 70", "NBR/70"), ("NBR", 70.0)),
    **dict.fromkeys(("NBR 70°", "70NBR", "NBR 70 JIS A", "NBR 70 Hs"), ("NBR", 70.0)),
    **dict.fromkeys(("FKM 75", "FPM 75", "Viton 75", "FKM 75 Shore"), ("FKM", 75.0)),
    **dict.fromkeys(("EPDM 80", "EPDM80"), ("EPDM", 80.0)),
    **dict.fromkeys(("PU 95", "PUR 95", "TPU 95A", "AU 95", "Polyurethan 95"), ("PU", 95.0)),
    **dict.fromkeys(("HNBR 85", "H-NBR 85"), ("HNBR", 85.0)),
    **dict.fromkeys(("VMQ 60", "silicone 60"), ("VMQ", 60.0)),
    **dict.fromkeys(
        ("70 Shore A", "70 ShA", "70A", "Shore A 70", "70 sh", "Sh A 70", "Shore 70 A", "JIS A 70"),
        (None, 70.0),
    ),
    **dict.fromkeys(("70\u00b0", "70 IRHD", "70 deg Shore A"), (None, 70.0)),
}
NO_RUBBERS = {
    "NBR": "NBR 70",
    "polyurethane": "PU 95",
    "PU 58D": "Shore D",
    "58 Shore D": "Shore D",
    "NBR 700": "NBR 70",
    "NBR 5": "NBR 70",
    "PTFE": "cap_thickness",
    "rubber 70": "70 Shore A",
    "N70": 'short name; write "NBR 70"',
    "V75": 'write "FKM 75"',
    "EPDM 70 peroxide": 'write "EPDM 70"',
    "N0674-70": "70 Shore A",
    "XYZ-70": "FKM 75",
}
NO_NAMES = ("gent", "neo-hooke", "mooney-rivlin", "soft", "rubber")
FINISHES = {
    **dict.fromkeys(
        ("Ra 0.2", "Ra0.2", "Ra=0.2", "Ra 0,2", "ra 0.2 um", "Ra: 0.2 µm"), 0.2 * sqrt(pi / 2)
    ),
    **dict.fromkeys(
        ("0.2 um Ra", "Ra 200 nm", "Ra < 0.2 μm", "Ra max 0.2", "Ra ≤ 0.2"), 0.2 * sqrt(pi / 2)
    ),
    **dict.fromkeys(("Rq 0.25", "rms 0.25", "0.25 um rms", "Rq=0.25 µm"), 0.25),
}
NO_FINISHES = {
    "RMS 8": 'write the unit; write "Rq 8 um" or "Rq 8 uin"',
    "16 rms": "Rq 16 uin",
    "Ra 0.1 / Ra 0.4": "Ra 0.1 and Ra 0.4",
    "Rz 1": "Ra 0.2",
    "Rt 1": "Rq 0.25",
    "Rmax 1": "Ra",
    "N4": "Ra 0.2",
    "smooth": "0.25 um",
}


def test_two_hundred_spellings() -> None:
    texts: list[str] = [*RINGS, *DASH, *CUPS, *FITS, *HOLES, *OILS, *WARM, *POINTS, *VISCOSITIES]
    texts += [*RUBBERS, *FINISHES, *NO_RINGS, *NO_FITS, *NO_OILS, *NO_RUBBERS, *NO_FINISHES]
    assert len([*texts, *NO_NAMES, *PLAIN]) >= 200, len(texts)


@pytest.mark.parametrize("name", RINGS)
def test_metric_rings(name: str) -> None:
    found = read_ring(name)
    assert (found.inner, found.section, found.kind) == RINGS[name]


def test_rings_by_number() -> None:
    for name, kind in DASH.items():
        assert read_ring(name) == RingName(number=210, kind=kind), name


def test_u_cups_by_their_groove() -> None:
    for name in CUPS:
        found = RingName(inner=25.0, kind="u_cup", outer=35.0, width=8.0)
        assert read_ring(name) == found, name


def test_shafts_and_holes_with_limits() -> None:
    for names, hole in ((FITS, False), (HOLES, True)):
        for name, (low, high) in names.items():
            found = read_fit("rod", name, hole=hole)
            assert found is not None, name
            assert (found.low, found.high) == pytest.approx((low, high), abs=1e-9), name
            assert found.middle == pytest.approx(0.5 * (low + high))
            assert found.half == pytest.approx(0.5 * (high - low))


def test_a_size_without_limits_is_left_to_units() -> None:
    assert [read_fit("rod", text) for text in PLAIN] == [None] * len(PLAIN)


def test_oils() -> None:
    for name, (grade, index) in OILS.items():
        found = read_oil_name(name)
        assert (found.grade, found.index, found.temperature) == (grade, index, None), name
    for name in WARM:
        assert (read_oil_name(name).grade, read_oil_name(name).temperature) == (46, 50.0), name
    for name in POINTS:
        assert read_oil_name(name).points == ((46.0, 40.0), (6.8, 100.0)), name
    for name in VISCOSITIES:
        assert dynamic(name) == pytest.approx(1e-7), name


def test_rubbers() -> None:
    for name, (polymer, shore) in RUBBERS.items():
        assert read_rubber("material", name) == RubberName(polymer, shore), name
    assert [read_rubber("material", name) for name in NO_NAMES] == [None] * len(NO_NAMES)


def test_finishes() -> None:
    for name, height in FINISHES.items():
        assert read_finish(name) == pytest.approx(height, rel=1e-5), name
    assert read_finish("0.25 um") is None


def test_what_is_not_understood_is_answered_with_what_is() -> None:
    readers = (
        (NO_RINGS, read_ring),
        (NO_FITS, lambda text: read_fit("rod", text)),
        (NO_OILS, read_oil_name),
        (NO_RUBBERS, lambda text: read_rubber("material", text)),
        (NO_FINISHES, read_finish),
    )
    for names, read in readers:
        for name, says in names.items():
            with pytest.raises(NotUnderstoodError) as caught:
                read(name)
            assert says in str(caught.value), name
            assert "\n" not in str(caught.value)


def _read_finishes(text: str) -> list[float | None]:
    return [read_finish(part) for part in text.split(" and ")]


@pytest.mark.parametrize(
    ("names", "read"),
    [(NO_RINGS, read_ring), (NO_OILS, read_oil_name), (NO_FINISHES, _read_finishes)],
)
def test_the_forms_of_a_refusal_are_read(names: dict[str, str], read: object) -> None:
    assert callable(read)
    for name in names:
        with pytest.raises(NotUnderstoodError) as caught:
            read(name)
        forms = str(caught.value).rpartition("; write ")[2]
        for form in re.findall(r'"([^"]+)"', forms):
            read(form)


def test_the_tables_follow_the_formulas_of_iso_286() -> None:
    """i = 0.45 D^(1/3) + 0.001 D and deviations as powers of D, before the standard's rounding."""
    times = {5: 7, 6: 10, 7: 16, 8: 25, 9: 40, 10: 64, 11: 100, 12: 160}
    powers = {"d": (16.0, 0.44), "e": (11.0, 0.41), "f": (5.5, 0.41), "g": (2.5, 0.34)}
    for step in range(1, len(STEPS)):  # the standard rounds up to 3 mm
        D = sqrt(STEPS[step - 1] * STEPS[step])
        unit = 0.45 * D ** (1 / 3) + 0.001 * D
        for grade, factor in times.items():
            assert GRADES[grade][step] == pytest.approx(factor * unit, rel=0.05, abs=1.5), (
                grade,
                D,
            )
        for letter, (most, power) in powers.items():
            assert DEVIATIONS[letter][step] == pytest.approx(most * D**power, rel=0.03, abs=1.0)


def test_published_limits() -> None:
    """Of common fits in handbooks, um."""
    for (size, letter, grade), (low, high) in {
        (10.0, "f", 7): (-28, -13),
        (25.0, "g", 6): (-20, -7),
        (50.0, "h", 6): (-16, 0),
        (80.0, "e", 8): (-106, -60),
        (100.0, "f", 7): (-71, -36),
        (200.0, "d", 9): (-285, -170),
        (63.0, "H", 8): (0, 46),
        (100.0, "H", 7): (0, 35),
        (320.0, "H", 9): (0, 140),
        (50.0, "E", 8): (50, 89),
    }.items():
        found = band(size, letter, grade)
        assert (found.low - size, found.high - size) == pytest.approx((1e-3 * low, 1e-3 * high))
