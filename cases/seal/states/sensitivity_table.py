"""`sensitivity.csv`: its rows, and which states have any."""

from collections.abc import Mapping
from dataclasses import dataclass

from softehl.cases.harness.row import OK, Record, column
from softehl.cases.seal.states.state import FilmRow
from softehl.cases.seal.states.verdict import shows_inlet


@dataclass(frozen=True)
class SensitivityRow(Record):
    """One row of `sensitivity.csv`."""

    sealed_pressure_MPa: float = column("MPa", "sealed pressure p_s")
    rod_speed_mm_s: float = column("mm/s", "rod speed U, + = outstroke (to the air side)")
    quantity: str = column(
        "",
        "`h_star`, `friction`, `leakage`, `p_max` or `contact_width` (that of `curve.csv`)",
    )
    parameter: str = column("", "a key of the case, or `U`")
    log_derivative: float = column(
        "", "d log quantity / d log parameter: per cent for one per cent"
    )


def differentiable(row: FilmRow) -> bool:
    """True if a state has derivatives: its arc holds the whole inlet, and the mesh shows it.

    The pressure that oil builds up before an arc is held while a film is solved.
    """
    return resolved(row) and row.entrance_pressure_MPa == 0.0


def resolved(row: FilmRow) -> bool:
    """True if the mesh shows the film well enough to differentiate it.

    Stricter than the verdict: uniform meshes, too, must show the slope of the inlet.
    """
    return row.verdict == OK and shows_inlet(row.inlet_ratio)


def rows_of(row: FilmRow, sensitivities: Mapping[str, Mapping[str, float]]) -> list[SensitivityRow]:
    """The lines of a state in `sensitivity.csv`."""
    return [
        SensitivityRow(
            sealed_pressure_MPa=row.sealed_pressure_MPa,
            rod_speed_mm_s=row.rod_speed_mm_s,
            quantity=quantity,
            parameter=name,
            log_derivative=slope,
        )
        for quantity, log_derivatives in sensitivities.items()
        for name, slope in log_derivatives.items()
    ]
