"""Numbers with units, as they are typed."""

import pytest

from softehl.cases.harness.case_file import read_assignment
from softehl.cases.harness.units import is_quantity, read_quantity
from softehl.cases.seal.gland.parameters import Seal


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
