"""Pictures of README, docs/oring.md and docs/first-seal.md, from our own runs: `make pictures`.

Eight runs of seals are solved (a minute or two); the times of the kernels are those of
benchmarks/README.md.  The files are the same every time on one machine.
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from PIL import Image

import softehl
from softehl.cases.harness.report.part import FinishedRun
from softehl.cases.oring import CASE, PICTURES
from softehl.cases.paper.states import PAPER
from softehl.cases.seal.report import style
from softehl.cases.seal.report.pictures import write_plots
from softehl.cases.seal.report.section import Scale, View, draw_view, write_colours
from softehl.cases.seal.states.state_files import read_profile, read_section
from softehl.runtime.results.result import Result

SIZE = (2.5, 2.3)
"""Of each picture, inches: four stand side by side."""
SPEEDS = (1600.0, 800.0, 400.0, 200.0, 100.0)
PRESSED = softehl.Seal(
    density=4, sealed_pressure=5.0, stroke="out", speeds=(1600.0,), error_estimate=False
)
DEFAULT = softehl.Seal()
SWEPT = softehl.Seal(stroke="in", speeds=SPEEDS, error_estimate=False)
STABLE = softehl.Seal(stroke="in", speeds=(100.0,), error_estimate=False)
PAPERS = STABLE.model_copy(update=PAPER)
_FIRST: Any = {"stroke": "out", "speeds": (800.0,), "error_estimate": False}
_NBR_90: Any = {"ring": "AS568-210", "rod": 19.0, "shore_A": 90.0, "sealed_pressure": 10.0}
_GLAND: Any = {"housing_diameter": 56.4}
FIRST = {
    "first_o_ring": softehl.Seal(**_FIRST, **_NBR_90),
    "first_x_ring": softehl.Seal(**_FIRST, **_GLAND, section="x_ring", groove_width=4.3),
    "first_u_cup": softehl.Seal(**_FIRST, **_GLAND, section="u_cup", groove_width=6.0),
}
"""The worked designs of docs/first-seal.md, by the names of their pictures."""
BENCHMARKS = Path(__file__).parents[1] / "benchmarks" / "README.md"
README = Path(__file__).parents[1] / "README.md"

_STYLE: Any = {
    **style.STYLE,
    "axes.labelpad": 1.5,
    "axes.labelsize": 7.5,
    "axes.linewidth": 0.6,
    "axes.titlesize": 8,
    "figure.dpi": 200,
    "font.size": 7,
    "legend.fontsize": 6.5,
    "legend.handlelength": 1.4,
    "lines.linewidth": 1.2,
    "xtick.labelsize": 7,
    "xtick.major.width": 0.6,
    "ytick.labelsize": 7,
    "ytick.major.width": 0.6,
}


def main(folder: Path) -> None:
    """Write every picture into the folder."""
    with tempfile.TemporaryDirectory() as place:
        runs = {
            "default": DEFAULT,
            "pressed": PRESSED,
            "swept": SWEPT,
            "stable": STABLE,
            "papers": PAPERS,
            **FIRST,
        }
        curves = dict(zip(runs, softehl.solve_cases(runs, place), strict=True))
        with matplotlib.rc_context(_STYLE):
            pictures = {
                "section": section(curves["pressed"]),
                "films": films(curves["swept"]),
                "stabilised": stabilised(curves["papers"], curves["stable"]),
                "kernels": kernels(BENCHMARKS.read_text(encoding="utf-8")),
                "front": front(*(p.read_text(encoding="utf-8") for p in (README, BENCHMARKS))),
                **{name: section(curves[name]) for name in FIRST},
            }
            folder.mkdir(parents=True, exist_ok=True)
            for name, figure in pictures.items():
                figure.savefig(folder / f"{name}.png", pil_kwargs={"optimize": True})
        default = curves["default"]
        write_plots(FinishedRun(default.folder, CASE, DEFAULT, default.rows))
        for name in PICTURES:
            shrink(default.folder / f"{name}.png", folder / f"run_{name}.png")


def shrink(picture: Path, to: Path) -> None:
    """Write a picture with a palette: a third of the bytes."""
    Image.open(picture).convert("RGB").quantize(128).save(to, "PNG", optimize=True)


def section(curve: softehl.Curve) -> Figure:
    """The deformed section in its gland."""
    (row,) = curve.rows
    view = View(row, read_profile(curve.folder, row), read_section(curve.folder, row))
    figure = Figure(figsize=SIZE, layout="compressed")
    axes = figure.subplots()
    shown = draw_view(axes, curve.parameters, view, Scale.of(curve.parameters, [view]))
    axes.set(xticks=[], yticks=[])
    axes.set_title(f"{curve.parameters.sealed_pressure:g} MPa from the left")
    for spine in axes.spines.values():
        spine.set_visible(False)
    write_colours(figure, axes, shown)
    return figure


def films(curve: softehl.Curve) -> Figure:
    """Film thickness along the contact, a line a speed."""
    figure = Figure(figsize=SIZE)
    axes = figure.subplots()
    shades = matplotlib.colormaps["viridis"](np.linspace(0.05, 0.85, len(curve.rows)))
    for row, colour in zip(curve.rows, shades, strict=True):
        profile = read_profile(curve.folder, row)
        label = f"{abs(row.rod_speed_mm_s):g}"
        axes.plot(profile.x_mm, profile.h_um, color=tuple(colour), label=label)
    axes.set(xlim=(-0.8, 1.3), ylim=(0.3, 30.0), yscale="log")
    style.tick_plainly(axes.yaxis)
    axes.set(xlabel="position $x$ [mm]", ylabel=style.FILM, title="instroke, 1 MPa")
    axes.legend(title="$|U|$ [mm/s]", title_fontsize=6.5, loc="upper center", ncols=2)
    return figure


def stabilised(papers: softehl.Curve, ours: softehl.Curve) -> Figure:
    """The film of the paper's scheme and ours, with the same number of unknowns."""
    figure = Figure(figsize=SIZE)
    axes = figure.subplots()
    for curve, label, colour in ((papers, "paper's scheme", "#c8553d"), (ours, "ours", "#1b6ca8")):
        profile = read_profile(curve.folder, curve.rows[0])
        axes.plot(profile.x_mm, profile.h_um, color=colour, label=label, linewidth=1.0)
    axes.set(xlim=(-0.65, 1.1), ylim=(0.0, 1.2), xticks=(-0.5, 0.0, 0.5, 1.0))
    axes.set(xlabel="position $x$ [mm]", ylabel=style.FILM)
    axes.set_title("100 mm/s, equal number of unknowns")
    axes.legend(loc="upper center")
    return figure


