"""Drawing in the paper's axes, the same every time; states that are not ok look different."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softehl.cases.paper.figure_spec import FigureContent
from softehl.cases.paper.states import RequestedState
from softehl.cases.seal.states.state import Profile
from softehl.runtime.io import replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_STYLE: Any = {
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": "medium",
    "font.size": 8,
    "legend.fontsize": 6.5,
    "legend.frameon": False,
    "lines.linewidth": 1.1,
    "lines.markersize": 4,
    "savefig.dpi": 110,
}
PRESSURE = "hydrodynamic pressure $p$ [MPa]"
FILM = r"film thickness $h$ [$\mu$m]"
POSITION = r"position $\bar x$ [mm]"
H_STAR = r"$h^* = q/\bar u$ [$\mu$m]"

_COLOURS = 96
_MARGIN = 0.35  # mm of the contact's surroundings
_LETTER_WIDTH = 0.049  # inches, of the caption
_LINE_HEIGHT = 0.15


def write_picture(product: FigureContent, path: Path) -> None:
    """Write the picture with its caption below, if the product has one; atomically."""
    if product.draw is None:
        return
    import matplotlib
    from matplotlib.figure import Figure
    from PIL import Image

    with matplotlib.rc_context(_STYLE):
        width, height = product.size
        lines = textwrap.wrap(product.caption, int(width / _LETTER_WIDTH))
        below = _LINE_HEIGHT * (len(lines) + 0.6)
        figure = Figure(figsize=(width, height + below), layout="constrained")
        engine = figure.get_layout_engine()
        if engine is not None:
            share = below / (height + below)
            engine.set(rect=(0.0, share, 1.0, 1.0 - share))  # type: ignore[call-arg]
        product.draw(figure)
        figure.text(0.01, 0.01, "\n".join(lines), fontsize=6.5, va="bottom", color="0.3")
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png")
    with replacing(path) as temporary:  # a palette: meshes of thin lines are large otherwise
        Image.open(buffer).convert("RGB").quantize(_COLOURS).save(temporary, "PNG", optimize=True)


def shades(number: int) -> list[Any]:
    """Colours of `number` series, dark to light."""
    from matplotlib import colormaps

    return [colormaps["viridis"](0.9 * i / max(number - 1, 1)) for i in range(number)]


def draw_profile(
    axes: Axes,
    state: RequestedState,
    values: Callable[[Profile], Any],
    label: str,
    color: Any,
) -> None:
    """A line along the film: full for a state that is ok, dotted and labelled otherwise."""
    if not state.usable:
        axes.plot([], [], color=color, linestyle="", marker="x", label=f"{label} ({state.verdict})")
        return
    profile = state.profile
    style, note = ("-", "") if state.plain else (":", f" ({state.verdict})")
    axes.plot(profile.x_mm, values(profile), color=color, linestyle=style, label=label + note)


def pressure(profile: Profile) -> Any:
    """p, MPa."""
    return profile.p_MPa


def film(profile: Profile) -> Any:
    """h, um."""
    return profile.h_um


@dataclass(frozen=True)
class SeriesLine:
    """A series of h* over something: states with their abscissas, label, colour, line style."""

    label: str
    x: Sequence[float]
    states: Sequence[RequestedState]
    color: Any
    style: str = "-"
    marker: str = "o"


def draw_line(axes: Axes, line: SeriesLine) -> None:
    """A curve whose markers are full for states that are ok; others are hollow, with a letter."""
    usable = [(x, s) for x, s in zip(line.x, line.states, strict=True) if s.usable]
    axes.plot(
        [x for x, _ in usable],
        [s.h_star for _, s in usable],
        color=line.color,
        linestyle=line.style,
        label=line.label,
    )
    for x, state in usable:
        axes.plot(
            [x],
            [state.h_star],
            color=line.color,
            marker=line.marker,
            markerfacecolor=line.color if state.plain else "white",
        )
        if not state.plain:
            axes.annotate(
                state.verdict[0],
                (x, state.h_star),
                xytext=(3, 3),
                textcoords="offset points",
                fontsize=6,
                color=line.color,
            )


def marks_words() -> str:
    """Meaning of the marks of :func:`draw_line`."""
    return "Hollow markers: o = oscillating, u = under-resolved."


def logarithmic(axes: Any, *, x: bool, y: bool) -> None:
    """Logarithmic axes with plain numbers, the abscissa by halves."""
    if y:
        axes.set_yscale("log")
        for axis_formatter in (axes.yaxis.set_major_formatter, axes.yaxis.set_minor_formatter):
            axis_formatter("{x:g}")
    if x:
        axes.set_xscale("log", base=2)
        axes.xaxis.set_major_formatter("{x:g}")


def around_contact(
    axes: Axes, states: Sequence[RequestedState], around: tuple[str, float, float] | None = None
) -> None:
    """Show the contact only, or what is `around` one of its ends."""
    rows = [s.row for s in states if s.row is not None and s.usable]
    if not rows:
        return
    start = min(r.contact_start_mm for r in rows)
    end = max(r.contact_end_mm for r in rows)
    first, last = (start, -_MARGIN), (end, _MARGIN)
    if around:
        end_position = start if around[0] == "start" else end
        first, last = (end_position, around[1]), (end_position, around[2])
    axes.set_xlim(sum(first), sum(last))
