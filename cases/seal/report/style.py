"""The look and the words that the pictures of a run share."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import AbstractContextManager
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import AutoLocator, LogLocator, NullLocator

from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records import Gland
from softehl.cases.seal.states.state import FilmRow
from softehl.runtime.arrays import Array

STYLE: Any = {
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": "medium",
    "axes.titley": 1.0,  # else every drawing looks for room three times
    "figure.constrained_layout.use": True,
    "figure.dpi": 160,
    "font.size": 9,
    "grid.alpha": 0.35,
    "grid.linewidth": 0.5,
    "legend.fontsize": "small",
    "legend.frameon": False,
    "legend.title_fontsize": "small",
    "lines.linewidth": 1.4,
    "lines.markersize": 5,
    "svg.fonttype": "none",
    "svg.hashsalt": "softehl",
}
Place = tuple[float, float]

STROKES = {"out": "outstroke", "in": "instroke"}
COLOURS = {"out": "#1b6ca8", "in": "#c8553d"}
MARKERS = {"out": "o", "in": "s"}

POSITION = "x [mm]   (sealed side left, air side right)"
PRESSURE = "pressure p [MPa]"
FILM = "film thickness h [µm]"
H_STAR = "film thickness h* = 2q / |U| [µm]"
FRICTION = "friction on the rod [N]"
SPEED = "rod speed |U| [mm/s]"


def drawing() -> AbstractContextManager[None]:
    """Figures that are made and saved in this context have the look."""
    return matplotlib.rc_context(STYLE)


def subject(p: Seal) -> str:
    """The ring, the oil and the sealed pressure in three lines, for the head of a picture."""
    return (
        f"{p.named} {p.ring_diameter:g} \N{MULTIPLICATION SIGN} {p.section_diameter:g} mm, "
        f"{between(p)}\n"
        f"rubber μ = {p.shear_modulus:g} MPa, κ = {p.bulk_modulus:g} MPa; "
        f"pₛ = {p.sealed_pressure:g} MPa\n"
        f"oil η₀ = {p.viscosity * 1e9:g} mPa s, "
        f"\N{GREEK SMALL LETTER ALPHA} = {p.pressure_viscosity:g} /MPa"
    )


def between(p: Gland) -> str:
    """The two surfaces that the seal is squeezed between, in words."""
    slides, holds = ("bore", "groove of the piston") if p.piston else ("rod", "housing")
    return f"{slides} {abs(p.rod_diameter):.6g} mm, {holds} {abs(p.housing_diameter):.6g} mm"


def by_stroke(rows: Iterable[FilmRow]) -> dict[str, list[FilmRow]]:
    """Stroke -> its rows by rising |U|, of the strokes that have any."""
    rising = sorted(rows, key=lambda row: abs(row.rod_speed_mm_s))
    rows_by_stroke = {stroke: [row for row in rising if row.stroke == stroke] for stroke in STROKES}
    return {stroke: some for stroke, some in rows_by_stroke.items() if some}


def write_head(figure: Figure, text: str) -> None:
    """Write what a picture is about at its top."""
    figure.suptitle(text, x=0.01, ha="left", fontsize=7.5, color="0.25")


def write_beside(axes: Axes, position: Place, text: str, shift: Place, **look: Any) -> None:
    """Small letters that stand to this side of a place, by so many points."""
    across = {0: "center", 1: "left", -1: "right"}[int(np.sign(shift[0]))]
    up = {0: "center", 1: "bottom", -1: "top"}[int(np.sign(shift[1]))]
    where = {"xytext": shift, "textcoords": "offset points", "ha": across, "va": up}
    axes.annotate(text, position, **{"fontsize": "x-small", **where, **look})


def radial_axis(axes: Axes, p: Gland) -> None:
    """Radii at the axis of a picture, upwards: those of a piston seal are counted negative."""
    axes.set_ylabel("r [mm]")
    axes.yaxis.set_major_formatter(lambda r, _: f"{abs(r):.4g}")
    if p.piston and not axes.yaxis_inverted():
        axes.invert_yaxis()


def plain_ticks(low: float, high: float) -> Array:
    """Three round numbers (n,) or more for a logarithmic axis from low to high, both > 0."""
    for locator in (LogLocator(), LogLocator(subs=(1.0, 2.0, 5.0)), AutoLocator()):
        ticks = np.asarray(locator.tick_values(low, high))
        ticks = ticks[(low <= ticks) & (ticks <= high)]
        if len(ticks) > 2:
            break
    return ticks


def tick_plainly(axis: Axis) -> None:
    """Round numbers, written out, on an axis whose limits are set."""
    axis.set_ticks(plain_ticks(*axis.get_view_interval()).tolist())
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())
