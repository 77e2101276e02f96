"""Drawing of the gland and of the free ring before it is squeezed, with their measures."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.report import style
from softehl.cases.seal.report.section import draw_gland
from softehl.cases.seal.section.layout import uniform_layout


def gland_figure(p: Seal) -> Figure:
    """The section as it is made, at its radius on the rod, and the gland that it goes into."""
    figure = Figure(figsize=(4.6, 4.2))
    axes = figure.subplots()
    draw_gland(axes, p)
    rod, housing = 0.5 * p.rod_diameter, 0.5 * p.housing_diameter
    left, right, size = p.sealed_wall, p.air_wall, p.section_diameter
    contour = uniform_layout(p).contour - [0.0, 0.5 * p.inner_diameter - rod]
    axes.add_patch(Polygon(contour, facecolor="#f2c14e", edgecolor="#3b3f45"))
    middle = rod + 0.5 * size
    _measure(axes, (left, housing), (right, housing), p.groove_width)
    _measure(axes, (right, rod), (right, housing), p.depth)
    _measure(axes, (-0.5 * size, middle), (0.5 * size, middle), size)
    axes.set_xlabel("z [mm]   (sealed side left, air side right)")
    style.radial_axis(axes, p)
    axes.set_title(style.between(p))
    return figure


def fit_numbers(p: Seal) -> dict[str, tuple[float, str]]:
    """Fit of the ring in its gland: name -> value, unit."""
    return {
        "squeeze": (p.squeeze_percent, "%"),
        "stretch": (p.stretch_percent, "%"),
        "gland fill": (p.fill_percent, "%"),
        "shear modulus of the rubber": (p.shear_modulus, "MPa"),
        "viscosity of the oil": (p.viscosity * 1e9, "mPa s"),
    }


def _measure(axes: Axes, start: style.Place, end: style.Place, length: float) -> None:
    """An arrow with both ends and its length, above it or, if it is upright, beside it."""
    arrow = {"arrowstyle": "<|-|>", "linewidth": 0.7, "color": "0.2"}
    axes.annotate("", end, start, arrowprops=arrow)
    middle = 0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1])
    shift = (5, 0) if start[0] == end[0] else (0, 5)
    style.write_beside(axes, middle, f"{length:.4g}", shift, fontsize="small")
