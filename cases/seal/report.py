"""The curve as a table on the terminal, and the plots of a run (PNG, SVG), the same every time."""

from collections.abc import Callable, Iterator, Sequence
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table
from rich.text import Text

from softehl.cases.harness.curve import CurveRow
from softehl.cases.harness.observer import OK, Profile
from softehl.runtime.arrays import Array
from softehl.runtime.io import replacing

if TYPE_CHECKING:  # imported late: matplotlib is slow to import
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Results = Sequence[tuple[CurveRow, Profile]]

_STYLE: Any = {
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": "medium",
    "figure.constrained_layout.use": True,
    "font.size": 9,
    "grid.alpha": 0.35,
    "grid.linewidth": 0.5,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "savefig.dpi": 160,
    "svg.hashsalt": "softehl",
}
_STROKES = {"out": "outstroke", "in": "instroke"}
_COLOURS = {"out": "#1b6ca8", "in": "#c8553d"}
_MARKERS = {"out": "o", "in": "s"}
_MARGIN_MM = 0.3
_TABLE_WIDTH = 110

_COLUMNS: tuple[tuple[str, str, Callable[[CurveRow], str]], ...] = (
    ("U", "mm/s", lambda row: f"{row.rod_speed_mm_s:+g}"),
    ("h*", "um", lambda row: f"{row.h_star_um:.4g}"),
    ("error", "%", lambda row: _known(row.h_star_error_percent)),
    ("h min", "um", lambda row: f"{row.h_min_um:.4g}"),
    ("p max", "MPa", lambda row: f"{row.p_max_MPa:.4f}"),
    ("friction", "N", lambda row: f"{row.rod_friction_N:.4g}"),
    ("leak", "mm3/s", lambda row: f"{row.leak_rate_mm3_s:.4g}"),
    ("contact", "mm", lambda row: f"{row.contact_start_mm:.2f} {row.contact_end_mm:+.2f}"),
    ("Newton", "", lambda row: str(row.newton_iterations)),
)


