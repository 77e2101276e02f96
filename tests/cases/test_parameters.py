"""Keys of cases: texts, units, columns, what is refused."""

from __future__ import annotations

import json
from dataclasses import dataclass
from inspect import get_annotations
from math import nan
from pathlib import Path
from typing import Any, Literal

import pytest

from softehl.cases.cycle import Cycle
from softehl.cases.harness.case import Case
from softehl.cases.harness.case_file import read_assignment, read_case
from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.parameters import Nonzeros, Parameters, key, keys_of
from softehl.cases.harness.row import OK, Row, column
from softehl.cases.harness.units import is_quantity, read_quantity
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.states.state import FilmRow
from softehl.cases.shipped import SHIPPED
from softehl.cases.slider.case import Slider
from tests.cases.test_report import row as film_row

# --- The parameter set of the O-ring: Table 1, limits, case files and `--set` ---------------------


TABLE_1 = {
    "inner_diameter": 50.39,
    "section_diameter": 3.53,
    "rod_diameter": 50.0,
    "housing_diameter": 56.30,
    "mu_1": 3.04,
    "mu_2": 0.62,
    "bulk_modulus": 500.0,
    "viscosity": 6.59e-8,
    "pressure_viscosity": 0.02,
    "cavitation_penalty": 1.0e4,
}


def test_a_key_is_declared_by_one_record() -> None:
    """A second one would hide the first without a word."""
    declared = [k for kind in Seal.__mro__ for k in get_annotations(kind)]
    assert [k for k in Seal.model_fields if declared.count(k) != 1] == []


def test_defaults_are_table_1() -> None:
    parameters = Seal()
    assert {key: getattr(parameters, key) for key in TABLE_1} == TABLE_1
    assert (parameters.density, parameters.pressure_order, parameters.solid) == (
        2,
        4,
        "taylor_mean",
    )
    assert parameters.speeds == (1600.0, 800.0, 400.0, 200.0, 100.0)
    assert (parameters.stroke, parameters.sealed_pressure) == ("both", 1.0)


def test_an_integer_is_a_number() -> None:
    parameters = Seal(sealed_pressure=2, speeds=(400, 100))
    assert repr(parameters.sealed_pressure) == "2.0"
    assert repr(parameters.speeds) == "(400.0, 100.0)"


@pytest.mark.parametrize(
    ("key", "value", "listed"),
    [
        ("speeds", 400, (400.0,)),
        ("speeds", "0.4 m/s", (400.0,)),
        ("tolerances", "viscosity 10 %", ("viscosity 10 %",)),
    ],
)
def test_one_value_is_a_list_of_one(key: str, value: Any, listed: tuple[Any, ...]) -> None:
    for given in (value, [value]):
        values: dict[str, Any] = {"sensitivity": True, key: given}
        assert getattr(Seal(**values), key) == listed


def test_one_term_of_ogden_is_a_list_of_one() -> None:
    values: dict[str, Any] = {"material": "ogden", "ogden_mu": 1.2, "ogden_alpha": 2}
    ring = Seal(**values)
    assert (ring.ogden_mu, ring.ogden_alpha) == ((1.2,), (2.0,))


@pytest.mark.parametrize(
    ("key", "text", "value"),
    [
        ("sealed_pressure", "5", 5.0),
        ("sealed_pressure", " 5.5 ", 5.5),
        ("sealed_pressure", "5,5", 5.5),
        ("viscosity", "6,59e-8", 6.59e-8),
        ("temperature", "-5", -5.0),
        ("tolerance", "0,2", 0.2),
        ("density", "4", 4),
        ("quadrature_points", "7", 7),
        ("speeds", "5", (5.0,)),
        ("speeds", ["100", "25"], (100.0, 25.0)),
        ("speeds", "400,100", (400.0, 100.0)),
        ("groove_width", "5,2", 5.2),
    ],
)
def test_the_text_of_a_number_is_this_number(key: str, text: Any, value: object) -> None:
    given = {key: text} | ({"oil": "HLP 46"} if key == "temperature" else {})
    found = getattr(Seal.model_validate(given), key)
    assert (type(found), found) == (type(value), value)


