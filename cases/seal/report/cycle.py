"""Pictures of cycles: friction over the place of the rod, the film over time, an animation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softehl.cases.seal.report import style
from softehl.cases.seal.report.section import draw_gland
from softehl.runtime.arrays import Array
from softehl.runtime.io import replacing

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure
    from matplotlib.patches import Polygon
    from PIL.Image import Image

    from softehl.cases.seal.gland.parameters import Seal

Table = Mapping[str, Array]

_THICKEST = 20.0  # um, of the film that is shown
_FRAMES, _PER_SECOND = 80, 16
_RUBBER, _LINE = "#f0b86a", "#3b3f45"
_MARKS = (0.6, 0.12, 8)
"""Marks on the rod: between two, and their depth, in section diameters; how many to either side."""
_PLACE = "place of the rod [mm]   (+ = to the air side)"


def loop_figure(loops: Mapping[str, Table], work: Sequence[float]) -> Figure:
    """Friction on the rod over its place, a line a cycle, with the work it takes.

    loops: label -> readings of a cycle, one cycle after the other. A line begins with the last
    reading of the cycle before. work: mJ, of each cycle, as in curve.csv.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.4, 3.6), layout="constrained")
    axes = figure.subplots()
    begun: list[Array] = [np.empty(0), np.empty(0)]
    for number, ((label, loop), energy) in enumerate(zip(loops.items(), work, strict=True)):
        shade = 0.25 + 0.75 * (number + 1) / len(loops)
        columns = [loop["place_mm"], loop["friction_N"]]
        line = [np.concatenate(pair) for pair in zip(begun, columns, strict=True)]
        axes.plot(*line, color="#1b6ca8", alpha=shade, label=f"{label}: {energy:.4g} mJ")
        begun = [column[-1:] for column in columns]
    axes.axhline(0.0, color="0.4", linewidth=0.7)
    axes.set(xlabel=_PLACE, ylabel="friction on the rod [N]")
    axes.legend(title="work of a cycle")
    return figure


def film_map(film: Table) -> tuple[Array, Array, Array, Array]:
    """Times (n,), places (m,), mm, film thickness (n, m), um, and pressure (n, m), MPa.

    film: a line for every time and node, as a run of cycles writes it; nodes hardly move.
    """
    times = np.unique(film["t_s"])
    h, p, x = (film[name].reshape(len(times), -1) for name in ("h_um", "p_MPa", "x_mm"))
    return times, x.mean(axis=0), h, p


def map_figure(film: Table, loop: Table) -> Figure:
    """Film thickness over time and place, and beside it the speed of the rod."""
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure

    times, x, h, _ = film_map(film)
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    speed, axes = figure.subplots(1, 2, sharey=True, width_ratios=(1, 4))
    speed.plot(loop["rod_speed_mm_s"], loop["t_s"], color="#1b6ca8")
    speed.axvline(0.0, color="0.4", linewidth=0.7)
    speed.set(xlabel="$U$ [mm/s]", ylabel="$t$ [s]")
    shown = np.clip(h, max(float(h.min()), 1e-3), _THICKEST)
    colours = axes.pcolormesh(
        x, times, shown, norm=LogNorm(), shading="gouraud", cmap="viridis", rasterized=True
    )
    axes.set(xlabel=style.POSITION, xlim=_wetted(x, h))
    axes.grid(visible=False)
    figure.colorbar(colours, ax=axes, label=style.FILM)
    return figure


