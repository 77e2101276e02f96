"""The drawings of docs/sections.md: every section with its dimensions; `make pictures`.

Blue marks the film, red the sealed pressure; the axis of the rod is below.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from math import cos, radians, sin
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from softehl.cases.seal.gland.sections.section_keys import capped
from softehl.cases.seal.gland.sections.shapes import (
    SECTIONS,
    DRing,
    Rectangular,
    Trapezoid,
    UCup,
    XRing,
)
from softehl.cases.seal.meshing.outline import Point, Shape
from softehl.cases.seal.meshing.outline_mesh import outline_mesh

FILM, PRESSURE, BODY, CAP = "#1b6ca8", "#c8553d", "#f2e3c0", "#b9c4cf"
CAP_THICKNESS = 0.6
"""Of the drawing, mm: that of the command beside it."""

_STYLE: Any = {"font.size": 7.5, "axes.linewidth": 0.6, "figure.dpi": 130}
_ARROW = {"arrowstyle": "<->", "linewidth": 0.6, "shrinkA": 0, "shrinkB": 0, "color": "#3b3f45"}
_POINTER = {**_ARROW, "arrowstyle": "->"}


def main(folder: Path) -> None:
    """Write every drawing into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    with matplotlib.rc_context(_STYLE):
        for name in SECTIONS:
            save(drawing(name), folder / f"section_{name}.png")
        save(cap(), folder / "section_capped.png")
        save(meshes(), folder / "section_meshes.png")


def save(figure: Figure, to: Path) -> None:
    """With a palette: a third of the bytes."""
    figure.savefig(to)
    Image.open(to).convert("RGB").quantize(64).save(to, "PNG", optimize=True)


def drawing(name: str) -> Figure:
    """A section with its dimensions."""
    shape = SECTIONS[name]().shape(2.0 * SECTIONS[name]().height)
    figure = Figure(figsize=(3.4, 3.1))
    axes = figure.add_axes((0.02, 0.02, 0.96, 0.96))
    outline_of(axes, shape)
    a, b, c, d = shape.outline.box
    span(axes, (c + 0.42, b), (c + 0.42, d), "section_diameter", upright=True)
    DIMENSIONS[name](axes, (a, b, c, d))
    axes.set_aspect("equal")
    axes.set_xlim(a - 1.0, c + 1.0)
    axes.set_ylim(b - 0.95, d + 0.95)
    axes.set_axis_off()
    return figure


def cap() -> Figure:
    """A square ring with a cap on the side of the rod."""
    section = Rectangular()
    shape = capped(section.shape(2.0 * section.height), CAP_THICKNESS)
    figure = Figure(figsize=(3.4, 2.9))
    axes = figure.add_axes((0.02, 0.02, 0.96, 0.96))
    outline_of(axes, shape)
    near = shape.parts[0]
    axes.fill(*near.at(np.linspace(0.0, near.length, 800)).T, color=CAP, zorder=0.5)
    a, b, c, d = shape.outline.box
    axes.plot([a, c], [b + CAP_THICKNESS] * 2, color="#3b3f45", linewidth=0.9)
    span(axes, (c + 0.2, b), (c + 0.2, b + CAP_THICKNESS), "cap_thickness", upright=True)
    axes.text(0.0, b + 0.5 * CAP_THICKNESS, "materials.cap", ha="center", va="center")
    axes.text(0.0, 0.5 * (b + d), "the material of the seal", ha="center", va="center")
    axes.set_aspect("equal")
    axes.set_xlim(a - 0.3, c + 0.7)
    axes.set_ylim(b - 0.3, d + 0.3)
    axes.set_axis_off()
    return figure


def outline_of(axes: Axes, shape: Shape) -> None:
    """The body, and the parts of its outline that carry film and pressure."""
    outline = shape.outline
    axes.fill(*outline.at(np.linspace(0.0, outline.length, 1500)).T, color=BODY, zorder=0)
    parts = ((0.0, outline.length), "#3b3f45", 0.9), (shape.pressure, PRESSURE, 2.0)
    for (first, last), colour, width in (*parts, (shape.film, FILM, 2.0)):
        whole = last - first == outline.length
        length = outline.length if whole else (last - first) % outline.length
        axes.plot(
            *outline.at(np.linspace(first, first + length, 1000)).T, color=colour, linewidth=width
        )


def span(axes: Axes, a: Point, b: Point, text: str, upright: bool = False) -> None:
    """An arrow from a to b and what it measures."""
    axes.annotate("", a, b, arrowprops=_ARROW)
    z, r = 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])
    turned = {"rotation": 90, "ha": "left", "va": "center"}
    flat = {"ha": "center", "va": "bottom"}
    shift = (0.06, 0.0) if upright else (0.0, 0.05)
    axes.text(z + shift[0], r + shift[1], text, **(turned if upright else flat))


def arc(axes: Axes, centre: Point, radius: float, angle: float, text: str, away: float) -> None:
    """A pointer to an arc from its centre on, and the name of the radius behind it."""
    way = cos(radians(angle)), sin(radians(angle))
    tip = centre[0] + radius * way[0], centre[1] + radius * way[1]
    foot = tip[0] + away * way[0], tip[1] + away * way[1]
    start, side = (centre, foot) if away > 0.0 else (foot, centre)
    axes.annotate("", tip, start, arrowprops=_POINTER)
    if away > 0.0:
        axes.plot([tip[0], side[0]], [tip[1], side[1]], color="#3b3f45", linewidth=0.6)
    place = foot
    ha = "left" if way[0] * (1 if away > 0 else -1) > 0.3 else "right" if away > 0 else "center"
    axes.text(place[0], place[1], text, ha=ha, va="center")


