"""The tables of sensitivities and tolerances of a run, and the tornado picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from softehl.cases.harness.pictures import save
from softehl.cases.harness.row import Record
from softehl.cases.seal.gland.tolerances import ToleranceRow, band, read_tolerances
from softehl.cases.seal.report import style
from softehl.cases.seal.states.sensitivity_table import SensitivityRow
from softehl.cases.seal.states.state import FilmRow
from softehl.runtime.io import read_csv, write_csv

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from softehl.cases.seal.gland.parameters import Seal

PANELS = {"h_star": "film thickness $h^*$", "friction": "friction", "leakage": "leakage"}
"""Quantities of the picture, and what they are called in it."""

_SHOWN = 10  # parameters
_TOLD = 3  # of them on the terminal
_TICKS = (-10.0, -1.0, 0.0, 1.0, 10.0)  # % for 1 %, on an axis that is linear within 0.1
Table = dict[float, dict[str, dict[str, float]]]


def write_sensitivities(
    p: Seal, folder: Path, rows: Sequence[FilmRow], kinds: Sequence[str]
) -> None:
    """Join the sensitivities of the states into `sensitivity.csv`; tolerances; the picture.

    kinds: of the files of the picture. Raises OSError, ValueError.
    """
    parts = [folder / f"sensitivity_{row.name}.csv" for row in rows]
    header = SensitivityRow.header()
    cells = [line for part in parts if part.exists() for line in read_csv(part, header)]
    if not cells:
        return
    write_csv(folder / "sensitivity.csv", header, cells)
    table: Table = {}
    for row in map(SensitivityRow.parse, cells):
        quantity = table.setdefault(row.rod_speed_mm_s, {}).setdefault(row.quantity, {})
        quantity[row.parameter] = row.log_derivative
    shares = read_tolerances(p)
    if shares:
        bands = [
            band((p.sealed_pressure, speed), name, slopes, shares)
            for speed, found in table.items()
            for name, slopes in found.items()
        ]
        write_csv(folder / "tolerances.csv", bands[0].header(), [b.cells() for b in bands])
    if not kinds:
        return
    import matplotlib

    with matplotlib.rc_context(style.STYLE):
        save(tornado_figure(style.subject(p), table), folder / "tornado", kinds)


def told(folder: Path) -> list[str]:
    """A line for each speed: the effect of tolerances, and the keys that matter most."""
    bands = [ToleranceRow.parse(c) for c in _cells(folder / "tolerances.csv", ToleranceRow)]
    slopes = [SensitivityRow.parse(c) for c in _cells(folder / "sensitivity.csv", SensitivityRow)]
    lines = []
    for speed in dict.fromkeys(row.rod_speed_mm_s for row in slopes):
        words = [
            f"{_called(b.quantity)} {b.likely_percent:.2g} % (at worst {b.worst_percent:.2g} %, "
            f"most of it {b.largest})"
            for b in bands
            if b.rod_speed_mm_s == speed and b.quantity in PANELS
        ]
        if words:
            lines.append(f"  {speed:+g} mm/s, likely changes by tolerances: {'; '.join(words)}")
        words = []
        for quantity in PANELS:
            own = [r for r in slopes if (r.rod_speed_mm_s, r.quantity) == (speed, quantity)]
            own.sort(key=lambda r: -abs(r.log_derivative))
            most = (f"{r.parameter} {r.log_derivative:+.2g} %" for r in own[:_TOLD])
            words.append(f"{_called(quantity)}: {', '.join(most)}")
        lines.append(f"  {speed:+g} mm/s, for 1 % of a key: {'; '.join(words)}")
    return lines


def _called(quantity: str) -> str:
    """A quantity in plain text."""
    return "h*" if quantity == "h_star" else quantity


def _cells(path: Path, kind: type[Record]) -> list[list[str]]:
    return read_csv(path, kind.header()) if path.exists() else []


def tornado_figure(head: str, table: Table) -> Figure:
    """Bars: per cent of each quantity for one per cent of a parameter, at the slowest speeds."""
    from matplotlib.figure import Figure

    shown = [
        max((u for u in table if u * s > 0.0), key=lambda u: -abs(u), default=None)
        for s in (1.0, -1.0)
    ]
    speeds = [u for u in shown if u is not None]
    figure = Figure(figsize=(3.3 * len(PANELS) + 1.2, 4.2))
    panels = figure.subplots(1, len(PANELS), squeeze=False)[0]
    for axes, (quantity, title) in zip(panels, PANELS.items(), strict=True):
        slopes = [table[u][quantity] for u in speeds]
        names = sorted(slopes[0], key=lambda n: max(abs(s[n]) for s in slopes))[-_SHOWN:]
        height = 0.8 / len(speeds)
        for k, (u, values) in enumerate(zip(speeds, slopes, strict=True)):
            stroke = "out" if u > 0.0 else "in"
            places = [i + height * (0.5 * (len(speeds) - 1) - k) for i in range(len(names))]
            axes.barh(
                places,
                [values[n] for n in names],
                height,
                color=style.COLOURS[stroke],
                label=f"{style.STROKES[stroke]} {abs(u):g} mm/s",
            )
        axes.set_yticks(range(len(names)), [n.replace("_", " ") for n in names])
        axes.set_xscale("symlog", linthresh=0.1)
        axes.set_xticks(_TICKS, [f"{t:g}" for t in _TICKS])
        axes.minorticks_off()
        axes.set_xlabel("% for 1 % of the parameter")
        axes.set_title(title)
        axes.axvline(0.0, color="0.2", linewidth=0.8)
    handles, labels = panels[-1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper right")  # above the panels, where no bar is
    style.write_head(figure, head, 0.3)
    style.set_margins(figure, 1.45, 0.15, 0.5, 0.85, 0.75)
    return figure