@dataclass(frozen=True, eq=False)
class MovingSection:
    """The section in its gland, with marks on the rod, to be shown at one time after another.

    times: (n,). outlines: (n, B, 2), mm.
    """

    parameters: Seal
    times: Array
    outlines: Array
    ring: Polygon
    marks: LineCollection

    @classmethod
    def on(cls, axes: Axes, p: Seal, outline: Table) -> MovingSection:
        """On axes; outline: a line for every time and node."""
        from matplotlib.collections import LineCollection
        from matplotlib.patches import Polygon

        times = np.unique(outline["t_s"])
        points = np.stack([outline["z_mm"], outline["r_mm"]], axis=1).reshape(len(times), -1, 2)
        draw_gland(axes, p)
        ring = Polygon(points[0], facecolor=_RUBBER, edgecolor=_LINE, linewidth=0.9)
        marks = LineCollection([], colors=_LINE, linewidths=0.9)
        axes.add_patch(ring)
        axes.add_collection(marks)
        return cls(p, times, points, ring, marks)

    def show(self, t: float, place: float) -> tuple[Polygon, LineCollection]:
        """At a time, with the rod at a place (mm)."""
        self.ring.set_xy(self.outlines[int(np.argmin(abs(self.times - t)))])
        p, depth = self.parameters, _MARKS[1] * self.parameters.section_diameter
        apart = _MARKS[0] * p.section_diameter
        z = place % apart + apart * np.arange(-_MARKS[2], _MARKS[2])
        rod = np.full_like(z, 0.5 * p.rod_diameter)
        self.marks.set_segments(list(np.stack([[z, rod], [z, rod - depth]]).transpose(2, 0, 1)))
        return self.ring, self.marks


def write_animation(path: Path, p: Seal, film: Table, loop: Table, outline: Table) -> None:
    """Section, film and pressure through a cycle with the place of the rod, as a GIF.  OSError.

    outline: the deformed outline of the section, a line for every time and node of it.
    """
    from matplotlib.figure import Figure

    times, x, h, pressures = film_map(film)
    figure = Figure(figsize=(5.0, 7.4), dpi=80, layout="constrained")
    gland, pressure, thickness, place = figure.subplots(4, 1, height_ratios=(4.5, 3, 3, 1))
    section = MovingSection.on(gland, p, outline)
    gland.set(xlabel="$z$ [mm]", ylabel="$r$ [mm]")
    limits, most = _wetted(x, h), float(pressures.max())
    (line_p,) = pressure.plot(x, pressures[0], color="#c8553d")
    pressure.set(ylabel="$p$ [MPa]", xlim=limits, ylim=(-0.05 * most, 1.1 * most))
    (line_h,) = thickness.semilogy(x, h[0], color="#1b6ca8")
    low = max(0.7 * float(h.min()), 1e-3)
    thickness.set(ylabel="$h$ [µm]", xlabel="$x$ [mm]", xlim=limits, ylim=(low, _THICKEST))
    place.plot(loop["place_mm"], loop["friction_N"], color="0.7", linewidth=1.0)
    (dot,) = place.plot([], [], color="#1b6ca8", marker="o")
    place.set(xlabel=_PLACE, ylabel="$F$ [N]")

    def show(t: float) -> None:
        at = int(np.argmin(abs(times - t)))
        line_p.set_ydata(pressures[at])
        line_h.set_ydata(np.maximum(h[at], 1e-3))
        dot.set_data([loop["place_mm"][at]], [loop["friction_N"][at]])
        section.show(t, float(loop["place_mm"][at]))

    moments = np.linspace(times[0], times[-1], _FRAMES)
    moving = (line_p, line_h, dot, section.ring, section.marks)
    first, *others = _frames(figure, moving, show, moments)
    with replacing(path) as temporary:
        pause = round(1000 / _PER_SECOND)
        first.save(temporary, "GIF", save_all=True, append_images=others, duration=pause, loop=0)


def _frames(
    figure: Figure, moving: Sequence[Artist], show: Callable[[float], None], moments: Array
) -> list[Image]:
    """Pictures of a figure after show(t) for each moment; only what moves is drawn again."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL.Image import fromarray

    canvas: Any = FigureCanvasAgg(figure)
    found = []
    for artist in moving:
        artist.set_animated(True)
    canvas.draw()
    still = canvas.copy_from_bbox(figure.bbox)
    for t in moments.tolist():
        show(t)
        canvas.restore_region(still)
        for artist in moving:
            figure.draw_artist(artist)
        found.append(fromarray(np.array(canvas.buffer_rgba())).convert("RGB"))
    return found


def _wetted(x: Array, h: Array) -> tuple[float, float]:
    """Both ends, mm, of the places whose film is thin enough at some time to be shown."""
    inside = np.flatnonzero(h.min(axis=0) < _THICKEST)
    return (float(x[inside[0]]), float(x[inside[-1]])) if len(inside) > 1 else (x[0], x[-1])
