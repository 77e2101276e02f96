"""Film thickness over rod speed: h* with its errors and verdicts, and the slope it has."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softehl.cases.harness.row import OK
from softehl.cases.seal.report import style
from softehl.cases.seal.states.state import FilmRow
from softehl.runtime.arrays import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure


_BESIDE, _ROOM = 1.2, 1.7  # factors of logarithmic axes: free space, and that of the legend
_BESIDE_MARK = {"out": (-5, 4), "in": (5, -9)}  # points from a mark to its word
_PLAIN = ((1.0,), (1.0, 2.0, 5.0), (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0))  # digits of ticks
_ENOUGH, _MANY = 3, 7  # ticks of an axis


def curve_figure(head: str, rows: Sequence[FilmRow], rejected: Sequence[FilmRow] = ()) -> Figure:
    """h* over |U|, both logarithmic, a line a stroke; rejected states are marked on the axis.

    head: what it is about. Bars of both strokes where there is one speed. Not drawn: rough films so
    slow that the sealed pressure drives oil against the rod, h* < 0.
    """
    from matplotlib.figure import Figure

    rows = [row for row in rows if row.h_star_um > 0.0]
    if len({abs(row.rod_speed_mm_s) for row in (*rows, *rejected)}) == 1:
        return _one_speed_figure(head, rows, rejected)
    figure = Figure(figsize=(5.4, 4.4))
    axes = figure.subplots()
    _set_limits(axes, rows, rejected)
    for stroke in style.STROKES:
        chosen = [row for row in rows if row.stroke == stroke]
        if chosen:
            _draw_stroke(axes, stroke, chosen)
    _draw_slope(axes, rows)
    _draw_rejected(axes, rejected)
    tick_plainly(axes.xaxis, axes.get_xlim())
    tick_plainly(axes.yaxis, axes.get_ylim())
    axes.set_xlabel(style.SPEED)
    axes.set_ylabel(style.H_STAR)
    axes.legend(loc="upper left")
    style.set_margins(figure, left=0.62, right=0.12, bottom=0.5, top=0.6)
    style.write_head(figure, head, left=0.62)
    return figure


def _one_speed_figure(head: str, rows: Sequence[FilmRow], rejected: Sequence[FilmRow]) -> Figure:
    """A bar for each stroke with its error, its number and what is wrong with it."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.2, 3.8))
    axes = figure.subplots()
    states = sorted((*rows, *rejected), key=lambda row: -row.rod_speed_mm_s)
    for place, row in enumerate(states):
        height = row.h_star_um if row in rows else 0.0
        known = np.isfinite(row.h_star_error_percent) and height
        error = 0.01 * abs(row.h_star_error_percent) * height if known else None
        axes.bar(place, height, 0.5, yerr=error, capsize=4, color=style.COLOURS[row.stroke])
        words = [f"{height:.4g} µm"] if height else ["film collapsed:", "no result"]
        words += [f"± {abs(row.h_star_error_percent):.2g} %"] if known else []
        words += [row.verdict] if height and row.verdict != OK else []
        offset: Any = {"xytext": (0, 5), "textcoords": "offset points", "ha": "center"}
        axes.annotate("\n".join(words), (place, height + (error or 0.0)), **offset)
    axes.set_xticks(range(len(states)), [style.STROKES[row.stroke] for row in states])
    axes.set_xlabel(f"|U| = {abs(states[0].rod_speed_mm_s):g} mm/s")
    axes.set(ylabel=style.H_STAR, xlim=(-0.7, len(states) - 0.3))
    axes.set_ylim(0.0, 1.35 * max((row.h_star_um for row in rows), default=1.0))
    axes.grid(visible=False, axis="x")
    style.set_margins(figure, left=0.62, right=0.12, bottom=0.5, top=0.6)
    style.write_head(figure, head, left=0.62)
    return figure


def fitted_exponent(rows: Sequence[FilmRow]) -> float | None:
    """n of h* ~ |U|^n, one for both strokes, by least squares of the logarithms.

    Only states that are ok count. None where no stroke has two of them.
    """
    products = squares = 0.0
    for stroke in style.STROKES:
        chosen = [row for row in rows if row.stroke == stroke and row.verdict == OK]
        if len(chosen) > 1:
            x, y = (np.log(values) for values in _columns(chosen)[:2])
            products += float((x - x.mean()) @ (y - y.mean()))
            squares += float((x - x.mean()) @ (x - x.mean()))
    return products / squares if squares else None


