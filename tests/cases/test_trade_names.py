"""Two hundred spellings of rings, fits, oils, rubbers and finishes: read right, or refused."""

from __future__ import annotations

import json
import re
from math import sqrt
from pathlib import Path
from typing import Any

import pytest

from softehl.cases.seal.gland.trade.finish_names import read_finish
from softehl.cases.seal.gland.trade.fit_names import DEVIATIONS, GRADES, STEPS, band, read_fit
from softehl.cases.seal.gland.trade.normalise_text import NotUnderstoodError
from softehl.cases.seal.gland.trade.oil_names import dynamic, read_oil_name
from softehl.cases.seal.gland.trade.ring_names import RingName, read_ring
from softehl.cases.seal.gland.trade.rubber_names import RubberName, read_rubber

DATA: dict[str, Any] = json.loads(
    Path(__file__).with_name("trade_names.json").read_text(encoding="utf-8")
)


def test_two_hundred_spellings() -> None:
    assert sum(map(len, DATA.values())) >= 200


@pytest.mark.parametrize("name", DATA["rings"])
def test_metric_rings(name: str) -> None:
    found = read_ring(name)
    assert [found.inner, found.section, found.kind] == DATA["rings"][name]


def test_rings_by_number() -> None:
    for name, kind in DATA["dash"].items():
        assert read_ring(name) == RingName(number=210, kind=kind), name


def test_u_cups_by_their_groove() -> None:
    for name in DATA["cups"]:
        found = RingName(inner=25.0, kind="u_cup", outer=35.0, width=8.0)
        assert read_ring(name) == found, name


def test_shafts_and_holes_with_limits() -> None:
    for names, hole in ((DATA["fits"], False), (DATA["holes"], True)):
        for name, (low, high) in names.items():
            found = read_fit("rod", name, hole=hole)
            assert found is not None, name
            assert (found.low, found.high) == pytest.approx((low, high), abs=1e-9), name
            assert found.middle == pytest.approx(0.5 * (low + high))
            assert found.half == pytest.approx(0.5 * (high - low))


def test_a_size_without_limits_is_left_to_units() -> None:
    assert [read_fit("rod", text) for text in DATA["plain"]] == [None] * len(DATA["plain"])


def test_oils() -> None:
    for name, (grade, index) in DATA["oils"].items():
        found = read_oil_name(name)
        assert (found.grade, found.index, found.temperature) == (grade, index, None), name
    for name in DATA["warm"]:
        assert (read_oil_name(name).grade, read_oil_name(name).temperature) == (46, 50.0), name
    for name in DATA["points"]:
        assert read_oil_name(name).points == ((46.0, 40.0), (6.8, 100.0)), name
    for name in DATA["viscosities"]:
        assert dynamic(name) == pytest.approx(1e-7), name


def test_rubbers() -> None:
    for name, (polymer, shore) in DATA["rubbers"].items():
        assert read_rubber("material", name) == RubberName(polymer, shore), name
    assert [read_rubber("material", name) for name in DATA["no_names"]] == [None] * len(
        DATA["no_names"]
    )


def test_finishes() -> None:
    for name, height in DATA["finishes"].items():
        assert read_finish(name) == pytest.approx(height, rel=1e-5), name
    assert read_finish("0.25 um") is None


def test_what_is_not_understood_is_answered_with_what_is() -> None:
    readers = (
        (DATA["no_rings"], read_ring),
        (DATA["no_fits"], lambda text: read_fit("rod", text)),
        (DATA["no_oils"], read_oil_name),
        (DATA["no_rubbers"], lambda text: read_rubber("material", text)),
        (DATA["no_finishes"], read_finish),
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
    [
        (DATA["no_rings"], read_ring),
        (DATA["no_oils"], read_oil_name),
        (DATA["no_finishes"], _read_finishes),
    ],
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
