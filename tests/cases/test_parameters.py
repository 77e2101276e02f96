"""The parameter set of the O-ring: Table 1, limits, case files and `--set`."""

from inspect import get_annotations
from pathlib import Path
from typing import Any

import pytest

from softehl.cases.harness.case_file import read_assignment, read_case
from softehl.cases.harness.errors import BadInput
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.shipped import SHIPPED

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
    for key, text, says in (
        ("speeds", "0,2", r'speeds = "0,2": write a number as 0.2, a list as \[0, 2\]'),
        ("speeds", "5,5", r"write a number as 5.5, a list as \[5, 5\]"),
        ("roughness", "0,2", r"write a number as 0.2, a list as \[0, 2\]"),
        ("sealed_pressure", "1,600", 'sealed_pressure: "1,600" is 1.600 or 1600; write one'),
        ("sealed_pressure", '"-5"', r'sealed_pressure = "-5": input should be greater .* 0'),
    ):
        with pytest.raises(BadInput, match=says):
            read_case("oring", SHIPPED, [f"{key}={text}"])


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
