"""Pictures of cycles: friction over the place of the rod, the film over time, an animation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import trapezoid

from softehl.cases.seal.report import style
from softehl.runtime.arrays import Array
from softehl.runtime.io import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Table = Mapping[str, Array]

_THICKEST = 20.0  # um, of the film that is shown
_FRAMES, _PER_SECOND = 80, 16
_PLACE = "place of the rod [mm]   (+ = to the air side)"


def loop_figure(loops: Mapping[str, Table]) -> Figure:
    """Friction on the rod over its place, a line a cycle, with the work it takes.

    loops: label -> readings of a cycle.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.4, 3.6), layout="constrained")
    axes = figure.subplots()
    for number, (label, loop) in enumerate(loops.items()):
        shade = 0.25 + 0.75 * (number + 1) / len(loops)
        words = f"{label}: {work_mJ(loop):.4g} mJ"
        axes.plot(loop["place_mm"], loop["friction_N"], color="#1b6ca8", alpha=shade, label=words)
    axes.axhline(0.0, color="0.4", linewidth=0.7)
    axes.set(xlabel=_PLACE, ylabel="friction on the rod [N]")
    axes.legend(title="work of a cycle")
    return figure


def work_mJ(loop: Table) -> float:
    """Work of friction along the readings of a cycle."""
    return float(trapezoid(loop["friction_N"] * loop["rod_speed_mm_s"], loop["t_s"]))


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


def write_animation(path: Path, film: Table, loop: Table) -> None:
    """Film and pressure through a cycle with the place of the rod, as a GIF.  Raises OSError."""
    from matplotlib.animation import FuncAnimation, PillowWriter
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    times, x, h, p = film_map(film)
    figure = Figure(figsize=(5.0, 4.6), dpi=80, layout="constrained")
    FigureCanvasAgg(figure)
    pressure, thickness, place = figure.subplots(3, 1, height_ratios=(3, 3, 1))
    limits = _wetted(x, h)
    (line_p,) = pressure.plot(x, p[0], color="#c8553d")
    pressure.set(ylabel="$p$ [MPa]", xlim=limits, ylim=(-0.05 * p.max(), 1.1 * p.max()))
    (line_h,) = thickness.semilogy(x, h[0], color="#1b6ca8")
    low = max(0.7 * float(h.min()), 1e-3)
    thickness.set(ylabel="$h$ [µm]", xlabel="$x$ [mm]", xlim=limits, ylim=(low, _THICKEST))
    place.plot(loop["place_mm"], loop["friction_N"], color="0.7", linewidth=1.0)
    (dot,) = place.plot([], [], color="#1b6ca8", marker="o")
    place.set(xlabel=_PLACE, ylabel="$F$ [N]")

    def show(t: float) -> Sequence[object]:
        at = int(np.argmin(abs(times - t)))
        line_p.set_ydata(p[at])
        line_h.set_ydata(np.maximum(h[at], 1e-3))
        dot.set_data([loop["place_mm"][at]], [loop["friction_N"][at]])
        return line_p, line_h, dot

    moments = np.linspace(times[0], times[-1], _FRAMES).tolist()
    moving = FuncAnimation(figure, show, frames=moments)  # type: ignore[arg-type]
    with replacing(path) as temporary:
        named = temporary.with_name(f"{temporary.name}.gif")
        moving.save(named, writer=PillowWriter(fps=_PER_SECOND))
        named.replace(temporary)


def _wetted(x: Array, h: Array) -> tuple[float, float]:
    """Where the film is ever thin enough to be shown, mm."""
    inside = np.flatnonzero(h.min(axis=0) < _THICKEST)
    return (float(x[inside[0]]), float(x[inside[-1]])) if len(inside) > 1 else (x[0], x[-1])