def curve_table(rows: Sequence[CurveRow], rejected: Sequence[CurveRow] = ()) -> Table:
    """The curve as a table; a rejected state is flagged and shows no number but its speed."""
    ordered = sorted([*rows, *rejected], key=lambda row: row.order)
    pressure = f", p_s = {ordered[0].sealed_pressure_MPa:g} MPa" if ordered else ""
    table = Table(
        title=Text(f"Film thickness{pressure}"), box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False
    )
    for name, unit, _ in _COLUMNS:
        table.add_column(Text(f"{name}\n{unit}"), justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    for row in ordered:
        texts = [text(row) for _, _, text in _COLUMNS]
        if not row.usable:
            texts = [texts[0], *("-" for _ in texts[1:])]
        verdict = row.verdict if row.usable else row.verdict.upper()
        style = None if row.verdict == OK else ("yellow" if row.usable else "bold red")
        table.add_row(*(Text(text) for text in [*texts, verdict]), style=style)
    return table


def _known(percent: float) -> str:
    return "" if isnan(percent) else f"{percent:+.2f}"


def print_curve(rows: Sequence[CurveRow], rejected: Sequence[CurveRow] = ()) -> None:
    """Print the table to stdout, at full width where stdout is not a terminal."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=_TABLE_WIDTH)
    console.print(curve_table(rows, rejected))


def write_plots(folder: Path, results: Results) -> None:
    """Write profiles.png/.svg and curve.png/.svg for the usable states; none if there are none."""
    if not results:
        return
    import matplotlib

    with matplotlib.rc_context(_STYLE):
        _save(_profiles_figure(results), folder / "profiles")
        _save(_curve_figure([row for row, _ in results]), folder / "curve")


def _save(figure: "Figure", stem: Path) -> None:
    for kind, metadata in (("png", None), ("svg", {"Date": None})):
        with replacing(stem.with_suffix(f".{kind}")) as temporary:
            figure.savefig(temporary, format=kind, metadata=metadata)


def _profiles_figure(results: Results) -> "Figure":
    """Pressure above film thickness, a column a stroke, a line a speed."""
    from matplotlib.figure import Figure

    strokes = [stroke for stroke in _STROKES if any(row.stroke == stroke for row, _ in results)]
    figure = Figure(figsize=(4.2 * len(strokes) + 0.6, 5.6))
    axes = figure.subplots(2, len(strokes), sharex=True, sharey="row", squeeze=False)
    for column, stroke in enumerate(strokes):
        pressure, film = axes[0, column], axes[1, column]
        for row, profile, colour in _coloured(results, stroke):
            label = f"{abs(row.rod_speed_mm_s):g}"
            pressure.plot(profile.x_mm, profile.p_MPa, color=colour, label=label)
            film.plot(profile.x_mm, profile.h_um, color=colour)
        pressure.set_title(f"{_STROKES[stroke]}, $p_s$ = {results[0][0].sealed_pressure_MPa:g} MPa")
        pressure.legend(title="|U| [mm/s]", fontsize="small", title_fontsize="small")
        film.set_xlabel("x [mm]   (sealed side left, air side right)")
    axes[0, 0].set_ylabel("pressure p [MPa]")
    axes[1, 0].set_ylabel("film thickness h [um]")
    _zoom(axes[1, 0], results)
    return figure


def _coloured(
    results: Results, stroke: str
) -> Iterator[tuple[CurveRow, Profile, tuple[float, float, float, float]]]:
    """The states of a stroke; a speed has one colour for both strokes, dark fast, light slow."""
    from matplotlib import colormaps

    speeds = sorted({abs(row.rod_speed_mm_s) for row, _ in results}, reverse=True)
    shades = dict(zip(speeds, np.linspace(0.05, 0.85, len(speeds)).tolist(), strict=True))
    for row, profile in results:
        if row.stroke == stroke:
            yield row, profile, colormaps["viridis"](shades[abs(row.rod_speed_mm_s)])


def _zoom(film: "Axes", results: Results) -> None:
    """Show the contact and the thin film only: beside it h is a hundred times larger."""
    rows = [row for row, _ in results]
    start = min(row.contact_start_mm for row in rows)
    end = max(row.contact_end_mm for row in rows)
    if np.isfinite(start) and np.isfinite(end):
        film.set_xlim(start - _MARGIN_MM, end + _MARGIN_MM)
    film.set_yscale("log")
    film.yaxis.set_major_formatter("{x:g}")
    low = min(row.h_min_um for row in rows)
    high = max(row.h_star_um for row in rows)
    if 0 < low < high:
        film.set_ylim(0.7 * low, 20 * high)


def _curve_figure(rows: Sequence[CurveRow]) -> "Figure":
    """h* over |U|, both logarithmic, a line a stroke, and the slope 1/2 beside them."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogFormatter

    figure = Figure(figsize=(5.0, 4.0))
    axes = figure.subplots()
    for stroke, name in _STROKES.items():
        chosen = [row for row in rows if row.stroke == stroke]
        speed, film = _columns(chosen)
        if len(chosen):
            axes.loglog(speed, film, color=_COLOURS[stroke], marker=_MARKERS[stroke], label=name)
    speed, film = _columns(rows)
    top = speed.argmax()
    slope = 1.25 * film[top] * np.sqrt(speed / speed[top])
    axes.loglog(speed, slope, color="0.55", linestyle="--", linewidth=1, label="slope 1/2")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(LogFormatter(minor_thresholds=(2, 0.5)))
    axes.set_xlabel("rod speed |U| [mm/s]")
    axes.set_ylabel("film thickness h* = q/u [um]")
    axes.set_title(f"O-ring, $p_s$ = {rows[0].sealed_pressure_MPa:g} MPa")
    axes.legend()
    return figure


def _columns(rows: Sequence[CurveRow]) -> tuple[Array, Array]:
    """|U| and h* of the rows, by rising speed: two arrays (n,)."""
    ordered = sorted(rows, key=lambda row: abs(row.rod_speed_mm_s))
    return (
        np.array([abs(row.rod_speed_mm_s) for row in ordered]),
        np.array([row.h_star_um for row in ordered]),
    )
