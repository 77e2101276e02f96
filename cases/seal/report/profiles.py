"""Pressure and film thickness along the film: a column a stroke, a line a speed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from softehl.cases.harness.row import OK
from softehl.cases.seal.report import style
from softehl.cases.seal.report.curve import plain_ticks
from softehl.cases.seal.states.state import FilmRow, Profile

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


Results = Sequence[tuple[FilmRow, Profile]]
Colour = tuple[float, float, float, float]

_MARGIN = 0.3  # mm beside the contacts
_LEAST, _MOST = 0.7, 20.0  # of the least h and of the largest h*


def profiles_figure(head: str, results: Results) -> Figure:
    """Pressure above film thickness; a state that is not ok is dotted, with its verdict."""
    from matplotlib.figure import Figure

    strokes = [stroke for stroke in style.STROKES if any(r.stroke == stroke for r, _ in results)]
    figure = Figure(figsize=(3.9 * len(strokes) + 0.6, 5.6))
    axes = figure.subplots(2, len(strokes), sharex=True, sharey="row", squeeze=False)
    for column, stroke in enumerate(strokes):
        pressure, film = axes[0, column], axes[1, column]
        for row, profile, colour in _coloured(results, stroke):
            plain = row.verdict == OK
            label = f"{abs(row.rod_speed_mm_s):g}" + ("" if plain else f" ({row.verdict})")
            line = {"color": colour, "linestyle": "-" if plain else ":"}
            pressure.plot(profile.x_mm, profile.p_MPa, **line)
            film.plot(profile.x_mm, profile.h_um, label=label, **line)
        pressure.set_title(style.STROKES[stroke])
        film.legend(title="|U| [mm/s]", loc="upper center", ncols=2)
        film.set_xlabel(style.POSITION)
    axes[0, 0].set_ylabel(style.PRESSURE)
    axes[1, 0].set_ylabel(style.FILM)
    _show_contact(axes[1, 0], [row for row, _ in results])
    style.set_margins(figure, left=0.55, right=0.12, bottom=0.5, top=0.82, between=0.07)
    style.write_head(figure, head, left=0.55)
    return figure


def _coloured(results: Results, stroke: str) -> Iterator[tuple[FilmRow, Profile, Colour]]:
    """The states of a stroke; a speed has one colour for both strokes, dark fast, light slow."""
    from matplotlib import colormaps

    speeds = sorted({abs(row.rod_speed_mm_s) for row, _ in results}, reverse=True)
    shades = dict(zip(speeds, np.linspace(0.05, 0.85, len(speeds)).tolist(), strict=True))
    for row, profile in results:
        if row.stroke == stroke:
            yield row, profile, colormaps["viridis"](shades[abs(row.rod_speed_mm_s)])


def _show_contact(film: Axes, rows: Sequence[FilmRow]) -> None:
    """Show the contact and the thin film only: beside it h is a hundred times larger."""
    from matplotlib.ticker import MaxNLocator, NullLocator

    film.set_xlim(places(rows))
    film.xaxis.set_major_locator(MaxNLocator(5))
    film.set_yscale("log")
    low, high = thicknesses(rows)
    if 0 < low < high:
        film.set_ylim(low, high)
    film.yaxis.set_ticks(plain_ticks(*film.get_ylim()))
    film.yaxis.set_major_formatter("{x:g}")
    film.yaxis.set_minor_locator(NullLocator())


def places(rows: Sequence[FilmRow]) -> tuple[float, float]:
    """Range of x around the contacts of all states, mm."""
    known = [row for row in rows if np.isfinite(row.contact_start_mm)]
    start = min((row.contact_start_mm for row in known), default=-1.0)
    end = max((row.contact_end_mm for row in known), default=1.0)
    return start - _MARGIN, end + _MARGIN


def thicknesses(rows: Sequence[FilmRow]) -> tuple[float, float]:
    """Range of h that shows the thin part of all films, um."""
    return _LEAST * min(row.h_min_um for row in rows), _MOST * max(row.h_star_um for row in rows)