def test_a_decimal_comma_in_what_is_typed() -> None:
    given = ["sealed_pressure=5,5", "ring=18x2,65", "rod=19,05", "gland=hydraulic"]
    p = read_case("oring", SHIPPED, given, {"tolerance": "0,2 "}).parameters
    assert isinstance(p, Seal)
    assert (p.sealed_pressure, p.rod_diameter, p.tolerance) == (5.5, 19.05, 0.2)
    for name, text, says in (
        ("speeds", "0,2", r'speeds = "0,2": write a number as 0.2, a list as \[0, 2\]'),
        ("speeds", "5,5", r"write a number as 5.5, a list as \[5, 5\]"),
        ("roughness", "0,2", r"write a number as 0.2, a list as \[0, 2\]"),
        ("sealed_pressure", "1,600", 'sealed_pressure: "1,600" is 1.600 or 1600; write one'),
        ("sealed_pressure", '"-5"', r'sealed_pressure = "-5": input should be greater .* 0'),
    ):
        with pytest.raises(BadInput, match=says):
            read_case("oring", SHIPPED, [f"{name}={text}"])


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("a=1", 1),
        ("a = 1.5", 1.5),
        ("a=true", True),
        ("a=in", "in"),
        ('a="in"', "in"),
        ("a=[400, 100]", [400, 100]),
        ("a=400, 100", [400, 100]),
        ("a=400,", [400]),
        ("a=5,5", "5,5"),
        ("a=19,05", "19,05"),
        ("a=0.1,0.4", [0.1, 0.4]),
        ("a=rod_diameter 0.05 mm", "rod_diameter 0.05 mm"),
        ("a=viscosity 10 %", "viscosity 10 %"),
        ("a=x=1", None),
        ("a=", None),
        ("a", None),
        ("=1", None),
        ("a=1\nb=2", None),
        ("a=1 2", None),
    ],
)
def test_assignment(text: str, value: object) -> None:
    if value is None:
        with pytest.raises(BadInput):
            read_assignment(text)
    else:
        assert read_assignment(text) == ("a", value)


def test_case_file_and_set(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('case = "oring"\ndensity = 4\nspeeds = [800, 25]\nstroke = "in"\n')
    run = read_case(str(path), SHIPPED, ["stroke=both", "stroke=both"])
    assert run.case.name == "oring"
    assert run.parameters == Seal(density=4, speeds=(800.0, 25.0), stroke="both")


def test_a_key_is_set_once() -> None:
    with pytest.raises(BadInput, match='--set stroke: "out" and "both"; allowed: one of them'):
        read_case("oring", SHIPPED, ["stroke=out", "stroke=both"])
    with pytest.raises(BadInput, match=r"--rod rod: 20 and 19; allowed: one of them"):
        read_case("oring", SHIPPED, ["rod=20"], {"rod": "19"})


# --- Numbers with units, as they are typed --------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("30 bar", "MPa", 3.0),
        ("435.113 psi", "MPa", 3.0),
        ("435.113 PSI", "MPa", 3.0),
        ("30 Bar", "MPa", 3.0),
        ("3,0 Mpa", "MPa", 3.0),
        ("3 mpa", "MPa", 3.0),
        ("3E3 KPA", "MPa", 3.0),
        ("30.5914865 kgf/cm²", "MPa", 3.0),
        ("122 °F", "degC", 50.0),
        ('2"', "mm", 50.8),
        ("0.2 m/s", "mm/s", 200.0),
        ("12 m/min", "mm/s", 200.0),
        ("12 %", "%", 12.0),
        ("12%", "%", 12.0),
        ("40 mPa s", "MPa s", 4e-8),
        ("40 cP", "MPa s", 4e-8),
        ("2 in", "mm", 50.8),
        ("3/4 in", "mm", 19.05),
        ('1-3/8"', "mm", 34.925),
        ("-30 deg", "degrees", -30.0),
        ("1e3 kPa", "MPa", 1.0),
        ("20 1/GPa", "1/MPa", 0.02),
        ("2 Hz", "1/s", 2.0),
        ("200 nm", "um", 0.2),
    ],
)
def test_quantities(text: str, unit: str, value: float) -> None:
    assert is_quantity(text)
    assert read_quantity(text, unit) == pytest.approx(value, rel=1e-5)


@pytest.mark.parametrize("text", ["AS568-226", "out", "12", "1,600 kPa", "1e-3", "", "-226", "bar"])
def test_other_texts_are_no_quantities(text: str) -> None:
    assert not is_quantity(text)


def test_a_wrong_unit_names_those_that_fit() -> None:
    with pytest.raises(ValueError, match='"3 mm" is not a number in MPa; allowed units: MPa, GPa'):
        read_quantity("3 mm", "MPa")
    for text, unit in (("3 mPa", "MPa"), ("40 mpa s", "MPa s"), ("40 MPAS", "MPa s")):
        with pytest.raises(ValueError, match="is not a number in MPa"):
            read_quantity(text, unit)
    with pytest.raises(ValueError, match="allowed units: degC, °C, C, F, degF"):
        read_quantity("350 K", "degC")
    with pytest.raises(ValueError, match="is a kinematic viscosity"):
        read_quantity("46 cSt", "MPa s")


def test_a_case_takes_them_in_every_key_with_a_unit() -> None:
    case = Seal(sealed_pressure="30 bar", speeds=["0.2 m/s", 100], viscosity="40 mPa s")  # type: ignore[arg-type]
    assert case.sealed_pressure == pytest.approx(3.0)
    assert case.speeds == (200.0, 100.0)
    assert case.viscosity == pytest.approx(4e-8)
    with pytest.raises(ValueError, match=r"sealed_pressure: .* is not a number in MPa"):
        Seal(sealed_pressure="30 mm")  # type: ignore[arg-type]