def plain_ticks(low: float, high: float) -> list[float]:
    """Round numbers for a logarithmic axis from low to high, both > 0: about three to seven."""
    found: list[float] = []
    for digits in _PLAIN:
        powers = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
        values = np.outer(powers, digits).ravel()
        found = [float(f"{v:.6g}") for v in values if low <= v <= high]
        if len(found) >= _ENOUGH:
            return found[:: 1 + (len(found) - 1) // _MANY]
    from matplotlib.ticker import MaxNLocator

    return [float(v) for v in MaxNLocator(4).tick_values(low, high) if low <= v <= high]


def _draw_stroke(axes: Axes, stroke: str, rows: Sequence[FilmRow]) -> None:
    """A line with the bars of the estimated error; hollow markers with a word where not ok."""
    speed, film, error = _columns(rows)
    colour, marker = style.COLOURS[stroke], style.MARKERS[stroke]
    axes.plot(speed, film, color=colour)
    known = np.isfinite(error)
    label = style.STROKES[stroke]
    if known.any():
        largest = float(np.abs(error[known]).max())
        label += f" (error bars: at most {largest:.2g} %)"
        bars = 0.01 * np.abs(error[known]) * film[known]
        axes.errorbar(speed[known], film[known], bars, color=colour, fmt="none", capsize=3)
    plain = np.array([row.verdict == OK for row in _by_speed(rows)])
    axes.plot(speed[plain], film[plain], color=colour, linestyle="", marker=marker, label=label)
    (hollow,) = axes.plot(speed[~plain], film[~plain], color=colour, linestyle="", marker=marker)
    hollow.set_markerfacecolor("white")
    for row in rows:
        if row.verdict != OK:
            axes.annotate(
                row.verdict,
                (abs(row.rod_speed_mm_s), row.h_star_um),
                xytext=_BESIDE_MARK[stroke],
                textcoords="offset points",
                ha="right" if stroke == "out" else "left",
                fontsize="x-small",
                color=colour,
            )


def _draw_slope(axes: Axes, rows: Sequence[FilmRow]) -> None:
    """A line above the curve at the slope that was measured."""
    exponent = fitted_exponent(rows)
    if exponent is None:
        return
    speed, film, _ = _columns(rows)
    above = _BESIDE * float((film / speed**exponent).max())
    ends = speed[[0, -1]]
    label = f"slope {exponent:.3f} (fitted)"
    line = above * ends**exponent
    axes.plot(ends, line, color="0.45", linestyle="--", linewidth=1.0, label=label)


def _draw_rejected(axes: Axes, rejected: Sequence[FilmRow]) -> None:
    """Crosses on the lower axis: at these speeds there is no result."""
    for stroke in style.STROKES:
        speeds = [abs(row.rod_speed_mm_s) for row in rejected if row.stroke == stroke]
        if speeds:
            axes.plot(
                speeds,
                [0.02] * len(speeds),
                color=style.COLOURS[stroke],
                linestyle="",
                marker="x",
                transform=axes.get_xaxis_transform(),
                label=f"{style.STROKES[stroke]}, film collapsed: no result",
            )


def _set_limits(axes: Axes, rows: Sequence[FilmRow], rejected: Sequence[FilmRow]) -> None:
    """Logarithmic axes around every speed and thickness, with room for the legend above."""
    speeds = [abs(row.rod_speed_mm_s) for row in (*rows, *rejected)]
    films = [row.h_star_um for row in rows] or [1.0]
    axes.set(xscale="log", yscale="log")
    axes.set(xlim=(min(speeds) / _BESIDE, max(speeds) * _BESIDE))
    axes.set(ylim=(min(films) / _BESIDE, max(films) * _ROOM))


def tick_plainly(axis: Axis, limits: tuple[float, float]) -> None:
    """Ticks at round numbers, written out."""
    from matplotlib.ticker import NullLocator

    axis.set_ticks(plain_ticks(*limits))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())


def _by_speed(rows: Sequence[FilmRow]) -> list[FilmRow]:
    return sorted(rows, key=lambda row: abs(row.rod_speed_mm_s))


def _columns(rows: Sequence[FilmRow]) -> tuple[Array, Array, Array]:
    """|U|, h* and its error (per cent, nan where not known), by rising speed: arrays (n,)."""
    table = [
        (abs(row.rod_speed_mm_s), row.h_star_um, row.h_star_error_percent)
        for row in _by_speed(rows)
    ]
    speed, film, error = np.array(table, dtype=np.float64).T
    return speed, film, error
