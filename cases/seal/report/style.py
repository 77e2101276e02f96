"""The look that the pictures of a run share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # imported late: matplotlib is slow to import
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from softehl.cases.seal.gland.parameters import Seal
    from softehl.cases.seal.gland.records.gland import Gland

STYLE: Any = {
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": "medium",
    "axes.titley": 1.0,  # else every drawing looks for room three times
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
STROKES = {"out": "outstroke", "in": "instroke"}
COLOURS = {"out": "#1b6ca8", "in": "#c8553d"}
MARKERS = {"out": "o", "in": "s"}

POSITION = "x [mm]   (sealed side left, air side right)"
PRESSURE = "pressure p [MPa]"
FILM = "film thickness h [µm]"
H_STAR = "film thickness h* = 2q / |U| [µm]"
SPEED = "rod speed |U| [mm/s]"


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


def radial_axis(axes: Axes, p: Gland) -> None:
    """Radii at the axis of a picture, upwards: those of a piston seal are counted negative."""
    axes.set_ylabel("r [mm]")
    axes.yaxis.set_major_formatter(lambda r, _: f"{abs(r):.4g}")
    if p.piston and not axes.yaxis_inverted():
        axes.invert_yaxis()


def write_head(figure: Figure, text: str, left: float) -> None:
    """Write what a picture is about at its top, from `left` (inches) on."""
    width, height = figure.get_size_inches()
    figure.text(
        left / width, 1.0 - 0.08 / height, text, ha="left", va="top", fontsize=7.5, color="0.25"
    )


def set_margins(
    figure: Figure, left: float, right: float, bottom: float, top: float, between: float = 0.0
) -> None:
    """Margins of the panels in inches; a layout that is computed costs as much as the drawing."""
    width, height = figure.get_size_inches()
    figure.subplots_adjust(
        left=left / width,
        right=1.0 - right / width,
        bottom=bottom / height,
        top=1.0 - top / height,
        wspace=between,
        hspace=between,
    )
