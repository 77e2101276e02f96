"""The gland and the free ring before it is squeezed, with their measures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from softehl.cases.seal.report import style
from softehl.cases.seal.report.section import draw_gland
from softehl.cases.seal.section.uniform_layout import uniform_layout

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from softehl.cases.seal.gland.parameters import Seal


def gland_figure(p: Seal) -> Figure:
    """The section as it is made, at its radius on the rod, and the gland that it goes into."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Polygon

    figure = Figure(figsize=(4.6, 4.2))
    axes = figure.subplots()
    draw_gland(axes, p)
    rod, housing = 0.5 * p.rod_diameter, 0.5 * p.housing_diameter
    left, right, size = p.sealed_wall, p.air_wall, p.section_diameter
    contour = uniform_layout(p).contour - [0.0, 0.5 * p.inner_diameter - rod]
    axes.add_patch(Polygon(contour, facecolor="#f2c14e", edgecolor="#3b3f45"))
    _measure(axes, (left, housing), (right, housing), f"{p.groove_width:.4g}", (0, 5))
    _measure(axes, (right, rod), (right, housing), f"{p.depth:.4g}", (5, 0))
    _measure(
        axes, (-0.5 * size, rod + 0.5 * size), (0.5 * size, rod + 0.5 * size), f"{size:.4g}", (0, 4)
    )
    axes.set_xlabel("z [mm]   (sealed side left, air side right)")
    style.radial_axis(axes, p)
    axes.set_title(style.between(p))
    style.set_margins(figure, left=0.6, right=0.1, bottom=0.5, top=0.35)
    return figure


def fit_numbers(p: Seal) -> list[tuple[str, float, str]]:
    """Fit of the ring in its gland: name, value, unit."""
    return [
        ("squeeze", p.squeeze_percent, "%"),
        ("stretch", p.stretch_percent, "%"),
        ("gland fill", p.fill_percent, "%"),
        ("shear modulus of the rubber", p.shear_modulus, "MPa"),
        ("viscosity of the oil", p.viscosity * 1e9, "mPa s"),
    ]


def _measure(
    axes: Axes,
    start: tuple[float, float],
    end: tuple[float, float],
    text: str,
    shift: tuple[float, float],
) -> None:
    """An arrow with both ends and a length."""
    axes.annotate(
        "", end, start, arrowprops={"arrowstyle": "<|-|>", "linewidth": 0.7, "color": "0.2"}
    )
    middle = 0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1])
    axes.annotate(
        text,
        middle,
        xytext=shift,
        textcoords="offset points",
        fontsize="small",
        ha="center" if shift[1] else "left",
        va="bottom" if shift[1] else "center",
    )
