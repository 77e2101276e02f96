"""The curve as a table on the terminal."""

from collections.abc import Callable, Sequence
from math import isnan

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table
from rich.text import Text

from softehl.cases.harness.curve import CurveRow
from softehl.cases.harness.observer import OK

_WIDTH = 110

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
        console = Console(width=_WIDTH)
    console.print(curve_table(rows, rejected))
