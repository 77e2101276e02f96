"""Plots of a report that answer to the reader: Bokeh, whose script the report carries."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softehl.cases.harness.report.part import FinishedRun
from softehl.cases.harness.row import OK
from softehl.cases.seal.report import style
from softehl.cases.seal.report.profiles import places, thicknesses
from softehl.cases.seal.states.observer_adapter import read_profile
from softehl.cases.seal.states.state import FilmRow
from softehl.runtime.arrays import Array

_WIDTH, _HEIGHT, _LEAST = 460, 300, 300  # px of a plot; least width
_WRAP = ":host { flex-wrap: wrap; }"
_POINTS = 400  # of a profile at most
_DASHES = {"out": "solid", "in": "dashed"}
_COLOURS = ("#1b6ca8", "#c8553d", "#4f8a52", "#7a5195", "#b58900", "#444444")
_MOVE = """
for (const [source, states] of pairs) source.data = states[cb_obj.value];
cb_obj.title = titles[cb_obj.value];
"""
"""Script of the slider: every line shows its state at the speed of that number."""

Profiles = dict[str, list[dict[str, list[float]]]]


def film_plot(run: FinishedRun) -> Any:
    """Pressure and film thickness of both strokes, at the speed that a slider chooses."""
    from bokeh.layouts import column, row
    from bokeh.models import ColumnDataSource, CustomJS
    from bokeh.models.widgets import Slider

    speeds = sorted({abs(r.rod_speed_mm_s) for r in run.rows}, reverse=True)
    states, limits = profiles_of(run, speeds)
    panels = [
        _panel(style_label, limits, log=log)
        for style_label, log in ((style.PRESSURE, False), (style.FILM, True))
    ]
    pairs = []
    for stroke, found in states.items():
        source = ColumnDataSource(found[0], name=f"film {stroke}")
        pairs.append([source, found])
        for panel, name in zip(panels, ("p", "h"), strict=True):
            look = {"line_color": style.COLOURS[stroke], "line_dash": _DASHES[stroke]}
            panel.line("x", name, source=source, legend_label=style.STROKES[stroke], **look)
    for panel in panels:  # a film of two contacts leaves no room inside
        panel.legend.orientation = "horizontal"
        panel.add_layout(panel.legend[0], "above")
    titles = [f"{run.name}: |U| = {speed:g} mm/s" for speed in speeds]
    both = row(*panels, sizing_mode="stretch_width", stylesheets=[_WRAP])
    if len(speeds) == 1:
        return both
    slider = Slider(start=0, end=len(speeds) - 1, value=0, step=1, title=titles[0], name="speed")
    slider.update(show_value=False, sizing_mode="stretch_width", max_width=2 * _WIDTH)
    slider.js_on_change("value", CustomJS(args={"pairs": pairs, "titles": titles}, code=_MOVE))
    return column(slider, both, sizing_mode="stretch_width")


def profiles_of(run: FinishedRun, speeds: Sequence[float]) -> tuple[Profiles, dict[str, Any]]:
    """Lines of each stroke, one for each speed (none where it has no state), and their limits."""
    found: Profiles = {}
    rows = {row.key: row for row in run.rows}
    for stroke, sign in (("out", 1.0), ("in", -1.0)):
        some = [rows.get(sign * speed) for speed in speeds]
        if any(some):
            found[stroke] = [_line(run, row) for row in some]
    top = max(row.p_max_MPa for row in run.rows)
    limits = {
        "x": places(run.rows),
        "h": thicknesses(run.rows),
        "p": (-0.05 * top, 1.1 * top),
    }
    return found, limits


def _line(run: FinishedRun, row: FilmRow | None) -> dict[str, list[float]]:
    if row is None:
        return {"x": [], "p": [], "h": []}
    profile = read_profile(run.folder, row)
    every = slice(None, None, 1 + len(profile.x_mm) // _POINTS)
    return {
        name: [float(f"{v:.5g}") for v in values[every]]
        for name, values in (("x", profile.x_mm), ("p", profile.p_MPa), ("h", profile.h_um))
    }


def narrow(width: int) -> dict[str, Any]:
    """A width that shrinks with the window, so that a telephone shows the whole plot."""
    return {"width_policy": "max", "max_width": width, "min_width": min(width, _LEAST)}


def _panel(label: str, limits: dict[str, Any], *, log: bool) -> Any:
    from bokeh.plotting import figure

    panel = figure(
        height=_HEIGHT,
        **narrow(_WIDTH),
        x_range=limits["x"],
        y_range=limits["h" if log else "p"],
        y_axis_type="log" if log else "linear",
        x_axis_label=style.POSITION,
        y_axis_label=label,
        tools="pan,box_zoom,wheel_zoom,reset,save",
    )
    panel.toolbar.logo = None
    return panel


def curve_plot(runs: Sequence[FinishedRun]) -> Any:
    """h* over speed with error bars; what is not plainly `ok` is a hollow mark."""
    panel = _over_speed(runs, style.H_STAR)
    for number, run in enumerate(runs):
        for stroke in style.STROKES:
            rows = _stroke(run, stroke)
            if rows:
                _draw(
                    panel, rows, _look(runs, number, stroke), f"{run.name}, {style.STROKES[stroke]}"
                )
    _place_legend(panel, outside=len(runs) > 1)
    return panel


def _draw(panel: Any, rows: Sequence[FilmRow], look: dict[str, str], label: str) -> None:
    from bokeh.models import ColumnDataSource
    from bokeh.models.annotations import Whisker

    h = np.array([row.h_star_um for row in rows])
    error = np.nan_to_num(0.01 * np.abs([row.h_star_error_percent for row in rows])) * h
    source = ColumnDataSource(
        {
            **{"x": [abs(row.rod_speed_mm_s) for row in rows], "y": h},
            **{"low": h - error, "high": h + error},
            "verdict": [row.verdict for row in rows],
            "error": [row.h_star_error_percent for row in rows],
            "fill": [look["color"] if row.verdict == OK else "white" for row in rows],
        }
    )
    panel.line(
        "x",
        "y",
        source=source,
        legend_label=label,
        line_dash=look["dash"],
        line_color=look["color"],
    )
    panel.scatter("x", "y", source=source, size=7, line_color=look["color"], fill_color="fill")
    panel.add_layout(
        Whisker(base="x", lower="low", upper="high", source=source, line_color=look["color"])
    )


def friction_plot(runs: Sequence[FinishedRun]) -> Any:
    """Magnitude of the friction on the rod over speed."""
    panel = _over_speed(runs, "friction on the rod [N]")
    for number, run in enumerate(runs):
        for stroke in style.STROKES:
            rows, look = _stroke(run, stroke), _look(runs, number, stroke)
            if rows:
                x = [abs(row.rod_speed_mm_s) for row in rows]
                y: Array = np.abs([row.rod_friction_N for row in rows])
                label = f"{run.name}, {style.STROKES[stroke]}"
                panel.line(
                    x, y, line_color=look["color"], line_dash=look["dash"], legend_label=label
                )
                panel.scatter(x, y, size=6, color=look["color"])
    _place_legend(panel, outside=len(runs) > 1)
    return panel


def _place_legend(panel: Any, *, outside: bool) -> None:
    """Put the legend where a rising curve leaves room; outside: above, where there are many."""
    if outside:
        panel.legend.ncols = 2
        panel.add_layout(panel.legend[0], "above")
    panel.legend.location = "top_left"
    panel.legend.background_fill_alpha = 0.5
    panel.legend.label_text_font_size = "11px"


def _over_speed(runs: Sequence[FinishedRun], label: str) -> Any:
    from bokeh.models import HoverTool
    from bokeh.plotting import figure

    panel = figure(
        **narrow(int(1.4 * _WIDTH)),
        height=int(1.2 * _HEIGHT),
        x_axis_type="log",
        y_axis_type="log",
        x_axis_label=style.SPEED,
        y_axis_label=label,
        tools="pan,box_zoom,wheel_zoom,reset,save",
    )
    tips = [("|U|", "@x{0.###} mm/s"), (label, "@y{0.####}")]
    if label == style.H_STAR:
        tips += [("error", "@error{0.##} %"), ("verdict", "@verdict")]
    panel.add_tools(HoverTool(tooltips=tips))
    panel.toolbar.logo = None
    return panel


def _stroke(run: FinishedRun, stroke: str) -> list[FilmRow]:
    rows = [row for row in run.rows if row.stroke == stroke]
    return sorted(rows, key=lambda row: abs(row.rod_speed_mm_s))


def _look(runs: Sequence[FinishedRun], number: int, stroke: str) -> dict[str, str]:
    """Colours are strokes for one run, runs for several."""
    colour = style.COLOURS[stroke] if len(runs) == 1 else _COLOURS[number % len(_COLOURS)]
    return {"color": colour, "dash": _DASHES[stroke]}
