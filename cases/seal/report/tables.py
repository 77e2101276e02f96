"""Tables of a run beside its curve: the fit of its rubber, sensitivities, tolerances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.rubbers.rubber_fit import COLUMNS, RubberFit, fit, read_data
from softehl.cases.seal.gland.tolerances import ToleranceRow, band, read_tolerances
from softehl.cases.seal.states.sensitivity_table import SensitivityRow
from softehl.cases.seal.states.state import FilmRow
from softehl.runtime.io import write_csv

SHOWN = ("h_star", "friction", "leakage")
"""Quantities of the terminal and of the picture."""

Slopes = Mapping[tuple[float, str], Mapping[str, float]]
"""Rod speed (mm/s) and quantity -> parameter -> log derivative."""


def fit_of(p: Seal) -> RubberFit | None:
    """The fit that a rubber was taken from.  Raises ValueError where it cannot be read."""
    if p.fit is None:
        return None
    return fit(p.material, read_data(Path(p.fit)), p.ogden_terms, p.temperature)


def write_fit(p: Seal, folder: Path) -> None:
    """The points of the tests with the stresses of the model there.  OSError, ValueError."""
    if result := fit_of(p):
        data, model = result.data, result.model
        numbers = np.stack([data.stretch, data.stress, model, model - data.stress], axis=1)
        rows = [(t, *row) for t, row in zip(data.test.tolist(), numbers.tolist(), strict=True)]
        write_csv(folder / "fit.csv", (*COLUMNS, "model_MPa", "difference_MPa"), rows)


def read_slopes(p: Seal, folder: Path) -> Slopes:
    """The sensitivities of a run, parameters in the words of its seal; none where it has no table
    of them.  OSError, ValueError.
    """
    rows_read = _log_derivatives(SensitivityRow.read(folder / "sensitivity.csv"))
    return {at: {_named(p, key): s for key, s in of.items()} for at, of in rows_read.items()}


def write_sensitivities(p: Seal, folder: Path, rows: Sequence[FilmRow]) -> None:
    """Join those of the states into `sensitivity.csv`; tolerances.  Raises OSError, ValueError."""
    states = [SensitivityRow.read(folder / f"sensitivity_{row.name}.csv") for row in rows]
    rows_read = [line for lines in states for line in lines]
    if not rows_read:
        return
    write_csv(folder / "sensitivity.csv", SensitivityRow.header(), [r.cells() for r in rows_read])
    if tolerances := read_tolerances(p):
        bands = [
            band((p.sealed_pressure, speed), quantity, log_derivatives, tolerances)
            for (speed, quantity), log_derivatives in _log_derivatives(rows_read).items()
        ]
        write_csv(folder / "tolerances.csv", ToleranceRow.header(), [b.cells() for b in bands])


def sensitivity_lines(p: Seal, folder: Path) -> list[str]:
    """A line for each speed: the effect of tolerances, and the three keys that matter most."""
    bands, log_derivatives = ToleranceRow.read(folder / "tolerances.csv"), read_slopes(p, folder)
    lines = []
    for speed in dict.fromkeys(speed for speed, _ in log_derivatives):
        texts = [
            f"{_called(b.quantity)} {b.likely_percent:.2g} % (at worst {b.worst_percent:.2g} %, "
            f"most of it {b.largest})"
            for b in bands
            if b.rod_speed_mm_s == speed and b.quantity in SHOWN
        ]
        if texts:
            lines.append(f"  {speed:+g} mm/s, likely changes by tolerances: {'; '.join(texts)}")
        texts = []
        for quantity in SHOWN:
            largest = sorted(
                log_derivatives[speed, quantity].items(), key=lambda item: -abs(item[1])
            )[:3]
            named = ", ".join(f"{name} {slope:+.2g} %" for name, slope in largest)
            texts.append(f"{_called(quantity)}: {named}")
        lines.append(f"  {speed:+g} mm/s, for 1 % of a key: {'; '.join(texts)}")
    return lines


def _named(p: Seal, key: str) -> str:
    """A parameter in plain text; a piston seal has an outside diameter in place of the inner."""
    of_piston = p.piston and key == "inner_diameter"
    return "outside diameter of the ring" if of_piston else p.called(key)


def _called(quantity: str) -> str:
    """A quantity in plain text."""
    return "h*" if quantity == "h_star" else quantity


def _log_derivatives(rows: Sequence[SensitivityRow]) -> Slopes:
    derivatives: dict[tuple[float, str], dict[str, float]] = {}
    for row in rows:
        of_one = derivatives.setdefault((row.rod_speed_mm_s, row.quantity), {})
        of_one[row.parameter] = row.log_derivative
    return derivatives
