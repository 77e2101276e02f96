"""Tables 1 and 2, the meshes of Fig. 3 and the deformed sections of Fig. 4."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from softehl.cases.paper.figure_spec import CsvTable, FigureContent, Item, Scope, density_words
from softehl.cases.paper.states import SPEEDS, Request, Store, ask, setup
from softehl.cases.seal.equations.system import build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records import DENSITIES
from softehl.cases.seal.states.state import contact_name
from softehl.runtime.io import number_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TABLE_1 = (
    ("Inner diameter of the seal, D_inner", "inner_diameter", "50.39", "mm"),
    ("Diameter of the seal, D_seal", "section_diameter", "3.53", "mm"),
    ("Rod diameter, D_rod", "rod_diameter", "50", "mm"),
    ("Inner diameter of the housing, D_housing", "housing_diameter", "56.3", "mm"),
    ("Elastic parameter, mu_1", "mu_1", "3.04", "MPa"),
    ("Elastic parameter, mu_2", "mu_2", "0.62", "MPa"),
    ("Elastic bulk modulus, kappa", "bulk_modulus", "500", "MPa"),
    ("Oil viscosity, eta_0", "viscosity", "6.59e-08", "MPa s"),
    ("Pressure-viscosity coefficient, alpha", "pressure_viscosity", "0.02", "1/MPa"),
    ("Cavitation penalty parameter, epsilon", "cavitation_penalty", "10000", "mm/(MPa s)"),
)
"""Table 1: quantity, our key, the paper's value, unit."""

TABLE_2 = {1: (1076, 109), 2: (3587, 217), 4: (12929, 433), 8: (48893, 865), 16: (189941, 1729)}
"""Table 2: density -> all unknowns and those of pressure, m_p = 4."""

FIG_4_PRESSURES = (0.0, 1.0, 2.0, 5.0)


def table_1(_: Store, __: Scope) -> FigureContent:
    """Table 1 and the defaults of the case."""
    default = Seal()
    rows: list[tuple[str, ...]] = [
        (title, key, number_text(getattr(default, key)), paper, unit)
        for title, key, paper, unit in TABLE_1
    ]
    rows.append(
        ("Rod speed, U", "speeds", f"+-{SPEEDS[-1]:g} to {SPEEDS[0]:g}", "+-25-1600", "mm/s")
    )
    rows.append(("Sealed pressure, p_s", "sealed_pressure", "0 to 5", "0-5", "MPa"))
    header = ("quantity", "key", "softehl", "paper", "unit")
    return FigureContent({"table1": CsvTable(header, rows)}, "The defaults of the case oring.")


def table_2_densities(scope: Scope) -> tuple[int, ...]:
    """All of the paper's, unless a density is asked for: counting takes no run."""
    return DENSITIES if scope.density is None else scope.meshes(DENSITIES)


@cache
def counted(p: Seal) -> tuple[int, int]:
    """Numbers of all unknowns and of those of pressure of a case."""
    system = build_system(p)
    return system.layout.total, system.pressure_count


def unknowns(density: int) -> tuple[int, int]:
    """Numbers of unknowns and of pressures of a mesh, m_p = 4."""
    return counted(setup(density, 1.0))


def table_2(_: Store, scope: Scope) -> FigureContent:
    """Numbers of unknowns of our meshes beside the paper's."""
    rows = []
    for density in table_2_densities(scope):
        total, film = unknowns(density)
        rows.append((density, total, TABLE_2[density][0], film, TABLE_2[density][1]))
    header = ("density", "unknowns", "unknowns_paper", "pressures", "pressures_paper")
    return FigureContent({"table2": CsvTable(header, rows)}, "Numbers of unknowns, m_p = 4.")