def kernels(page: str) -> Figure:
    """Times of one tangent of the plain quadrilateral, each generator at its best."""
    figure = Figure(figsize=SIZE)
    draw_times(figure.subplots(), page)
    return figure


def draw_times(axes: Any, page: str) -> None:
    """Bars of the table in the page of benchmarks."""
    found = re.findall(
        r"^\| Q4 B \| ([A-Za-z]+)[^|]*\| (\d+) \| \d+ \| [\d.]+ \|", page, re.MULTILINE
    )
    names, times = [name for name, _ in found], [float(time) for _, time in found]
    bars = axes.barh(names, times, color=["#1b6ca8", "#b9bdc4", "#b9bdc4"], height=0.6)
    axes.bar_label(bars, [f"{time:g} ns" for time in times], padding=2)
    axes.set(xlim=(0.0, 1.28 * max(times)), xlabel="time of one tangent [ns]")
    axes.set_title("hyperelastic element, one core")
    axes.invert_yaxis()
    axes.grid(visible=False, axis="y")


def front(readme: str, page: str) -> Figure:
    """First screen of README: its page, its beam and the time of a tangent."""
    (code,) = re.findall(r"^```python\n(.*?)^```", readme, re.MULTILINE | re.DOTALL)
    written: dict[str, Any] = {}
    exec(compile(code, "README.md", "exec"), written)  # prints the number of README
    figure = Figure(figsize=(10.0, 2.1))
    figure.set_layout_engine("none")
    text, body, bars = figure.subplots(1, 3, width_ratios=(5.2, 3.0, 2.2))
    law = re.search(r"@softehl\.page\n.*?(?=\n\n)", code, re.DOTALL)
    assert law is not None
    text.text(0.0, 0.5, law[0], family="monospace", fontsize=6.0, va="center", linespacing=1.5)
    text.set_axis_off()
    draw_deformed(figure, body, written["result"])
    draw_times(bars, page)
    text.set_title("the energy of an element, in SymPy", loc="left")
    body.set_title("a beam of it under a load")
    bars.set_title("its tangent, one core")
    figure.subplots_adjust(left=0.01, right=0.985, bottom=0.17, top=0.88, wspace=0.18)
    return figure


def draw_deformed(figure: Figure, axes: Any, result: Result) -> None:
    """Deformed quadrilaterals, coloured by the change of their areas."""
    mesh, moved = result.system.mesh, result.deformed(("u_x", "u_y"))
    cells = mesh.cells["quad4"]

    def areas(points: Any) -> Any:
        x, y = points[cells][..., 0], points[cells][..., 1]
        return 0.5 * (x * (np.roll(y, -1, 1) - np.roll(y, 1, 1))).sum(axis=1)

    ratio = areas(moved) / areas(mesh.points)
    far = float(np.abs(ratio - 1).max())
    drawn = PolyCollection(
        list(moved[cells]), array=ratio, cmap="coolwarm", edgecolor="#40404080", linewidth=0.3
    )
    drawn.set_clim(1 - far, 1 + far)
    axes.add_collection(drawn)
    axes.set_aspect("equal", adjustable="datalim")
    axes.autoscale_view()
    axes.set_axis_off()
    figure.colorbar(drawn, ax=axes, label="volume ratio $J$", shrink=0.7, pad=0.02)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "pictures"))
