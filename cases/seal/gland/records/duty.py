"""The duty of a seal: sealed pressure and motion."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from softehl.cases.harness.parameters import Number, Parameters, different, key

Speed = Annotated[Number, Field(gt=0)]
Speeds = Annotated[tuple[Speed, ...], Field(min_length=1, strict=False), AfterValidator(different)]


class Duty(Parameters):
    """Sealed pressure, speeds and strokes."""

    sealed_pressure: float = key(
        1.0,
        "sealed pressure p_s",
        unit="MPa",
        bounds='0 to 100; "160 bar" may be written too',
        ge=0,
        le=100,
    )
    stroke: Literal["out", "in", "both"] = key(
        "both", "direction of the rod", bounds='"out" (to the air side), "in" or "both"'
    )
    speeds: Speeds = key(
        (1600.0, 800.0, 400.0, 200.0, 100.0),
        "rod speeds |U|",
        unit="mm/s",
        bounds="a number > 0, or a list of different ones in any order",
    )
    travel: float = key(100.0, "stroke length of the rod, for leakage in a cycle", unit="mm", gt=0)