def fig_3(_: Store, scope: Scope) -> FigureContent:
    """The undeformed mesh, with the rod and the housing that it will be pressed between."""
    densities = scope.meshes((1, 2), default=2)
    setups = [setup(d, scope.pressure(1.0)) for d in densities]
    meshes = [build_system(p).mesh for p in setups]
    rows = [
        (d, len(m.points), len(m.quads), len(m.arc_nodes) - 1, len(m.boundary))
        for d, m in zip(densities, meshes, strict=True)
    ]
    header = ("density", "nodes", "quadrilaterals", "arc_segments", "boundary_segments")

    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, len(meshes), squeeze=False)[0]
        for axes, p, mesh, letter in zip(panels, setups, meshes, "ab", strict=False):
            _quads(axes, mesh.points[mesh.quads])
            half = 0.55 * p.section_diameter
            for radius in (0.5 * p.rod_diameter, 0.5 * p.housing_diameter):
                axes.plot([-half, half], [radius, radius], color="black")
            axes.set_aspect("equal")
            axes.set_ylim(*sorted(axes.get_ylim(), reverse=True))
            axes.set_axis_off()
            axes.set_title(f"({letter}) mesh density {p.density}")

    note = " Rod (upper line) on the top, sealed side on the left; the ring is not yet squeezed."
    caption = density_words(densities, (1, 2)) + note
    return FigureContent({"fig3": CsvTable(header, rows)}, caption, draw, (5.6, 2.9))


def _quads(axes: Axes, corners: Any) -> None:
    from matplotlib.collections import PolyCollection

    axes.add_collection(
        PolyCollection(corners, facecolors="#e8eef4", edgecolors="0.35", linewidths=0.25),
        autolim=True,
    )
    axes.autoscale_view()


def _fig_4_requests(scope: Scope) -> list[Request]:
    speed = scope.speed(400.0)
    return [ask(s, [speed]) for s in _fig_4_setups(scope)]


def _fig_4_setups(scope: Scope) -> list[Seal]:
    density = scope.mesh(paper=2, default=2)
    return [setup(density, p_s) for p_s in scope.some_pressures(FIG_4_PRESSURES)]


def fig_4(store: Store, scope: Scope) -> FigureContent:
    """The deformed mesh for rising sealed pressure, drawn from the contact stage."""
    setups = _fig_4_setups(scope)
    rows = []
    for p in setups:
        contact = store.contact(p)
        if contact is not None:
            x, pressure = contact
            touching = (
                x[pressure > p.sealed_pressure + 1e-9] if p.sealed_pressure else x[pressure > 0]
            )
            rows.append((p.sealed_pressure, x[0], x[-1], touching[0], touching[-1], pressure.max()))
    header = (
        *("sealed_pressure_MPa", "gamma_start_mm", "gamma_end_mm"),
        *("contact_start_mm", "contact_end_mm", "contact_p_max_MPa"),
    )

    def draw(figure: Figure) -> None:
        panels = figure.subplots(2, 2, squeeze=False).ravel()
        for axes, p, letter in zip(panels, setups, "abcd", strict=False):
            _section(axes, p, store)
            axes.set_title(f"({letter}) $p_s$ = {p.sealed_pressure:g} MPa")
        for axes in panels[len(setups) :]:
            axes.set_axis_off()

    caption = density_words(setups[0].density, 2) + (
        " Rod on the top, sealed side on the left; short lines: the ends of gamma. Drawn from the"
        " frictionless contact stage (the film is thinner than a line)."
    )
    return FigureContent({"fig4": CsvTable(header, rows)}, caption, draw, (5.6, 4.8))


def _section(axes: Axes, p: Seal, store: Store) -> None:
    """The mesh and the walls, in z to the right and r downwards."""
    import meshio

    contact = store.contact(p)
    axes.set_axis_off()
    if contact is None:
        axes.text(0.5, 0.5, "not reached")
        return
    mesh = meshio.read(store.run_folder(p) / f"{contact_name(p.sealed_pressure)}.vtu")
    corners: Any = np.asarray(mesh.points)[mesh.cells[0].data][:, :, :2]
    _quads(axes, corners)
    rod, housing, half = 0.5 * p.rod_diameter, 0.5 * p.housing_diameter, 0.5 * p.groove_width
    axes.plot([-1.2 * half, 1.2 * half], [rod, rod], color="black")
    axes.plot([-half, -half, half, half], [rod + 0.4, housing, housing, rod + 0.4], color="black")
    for end in (contact[0][0], contact[0][-1]):
        axes.plot([end, end], [rod - 0.12, rod + 0.12], color="black")
    axes.set_aspect("equal")
    axes.set_xlim(-1.25 * half, 1.25 * half)
    axes.set_ylim(housing + 0.1, rod - 0.25)


ITEMS = (
    Item("table1", "Geometrical, process and material parameters", table_1),
    Item("table2", "Number of unknowns", table_2),
    Item("fig3", "O-ring in the initial configuration", fig_3),
    Item("fig4", "O-ring in the deformed configuration", fig_4, _fig_4_requests),
)