Box = tuple[float, float, float, float]


def width_below(axes: Axes, box: Box) -> None:
    """section_width, under the section."""
    span(axes, (box[0], box[1] - 0.5), (box[2], box[1] - 0.5), "section_width")


def _round(axes: Axes, box: Box) -> None:
    axes.plot([0.0], [0.5 * (box[1] + box[3])], "+", color="#3b3f45", markersize=6)


def _rectangular(axes: Axes, box: Box) -> None:
    width_below(axes, box)
    f = Rectangular().corner_radius
    arc(axes, (box[2] - f, box[3] - f), f, 60.0, "corner_radius", 0.3)


def _x_ring(axes: Axes, box: Box) -> None:
    section = XRing()
    width_below(axes, box)
    lobe, fillet = section.lobe_radius, section.fillet_radius
    z, r = box[2] - lobe, box[3] - lobe
    arc(axes, (z, r), lobe, 62.0, "lobe_radius", 0.2)
    middle = 0.5 * (box[1] + box[3])
    under = ((lobe + fillet) ** 2 - z**2) ** 0.5
    arc(axes, (0.0, r + under), fillet, -90.0, "", -fillet)
    axes.text(0.0, r + under + 0.08, "fillet_radius", ha="center")
    axes.plot([0.0], [middle], "+", color="#3b3f45", markersize=6)


def _d_ring(axes: Axes, box: Box) -> None:
    section = DRing()
    width_below(axes, box)
    f, nose = section.corner_radius, section.nose_radius
    arc(axes, (0.0, box[1] + nose), nose, -115.0, "", 0.01)
    axes.text(0.12, box[1] + nose - 0.1, "nose_radius", ha="left")
    arc(axes, (box[2] - f, box[3] - f), f, 60.0, "corner_radius", 0.3)


def _trapezoid(axes: Axes, box: Box) -> None:
    section = Trapezoid()
    half, f = 0.5 * section.width, section.corner_radius
    span(axes, (-half, box[3] + 0.35), (half, box[3] + 0.35), "section_width")
    foot = 0.5 * section.rod_width
    span(axes, (-foot, box[1] - 0.5), (foot, box[1] - 0.5), "rod_width")
    arc(axes, (box[0] + 1.25 * f, box[3] - f), f, 140.0, "", 0.25)
    axes.text(box[0] - 0.3, box[3] - 0.95, "corner_radius", ha="center", rotation=90, va="center")


def _u_cup(axes: Axes, box: Box) -> None:
    section = UCup()
    middle = 0.5 * (box[1] + box[3])
    width_below(axes, box)
    heel = 0.5 * section.heel_height
    span(axes, (box[2] - 0.75, middle - heel), (box[2] - 0.75, middle + heel), "heel_height", True)
    left, opening = box[0], 0.5 * section.mouth_opening
    span(axes, (left, middle - 0.1), (left + section.mouth_depth, middle - 0.1), "mouth_depth")
    span(axes, (left - 0.15, middle - opening), (left - 0.15, middle + opening), "", upright=True)
    axes.text(left - 0.25, middle, "mouth_opening", rotation=90, ha="right", va="center")
    root = 0.5 * section.mouth_root
    deep = left + section.mouth_depth + 0.12
    span(axes, (deep, middle - root), (deep, middle + root), "", upright=True)
    axes.text(deep + 0.08, middle + 0.1, "mouth_root", ha="left", va="center", rotation=90)
    top = box[3] + 0.35
    span(axes, (left, top), (left + section.bevel, top), "bevel")
    axes.annotate(
        "edge_radius",
        (left + section.bevel + 0.04, box[3] - 0.02),
        (left + 1.9, box[3] + 0.45),
        arrowprops=_POINTER,
    )
    axes.annotate(
        "corner_radius", (box[2] - 0.05, middle + heel - 0.05), (box[2] - 0.5, box[3] + 0.3),
        arrowprops=_POINTER, ha="center",
    )  # fmt: skip


DIMENSIONS: dict[str, Callable[[Axes, Box], None]] = {
    "round": _round,
    "rectangular": _rectangular,
    "x_ring": _x_ring,
    "d_ring": _d_ring,
    "trapezoid": _trapezoid,
    "u_cup": _u_cup,
}


def meshes() -> Figure:
    """A mesh of an X-ring and of a U-cup at density 1."""
    figure = Figure(figsize=(6.8, 2.9))
    for name, place in (("x_ring", (0.01, 0.02, 0.45, 0.96)), ("u_cup", (0.47, 0.02, 0.52, 0.96))):
        shape = SECTIONS[name]().shape(50.0)
        mesh = outline_mesh(shape, shape.film, None, 42, 1)
        axes = figure.add_axes(place)
        loops = mesh.points[np.concatenate([mesh.quads, mesh.quads[:, :1]], axis=1)]
        for loop in loops:
            axes.plot(*loop.T, color="#3b3f45", linewidth=0.35)
        axes.plot(*mesh.points[mesh.arc_nodes].T, color=FILM, linewidth=1.6)
        axes.set_aspect("equal")
        axes.set_axis_off()
    return figure


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "pictures"))