def test_what_is_typed_without_quotation_marks_reaches_its_key() -> None:
    for text in ("36 \u00d7 4", "#210", '1.5"', "36 (-0.025/-0.05)", "Ra=0.2", "Ra ≤ 0.2"):
        assert read_assignment(f"key={text}") == ("key", text)
    assert read_assignment("speeds=[0.4 m/s, 100 mm/s]")[1] == ["0.4 m/s", "100 mm/s"]


# --- What follows from the declaration of columns and keys: files, terminal, documentation --------


@dataclass(frozen=True)
class Fall(Row):
    """A made-up row: a stone that falls."""

    files = ("path_{}.csv",)
    height_m: float = column("m", "height", head="H", number_format="g")
    start_s: float = column("s", "when it is let go", head="time", number_format=".1f")
    end_s: float = column("s", "when it is there", head="time", number_format="+.1f")
    bounces: int = column("", "how often it is thrown back | or not")
    verdict: str = column("", "`ok`")


class Stone(Parameters):
    """Keys of every kind."""

    heights: Nonzeros = key((2.0, 1.0), "heights", unit="m")
    hard: bool = key(True, "whether it is")
    kind: Literal["round", "flat", "sharp"] = key("flat", "its shape")
    mass: float = key(1.0, "mass", unit="kg", gt=0, le=5)
    name: str | None = key(None, "its name", bounds="left out = none")


class Falls(Case[Stone, Fall]):
    """A made-up case."""

    name, title, parameters, row, list_key = "fall", "stones that fall", Stone, Fall, "heights"


def test_a_row_is_read_back_as_it_was() -> None:
    rows = [Fall(2.0, 0.0, 0.639, 3, OK), Fall(-0.1, nan, 1e300, 0, "broken, or not")]
    for one in rows:
        again = Fall.parse([str(cell) for cell in one.cells()])
        assert repr(again) == repr(one)
        assert type(again.bounces) is int
    with pytest.raises(ValueError, match="could not convert"):
        Fall.parse(["high", "0", "0", "0", OK])
    with pytest.raises(ValueError, match="shorter"):
        Fall.parse(["1", "2"])


def test_key_names_and_order() -> None:
    rows = [Fall(height, 0.0, 0.6, 3, OK) for height in (-3.0, 1.5, 2.0)]
    assert [one.key for one in sorted(rows, key=lambda r: r.order)] == [2.0, 1.5, -3.0]
    assert rows[1].file_names() == ("path_1.5m.csv",)
    assert Fall.file_patterns() == ("path_*.csv",)
    assert (Fall.label(1.5), FilmRow.label(400.0)) == ("H = 1.5 m", "U = +400 mm/s")


def test_only_declared_fields_are_columns() -> None:
    """A state is a row with more; its columns are those of the row."""
    row = film_row(400.0, 1.3)
    assert FilmRow.part_of(row) == row
    assert len(FilmRow.header()) == len(row.as_dict())


def test_pieces_share_what_is_missing() -> None:
    stone, case = Stone(heights=(4.0, 3.0, 2.0, 1.0)), Falls()
    there = [Fall(3.0, 0.0, 0.0, 0, OK)]
    assert [p.heights for p in case.pieces(stone, there, 1)] == [(4.0, 2.0, 1.0)]
    assert [p.heights for p in case.pieces(stone, there, 2)] == [(4.0, 1.0), (2.0,)]
    everything = [Fall(h, 0.0, 0.0, 0, OK) for h in stone.heights]
    assert case.pieces(stone, everything, 2) == []


def test_bounds_come_from_limits_and_types() -> None:
    bounds = {one.name: one.bounds for one in keys_of(Stone)}
    assert bounds == {
        "heights": "a number or a list of different ones, none 0",
        "hard": "true or false",
        "kind": '"round", "flat" or "sharp"',
        "mass": "> 0 and <= 5",
        "name": "left out = none",
    }
    assert Stone.model_fields["mass"].description == "mass [kg]; > 0 and <= 5"


# --- Inputs that are refused: `refused.json` has each with the words of its message, in one line


REFUSED: dict[str, list[Any]] = json.loads(
    Path(__file__).with_name("refused.json").read_text(encoding="utf-8")
)
KEYS: dict[str, tuple[Any, ...]] = {
    "oring": (Seal,),
    "slider": (Slider,),
    "oring and slider": (Seal, Slider),
    "cycle": (lambda **given: Cycle.model_validate(Cycle.completed(given)),),
}


def assert_said(words: str | list[str], message: str) -> None:
    """Whether a message has all of the words."""
    missing = [
        word for word in ([words] if isinstance(words, str) else words) if word not in message
    ]
    assert not missing, message


@pytest.mark.parametrize("case", KEYS)
def test_keys_that_are_refused(case: str) -> None:
    for given, words in REFUSED[case]:
        for make in KEYS[case]:
            with pytest.raises(ValueError) as caught:  # noqa: PT011
                make(**given)
            assert_said(words, str(caught.value))


def test_what_is_typed_and_refused() -> None:
    for case, assignments, words in REFUSED["typed"]:
        with pytest.raises(BadInput) as caught:
            read_case(case, SHIPPED, assignments)
        assert_said(words, str(caught.value))
        assert "\n" not in str(caught.value)
