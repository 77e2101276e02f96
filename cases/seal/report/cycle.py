"""Pictures of cycles: friction over the place of the rod, the film over time, an animation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.markers import TICKDOWN
from matplotlib.patches import Polygon
from PIL.Image import Image, fromarray

from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.surfaces import MICROMETRE
from softehl.cases.seal.report import style
from softehl.cases.seal.report.section import draw_gland
from softehl.cases.seal.states.contacts import CONTACT_FILM
from softehl.runtime.arrays import Array
from softehl.runtime.io import replacing

Columns = Mapping[str, Array]

_THICKEST = CONTACT_FILM / MICROMETRE
"""Film thickness up to which a film is shown, um."""
_PLACE = "place of the rod [mm]   (+ = to the air side)"


def loop_figure(loops: Mapping[str, Columns], work: Sequence[float]) -> Figure:
    """Friction on the rod over its place, a line a cycle, with the work it takes.

    loops: label -> readings of a cycle, one cycle after the other. A line begins with the last
    reading of the cycle before. work: mJ, of each cycle, as in curve.csv.
    """
    figure = Figure(figsize=(5.4, 3.6))
    axes = figure.subplots()
    shades, last_point = np.linspace(0.25, 1.0, len(loops) + 1)[1:], np.empty((2, 0))
    for shade, energy, (label, loop) in zip(shades, work, loops.items(), strict=True):
        line = np.hstack([last_point, [loop["place_mm"], loop["friction_N"]]])
        axes.plot(line[0], line[1], color="#1b6ca8", alpha=shade, label=f"{label}: {energy:.4g} mJ")
        last_point = line[:, -1:]
    axes.axhline(0.0, color="0.4", linewidth=0.7)
    axes.set(xlabel=_PLACE, ylabel=style.FRICTION)
    axes.legend(title="work of a cycle")
    return figure


def film_map(film: Columns) -> tuple[Array, Array, Array, Array]:
    """Times (n,), places (m,), mm, film thickness (n, m), um, and pressure (n, m), MPa.

    film: a line for every time and node, as a run of cycles writes it; nodes hardly move.
    """
    times = np.unique(film["t_s"])
    h, p, x = (film[name].reshape(len(times), -1) for name in ("h_um", "p_MPa", "x_mm"))
    return times, x.mean(axis=0), h, p


def map_figure(film: Columns, loop: Columns) -> Figure:
    """Film thickness over time and place, and beside it the speed of the rod."""
    times, x, h, _ = film_map(film)
    figure = Figure(figsize=(6.4, 4.4))
    speed, axes = figure.subplots(1, 2, sharey=True, width_ratios=(1, 4))
    speed.plot(loop["rod_speed_mm_s"], loop["t_s"], color="#1b6ca8")
    speed.axvline(0.0, color="0.4", linewidth=0.7)
    speed.set(xlabel="$U$ [mm/s]", ylabel="$t$ [s]")
    thickness = np.clip(h, max(float(h.min()), 1e-3), _THICKEST)
    colours = axes.pcolormesh(
        x, times, thickness, norm=LogNorm(), shading="gouraud", cmap="viridis", rasterized=True
    )
    axes.set(xlabel=style.POSITION, xlim=_wetted(x, h))
    axes.grid(visible=False)
    figure.colorbar(colours, ax=axes, label=style.FILM)
    return figure


def moving_section(
    axes: Axes, p: Seal, outline: Columns
) -> Callable[[float, float], tuple[Polygon, Line2D]]:
    """Draw the section in its gland, with marks on the rod; how they move, and what moves.

    outline: a line for every time and node. The function that moves takes a time (s) and the place
    of the rod (mm).
    """
    times = np.unique(outline["t_s"])
    points = np.stack([outline["z_mm"], outline["r_mm"]], axis=1).reshape(len(times), -1, 2)
    draw_gland(axes, p)
    ring = Polygon(points[0], facecolor="#f0b86a", edgecolor="#3b3f45", linewidth=0.9)
    axes.add_patch(ring)
    spacing = 0.6 * p.section_diameter
    (marks,) = axes.plot([], [], color="#3b3f45", linestyle="", marker=TICKDOWN, markersize=6)

    def show(t: float, position: float) -> tuple[Polygon, Line2D]:
        ring.set_xy(points[int(np.argmin(abs(times - t)))])
        z = position % spacing + spacing * np.arange(-8.0, 8.0)
        marks.set_data(z, np.full_like(z, 0.5 * p.rod_diameter))
        return ring, marks

    return show


def write_animation(path: Path, p: Seal, film: Columns, loop: Columns, outline: Columns) -> None:
    """Section, film and pressure through a cycle with the place of the rod, as a GIF.  OSError.

    outline: the deformed outline of the section, a line for every time and node of it.
    """
    times, x, h, pressures = film_map(film)
    figure = Figure(figsize=(5.0, 7.4), dpi=80)
    gland, pressure, thickness, loop_axes = figure.subplots(4, 1, height_ratios=(4.5, 3, 3, 1))
    move = moving_section(gland, p, outline)
    gland.set(xlabel="$z$ [mm]", ylabel="$r$ [mm]")
    limits, maximum = _wetted(x, h), float(pressures.max())
    (line_p,) = pressure.plot(x, pressures[0], color="#c8553d")
    pressure.set(ylabel="$p$ [MPa]", xlim=limits, ylim=(-0.05 * maximum, 1.1 * maximum))
    (line_h,) = thickness.semilogy(x, h[0], color="#1b6ca8")
    low = max(0.7 * float(h.min()), 1e-3)
    thickness.set(ylabel="$h$ [µm]", xlabel="$x$ [mm]", xlim=limits, ylim=(low, _THICKEST))
    loop_axes.plot(loop["place_mm"], loop["friction_N"], color="0.7", linewidth=1.0)
    (dot,) = loop_axes.plot([], [], color="#1b6ca8", marker="o")
    loop_axes.set(xlabel=_PLACE, ylabel="$F$ [N]")

    def show(t: float) -> None:
        at = int(np.argmin(abs(times - t)))
        line_p.set_ydata(pressures[at])
        line_h.set_ydata(np.maximum(h[at], 1e-3))
        dot.set_data([loop["place_mm"][at]], [loop["friction_N"][at]])
        move(t, float(loop["place_mm"][at]))

    moving = (line_p, line_h, dot, *move(float(times[0]), 0.0))
    moments = np.linspace(times[0], times[-1], 80)
    first, *others = _frames(figure, moving, show, moments)
    with replacing(path) as temporary:
        first.save(temporary, "GIF", save_all=True, append_images=others, duration=62, loop=0)


def _frames(
    figure: Figure, moving: Sequence[Artist], show: Callable[[float], None], moments: Array
) -> list[Image]:
    """Pictures of a figure after show(t) for each moment; only what moves is drawn again."""
    canvas: Any = FigureCanvasAgg(figure)
    for artist in moving:
        artist.set_animated(True)
    canvas.draw()
    background, frames = canvas.copy_from_bbox(figure.bbox), []
    for t in moments.tolist():
        show(t)
        canvas.restore_region(background)
        for artist in moving:
            figure.draw_artist(artist)
        frames.append(fromarray(np.array(canvas.buffer_rgba())).convert("RGB"))
    return frames


def _wetted(x: Array, h: Array) -> tuple[float, float]:
    """Both ends, mm, of the places whose film is thin enough at some time to be shown."""
    inside = np.flatnonzero(h.min(axis=0) < _THICKEST)
    return (float(x[inside[0]]), float(x[inside[-1]])) if len(inside) > 1 else (x[0], x[-1])
