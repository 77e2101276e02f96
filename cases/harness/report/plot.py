"""A plot of a report that answers to the reader: Bokeh, whose script the report carries."""

from __future__ import annotations

from textwrap import wrap
from typing import Any

from bokeh.plotting import figure

COLOURS = ("#1b6ca8", "#c8553d", "#4f8a52", "#7a5195", "#b58900", "#444444")
"""Of the lines of a plot."""


def plot(x: str, y: str, *, width: int = 640, height: int = 340, **more: Any) -> Any:
    """An empty plot with words (x, y) along its axes; more: of Bokeh's `figure`.

    width, height: px; it shrinks with the window, so that a telephone shows the whole plot.
    """
    panel = figure(
        height=height,
        width_policy="max",
        max_width=width,
        min_width=300,
        x_axis_label=x,
        y_axis_label="\n".join(wrap(y, height // 10)),
        tools="pan,box_zoom,wheel_zoom,reset,save",
        **more,
    )
    panel.toolbar.logo = None
    return panel


def put_legend_above(panel: Any, columns: int) -> None:
    """Put the legend above a plot, where it covers no line."""
    panel.legend.ncols = columns
    panel.add_layout(panel.legend[0], "above")
