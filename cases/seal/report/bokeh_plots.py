"""Interactive plots of a report (Bokeh)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from bokeh.layouts import column, row
from bokeh.models import ColumnDataSource, CustomJS, HoverTool
from bokeh.models.annotations import Whisker
from bokeh.models.widgets import Slider

from softehl.cases.harness.report.part import FinishedRun
from softehl.cases.harness.report.plot import COLOURS, plot, put_legend_above
from softehl.cases.harness.row import OK
from softehl.cases.seal.report import style
from softehl.cases.seal.report.profiles import position_range, thicknesses
from softehl.cases.seal.states.state import FilmRow
from softehl.cases.seal.states.state_files import read_profile

_DASHES = {"out": "solid", "in": "dashed"}
_MOVE = """
for (const [source, states] of pairs) source.data = states[cb_obj.value];
cb_obj.title = titles[cb_obj.value];
"""
"""Script of the slider: every line shows its state at the speed of that number."""


def film_plot(run: FinishedRun) -> Any:
    """Pressure and film thickness of both strokes, at the speed that a slider chooses."""
    speeds = sorted({abs(r.rod_speed_mm_s) for r in run.rows}, reverse=True)
    top = max(r.p_max_MPa for r in run.rows)
    size: dict[str, Any] = {"width": 460, "height": 300, "x_range": position_range(run.rows)}
    pressure = plot(style.POSITION, style.PRESSURE, y_range=(-0.05 * top, 1.1 * top), **size)
    logarithmic: dict[str, Any] = {"y_range": thicknesses(run.rows), "y_axis_type": "log"}
    film = plot(style.POSITION, style.FILM, **logarithmic, **size)
    pairs, rows_by_speed = [], {r.key: r for r in run.rows}
    for stroke, sign in (("out", 1.0), ("in", -1.0)):
        states = [_line(run, rows_by_speed.get(sign * speed)) for speed in speeds]
        if not any(state["x"] for state in states):
            continue
        source = ColumnDataSource(states[0], name=f"film {stroke}")
        pairs.append([source, states])
        for name, panel in (("p", pressure), ("h", film)):
            look = {"line_color": style.COLOURS[stroke], "line_dash": _DASHES[stroke]}
            panel.line("x", name, source=source, legend_label=style.STROKES[stroke], **look)
    for panel in (pressure, film):  # a film of two contacts leaves no room inside
        put_legend_above(panel, columns=2)
    titles = [f"{run.name}: |U| = {speed:g} mm/s" for speed in speeds]
    wrapped = ":host { flex-wrap: wrap; }"
    both = row(pressure, film, sizing_mode="stretch_width", stylesheets=[wrapped])
    if len(speeds) == 1:
        return both
    slider = Slider(start=0, end=len(speeds) - 1, value=0, step=1, title=titles[0], name="speed")
    slider.update(show_value=False, sizing_mode="stretch_width", max_width=920)
    slider.js_on_change("value", CustomJS(args={"pairs": pairs, "titles": titles}, code=_MOVE))
    return column(slider, both, sizing_mode="stretch_width")


def _line(run: FinishedRun, state: FilmRow | None) -> dict[str, list[float]]:
    """The profile of a state, of 400 points at most; empty where there is none."""
    if state is None:
        return {"x": [], "p": [], "h": []}
    profile = read_profile(run.folder, state)
    every = slice(None, None, 1 + len(profile.x_mm) // 400)
    return {
        name: [float(f"{v:.5g}") for v in values[every]]
        for name, values in (("x", profile.x_mm), ("p", profile.p_MPa), ("h", profile.h_um))
    }


def curve_plot(runs: Sequence[FinishedRun]) -> Any:
    """h* over speed."""
    return _over_speed(runs, style.H_STAR, lambda r: (r.h_star_um, r.h_star_error_percent))


def friction_plot(runs: Sequence[FinishedRun]) -> Any:
    """Magnitude of the friction on the rod over speed."""

    def friction(row: FilmRow) -> tuple[float, float]:
        return abs(row.rod_friction_N), row.rod_friction_error_percent

    return _over_speed(runs, style.FRICTION, friction)


def _over_speed(
    runs: Sequence[FinishedRun], label: str, of: Callable[[FilmRow], tuple[float, float]]
) -> Any:
    """A result over speed with bars of its error, a line a stroke.

    of: the result of a state, and its error in per cent. A state that is not `ok` is a hollow mark.
    Colours are strokes for one run, runs for several.
    """
    panel = plot(style.SPEED, label, height=360, x_axis_type="log", y_axis_type="log")
    tips = [("|U|", "@x{0.###} mm/s"), (label, "@y{0.####}")]
    tips += [("error", "@error{0.##} %"), ("verdict", "@verdict")]
    panel.add_tools(HoverTool(tooltips=tips))
    for number, run in enumerate(runs):
        for stroke, rows in style.by_stroke(run.rows).items():
            values, errors = np.array([of(row) for row in rows]).T
            bars = np.nan_to_num(0.01 * np.abs(errors)) * values
            colour = style.COLOURS[stroke] if len(runs) == 1 else COLOURS[number % len(COLOURS)]
            columns = {
                **{"x": [abs(row.rod_speed_mm_s) for row in rows], "y": values, "error": errors},
                **{"low": values - bars, "high": values + bars},
                "verdict": [row.verdict for row in rows],
                "fill": [colour if row.verdict == OK else "white" for row in rows],
            }
            source, look = ColumnDataSource(columns), dict[str, Any](line_color=colour)
            label, dash = f"{run.name}, {style.STROKES[stroke]}", _DASHES[stroke]
            panel.line("x", "y", source=source, legend_label=label, line_dash=dash, **look)
            panel.scatter("x", "y", source=source, size=7, fill_color="fill", **look)
            panel.add_layout(Whisker(base="x", lower="low", upper="high", source=source, **look))
    if len(runs) > 1:
        put_legend_above(panel, columns=2)
    panel.legend.location = "top_left"
    panel.legend.background_fill_alpha = 0.5
    panel.legend.label_text_font_size = "11px"
    return panel
