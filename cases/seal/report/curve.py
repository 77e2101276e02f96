"""Film thickness over rod speed: h* with its errors and verdicts, and the slope it has."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from softehl.cases.harness.row import OK
from softehl.cases.seal.report import style
from softehl.cases.seal.states.state import FilmRow
from softehl.runtime.arrays import Array


def curve_figure(head: str, rows: Sequence[FilmRow], rejected: Sequence[FilmRow] = ()) -> Figure:
    """h* over |U|, both logarithmic, a line a stroke; rejected states are marked on the axis.

    head: what it is about. Bars of both strokes where there is one speed. Not drawn: rough films so
    slow that the sealed pressure drives oil against the rod, h* < 0.
    """
    rows = sorted((row for row in rows if row.h_star_um > 0.0), key=lambda r: abs(r.rod_speed_mm_s))
    several = len({abs(row.rod_speed_mm_s) for row in (*rows, *rejected)}) > 1
    figure = Figure(figsize=(5.4, 4.4) if several else (4.2, 3.8))
    axes = figure.subplots()
    if several:
        _draw_lines(axes, rows, rejected)
    else:
        _draw_bars(axes, rows, rejected)
    axes.set_ylabel(style.H_STAR)
    style.write_head(figure, head)
    return figure


def _draw_lines(axes: Axes, rows: Sequence[FilmRow], rejected: Sequence[FilmRow]) -> None:
    axes.set(xscale="log", yscale="log", xlabel=style.SPEED)
    axes.margins(x=0.07)
    for stroke, chosen in style.by_stroke(rows).items():
        _draw_stroke(axes, stroke, chosen)
    _draw_slope(axes, rows)
    for stroke, chosen in style.by_stroke(rejected).items():  # crosses on the lower axis
        axes.plot(
            *([abs(row.rod_speed_mm_s) for row in chosen], [0.02] * len(chosen), "x"),
            color=style.COLOURS[stroke],
            transform=axes.get_xaxis_transform(),
            label=f"{style.STROKES[stroke]}, film collapsed: no result",
        )
    if rows:  # room for the legend
        axes.set_ylim(top=1.7 * max(row.h_star_um for row in rows))
    style.tick_plainly(axes.xaxis)
    style.tick_plainly(axes.yaxis)
    axes.legend(loc="upper left")


def _draw_bars(axes: Axes, rows: Sequence[FilmRow], rejected: Sequence[FilmRow]) -> None:
    """A bar for each stroke with its error, its number and what is wrong with it."""
    states = sorted((*rows, *rejected), key=lambda row: -row.rod_speed_mm_s)
    heights = [row.h_star_um if row in rows else 0.0 for row in states]
    errors = np.nan_to_num([0.01 * abs(row.h_star_error_percent) for row in states]) * heights
    colours = [style.COLOURS[row.stroke] for row in states]
    bars = axes.bar(range(len(states)), heights, 0.5, yerr=errors, color=colours)
    axes.bar_label(bars, [_of_bar(row) if row in rows else _LOST for row in states], padding=3)
    axes.set_xticks(range(len(states)), [style.STROKES[row.stroke] for row in states])
    axes.set_xlabel(f"|U| = {abs(states[0].rod_speed_mm_s):g} mm/s")
    axes.margins(x=0.2, y=0.35)
    axes.grid(visible=False, axis="x")


_LOST = "film collapsed:\nno result"


def _of_bar(row: FilmRow) -> str:
    words = [f"{row.h_star_um:.4g} µm"]
    if np.isfinite(row.h_star_error_percent):
        words.append(f"± {abs(row.h_star_error_percent):.2g} %")
    return "\n".join(words if row.verdict == OK else [*words, row.verdict])


def fitted_exponent(rows: Sequence[FilmRow]) -> float | None:
    """n of h* ~ |U|^n, one for both strokes, by least squares of the logarithms.

    Only states that are ok count. None where no stroke has two of them.
    """
    products = squares = 0.0
    for chosen in style.by_stroke(row for row in rows if row.verdict == OK).values():
        x, y = np.log(_columns(chosen)[:2])
        products += float((x - x.mean()) @ (y - y.mean()))
        squares += float((x - x.mean()) @ (x - x.mean()))
    return products / squares if squares else None


def _draw_stroke(axes: Axes, stroke: str, rows: Sequence[FilmRow]) -> None:
    """A line with the bars of the estimated error; hollow markers with a word where not ok."""
    label, colour = style.STROKES[stroke], style.COLOURS[stroke]
    known = [row for row in rows if np.isfinite(row.h_star_error_percent)]
    if known:
        speed, film, error = _columns(known)
        label += f" (error bars: at most {error.max():.2g} %)"
        axes.errorbar(speed, film, 0.01 * error * film, color=colour, fmt="none", capsize=3)
    speed, film, _ = _columns(rows)
    axes.plot(speed, film, color=colour, marker=style.MARKERS[stroke], label=label)
    for row in rows:
        if row.verdict == OK:
            continue
        place = abs(row.rod_speed_mm_s), row.h_star_um
        axes.plot(*place, style.MARKERS[stroke], color=colour, markerfacecolor="white")
        shift = (-5, 4) if stroke == "out" else (5, -4)
        style.write_beside(axes, place, row.verdict, shift, color=colour)


def _draw_slope(axes: Axes, rows: Sequence[FilmRow]) -> None:
    """A line above the curve at the slope that was measured."""
    exponent = fitted_exponent(rows)
    if exponent is None:
        return
    speed, film, _ = _columns(rows)
    ends = speed[[0, -1]]
    line = 1.2 * float((film / speed**exponent).max()) * ends**exponent
    axes.plot(ends, line, "--", color="0.45", linewidth=1.0, label=f"slope {exponent:.3f} (fitted)")


def _columns(rows: Sequence[FilmRow]) -> Array:
    """|U|, h* and its error (per cent, nan where not known), (3, n)."""
    names = "rod_speed_mm_s", "h_star_um", "h_star_error_percent"
    return np.abs([[getattr(row, name) for row in rows] for name in names])
