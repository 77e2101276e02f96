"""The deformed section in its gland: stress in the ring, pressure on the rod and the housing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation, TriContourSet

from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records import FreeSeal, Gland
from softehl.cases.seal.report import style
from softehl.cases.seal.report.paraview import gland_lines
from softehl.cases.seal.states.state import FilmRow, Profile, Section
from softehl.cases.seal.states.state_files import read_profile, read_section
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation.postprocessing import von_mises
from softehl.runtime.mesh.face_matching import unrepeated_faces

_METAL, _FLUID, _FILM, _CONTACT, _LINE = "#d9dadd", "#d3e6f5", "#1b6ca8", "#8a8f98", "#3b3f45"
_STRESSES = tuple(f"sigma_{name}" for name in ("zz", "rr", "tt", "zr"))
_AROUND = 0.44
"""Margin of the picture around the gland, in section diameters."""


@dataclass(frozen=True, eq=False)
class View:
    """A state to be drawn: its row of the curve, the profile of its film and its section."""

    row: FilmRow
    profile: Profile
    section: Section


def views_of(folder: Path, rows: Sequence[FilmRow]) -> list[View]:
    """Of each stroke the row of the highest speed, where the film changes the contact most.

    Raises OSError, ValueError.
    """
    fastest = [rising[-1] for rising in style.by_stroke(rows).values()]
    return [View(row, read_profile(folder, row), read_section(folder, row)) for row in fastest]


def nodal_von_mises(section: Section) -> Array:
    """Von Mises stress (n,) at the nodes of a section that has its Cauchy stresses, MPa."""
    return von_mises(*(section.point_data[name] for name in _STRESSES))


def boundary_edges(cells: Integers) -> Integers:
    """Edges (b, 2) that only one of the cells (m, 4) has, in the sense of the cells."""
    return unrepeated_faces(
        np.stack([cells, np.roll(cells, -1, axis=1)], axis=-1).reshape(-1, 2), corners=2
    )


@dataclass(frozen=True, eq=False)
class Scale:
    """Legend of colours and bands.  levels: of stress, MPa; height: of a band, mm for 1 MPa."""

    levels: Array
    height: float

    @classmethod
    def of(cls, p: FreeSeal, views: Sequence[View]) -> Scale:
        """One scale for several states; the largest pressure is a quarter of a section high."""
        stress = max(float(nodal_von_mises(view.section).max()) for view in views)
        pressure = max(
            float(max(view.profile.p_MPa.max(), view.section.point_data["contact_pressure"].max()))
            for view in views
        )
        levels = np.asarray(MaxNLocator(14).tick_values(0.0, stress))
        return cls(levels, 0.25 * p.section_diameter / pressure)


def section_figure(p: Seal, views: Sequence[View]) -> Figure:
    """A panel for each state, all with one scale of stress and one of pressure."""
    scale, figure = Scale.of(p, views), Figure((3.3 * len(views) + 1.5, 4.2), layout="compressed")
    panels = figure.subplots(1, len(views), sharey=True, squeeze=False)[0]
    for axes, view in zip(panels, views, strict=True):
        contours = draw_view(axes, p, view, scale)
        speed = f"{view.row.rod_speed_mm_s:+g}".replace("-", "\N{MINUS SIGN}")
        film = f"U = {speed} mm/s, h* = {view.row.h_star_um:.3g} µm"
        axes.set_title(f"{style.STROKES[view.row.stroke]}, {film}")
        axes.set_xlabel("z [mm]")
    style.radial_axis(panels[0], p)
    write_colours(figure, panels[-1], contours)
    style.write_head(figure, style.subject(p))
    return figure


def write_colours(figure: Figure, axes: Axes, contours: TriContourSet) -> None:
    """The colours of the stress beside a panel, as high as it."""
    colour_axes = axes.inset_axes((1.04, 0.0, 0.04, 1.0))
    figure.colorbar(contours, cax=colour_axes, label="von Mises stress [MPa]")


def draw_view(axes: Axes, p: Seal, view: View, scale: Scale) -> TriContourSet:
    """One state in its gland; what a colour bar needs."""
    draw_gland(axes, p, 0.5 * (view.row.contact_start_mm + view.row.contact_end_mm))
    contours = _draw_ring(axes, view.section, scale.levels)
    _draw_film(axes, p, view.profile, scale.height)
    _draw_contact(axes, p, view.section, scale.height)
    _draw_motion(axes, p, view.row.rod_speed_mm_s)
    return contours


def draw_gland(axes: Axes, p: Seal, middle: float | None = None) -> None:
    """Rod, housing with its walls, and the fluid on the sealed side; limits of the picture.

    Walls that have no end in the model end just above the rod. middle: where the seal touches the
    rod and hides the end of the fluid, mm; that of the groove.
    """
    size, rod, housing = p.section_diameter, 0.5 * p.rod_diameter, 0.5 * p.housing_diameter
    line, groove, wall = gland_lines(p, clearance=0.06 * size)
    around = _AROUND * size
    if p.sealed_pressure:
        edge = p.groove_centre if middle is None else middle
        left = line[0, 0]
        axes.fill([left, edge, edge, left], [rod, rod, housing, housing], color=_FLUID, lw=0)
    metal: Any = {"facecolor": _METAL, "edgecolor": _LINE, "linewidth": 0.9}
    axes.fill(*np.concatenate([line, line[::-1] - [0.0, size]]).T, **metal)
    axes.fill(*np.concatenate([groove, wall[::-1]]).T, **metal)
    sides = p.sealed_wall - around, p.air_wall + around
    axes.set(xlim=sides, ylim=(rod - around, housing + around))
    axes.set_aspect("equal")
    axes.grid(visible=False)


def _draw_ring(axes: Axes, section: Section, levels: Array) -> TriContourSet:
    """The stress in bands of colour, and the outline."""
    cells = section.cells
    triangles = np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    grid = Triangulation(section.points[:, 0], section.points[:, 1], triangles)
    stress = nodal_von_mises(section)
    contours: TriContourSet = axes.tricontourf(grid, stress, levels=levels, cmap="YlOrRd")
    edges = section.points[boundary_edges(cells)]
    axes.add_collection(LineCollection(list(edges), colors=_LINE, linewidths=0.9))
    return contours


def _draw_film(axes: Axes, p: Gland, profile: Profile, height: float) -> None:
    """Film pressure as a band in the rod.  height: mm for 1 MPa."""
    rod, x, film = 0.5 * p.rod_diameter, profile.x_mm, np.maximum(profile.p_MPa, 0.0)
    axes.fill_between(x, rod, rod - height * film, color=_FILM, lw=0)
    text, below = f"film pressure, max {film.max():.3g} MPa", rod - height * film.max()
    style.write_beside(axes, (p.groove_centre, below), text, (0, 3 if p.piston else -3))


def _draw_contact(axes: Axes, p: Gland, section: Section, height: float) -> None:
    """Contact pressure as bands in the housing and its walls.  height: mm for 1 MPa."""
    pressure = section.point_data["contact_pressure"]
    edges = boundary_edges(section.cells)
    tips = section.points + height * pressure[:, None] * _normals(section.points, edges)
    loaded = edges[(pressure[edges] > 0.0).any(axis=1)]
    sides = [section.points[loaded], tips[loaded[:, ::-1]]]
    bands = PolyCollection(list(np.concatenate(sides, axis=1)), linewidths=0.4)
    bands.set_color(_CONTACT)
    axes.add_collection(bands)
    above = 0.5 * p.housing_diameter + height * pressure.max()
    text = f"contact pressure, max {pressure.max():.3g} MPa"
    style.write_beside(axes, (p.groove_centre, above), text, (0, -3 if p.piston else 3))


def _normals(points: Array, edges: Integers) -> Array:
    """Outward unit normals (n, 2) at the ends of boundary edges, zero elsewhere."""
    along = points[edges[:, 1]] - points[edges[:, 0]]
    across = np.stack([along[:, 1], -along[:, 0]], axis=1)
    total = np.zeros_like(points)
    for side in (0, 1):
        np.add.at(total, edges[:, side], across)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.asarray(np.divide(total, length, out=total, where=length > 0.0))


def _draw_motion(axes: Axes, p: Gland, speed: float) -> None:
    """An arrow the way the rod goes."""
    half = 0.3 * p.section_diameter * np.sign(speed)
    level = 0.5 * p.rod_diameter - (_AROUND - 0.05) * p.section_diameter
    axes.annotate(
        "",
        (p.groove_centre + half, level),
        (p.groove_centre - half, level),
        arrowprops={"arrowstyle": "-|>", "color": _LINE, "linewidth": 1.2},
    )
