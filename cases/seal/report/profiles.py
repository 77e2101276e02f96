"""Pressure and film thickness along the film: a column a stroke, a line a speed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from softehl.cases.harness.row import OK
from softehl.cases.seal.report import style
from softehl.cases.seal.states.state import FilmRow, Profile

Results = Sequence[tuple[FilmRow, Profile]]


def profiles_figure(head: str, results: Results) -> Figure:
    """Pressure above film thickness; a state that is not ok is dotted, with its verdict.

    A speed has one colour for both strokes, dark fast, light slow. Only the contact and the thin
    film are shown: beside it h is a hundred times larger.
    """
    rows = [row for row, _ in results]
    strokes = list(style.by_stroke(rows))
    speeds = sorted({abs(row.rod_speed_mm_s) for row in rows}, reverse=True)
    shades = colormaps["viridis"](np.linspace(0.05, 0.85, len(speeds)))
    colours = dict(zip(speeds, map(tuple, shades), strict=True))
    figure = Figure(figsize=(3.9 * len(strokes) + 0.6, 5.6))
    axes = figure.subplots(2, len(strokes), sharex=True, sharey="row", squeeze=False)
    for (pressure, film), stroke in zip(axes.T, strokes, strict=True):
        for row, profile in results:
            if row.stroke != stroke:
                continue
            speed, plain = abs(row.rod_speed_mm_s), row.verdict == OK
            label = f"{speed:g}" if plain else f"{speed:g} ({row.verdict})"
            line = {"color": colours[speed], "linestyle": "-" if plain else ":"}
            pressure.plot(profile.x_mm, profile.p_MPa, **line)
            film.plot(profile.x_mm, profile.h_um, label=label, **line)
        pressure.set_title(style.STROKES[stroke])
        film.legend(title="|U| [mm/s]", loc="upper center", ncols=2)
        film.set_xlabel(style.POSITION)
    pressure, film = axes[:, 0]
    pressure.set_ylabel(style.PRESSURE)
    film.set(ylabel=style.FILM, xlim=position_range(rows), yscale="log")
    low, high = thicknesses(rows)
    if 0 < low < high:
        film.set_ylim(low, high)
    film.xaxis.set_major_locator(MaxNLocator(5))
    style.tick_plainly(film.yaxis)
    style.write_head(figure, head)
    return figure


def position_range(rows: Sequence[FilmRow]) -> tuple[float, float]:
    """Range of x around the contacts of all states, mm."""
    finite = [row for row in rows if np.isfinite(row.contact_start_mm)]
    start = min((row.contact_start_mm for row in finite), default=-1.0)
    end = max((row.contact_end_mm for row in finite), default=1.0)
    return start - 0.3, end + 0.3


def thicknesses(rows: Sequence[FilmRow]) -> tuple[float, float]:
    """Range of h that shows the thin part of all films, um."""
    return 0.7 * min(row.thickness_um for row in rows), 20.0 * max(row.h_star_um for row in rows)
