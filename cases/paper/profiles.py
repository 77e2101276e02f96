"""Pressure and film thickness along the contact: Figs. 5 to 8, 10 to 15 and 19."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from softehl.cases.paper import drawing
from softehl.cases.paper.figure_spec import (
    FigureContent,
    Item,
    Scope,
    both,
    density_words,
    profile_table,
    state_table,
    verdict_note,
)
from softehl.cases.paper.states import Request, RequestedState, Store, ask, setup
from softehl.cases.seal.gland.records import DENSITIES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Value = Callable[[Any], Any]
Limits = tuple[float, float]


@dataclass(frozen=True)
class ProfileCurve:
    """One line of a figure: the state it shows and how it is called."""

    label: str
    request: Request

    @property
    def speed(self) -> float:
        """Its signed rod speed U, mm/s."""
        (speed,) = self.request.speeds
        return speed


@dataclass(frozen=True)
class Panel:
    """One diagram: title, what is drawn of which curves, limits and scales.

    around: the end of the contact ("start" or "end") and the limits of x from there, None = all of
    the contact. y: limits. log: whether h is on a logarithmic axis.
    """

    title: str
    value: Value
    curves: Sequence[ProfileCurve]
    around: tuple[str, float, float] | None = None
    y: Limits | None = None
    log: bool = False


@dataclass(frozen=True)
class Sheet:
    """A figure of profiles: its panels in rows of `columns`, and its caption."""

    panels: Sequence[Panel]
    caption: str
    columns: int = 2

    @property
    def curves(self) -> list[ProfileCurve]:
        """Every curve, once."""
        return list({(c.label, c.request): c for p in self.panels for c in p.curves}.values())


def curve(label: str, density: int, p_s: float, speed: float, **others: Any) -> ProfileCurve:
    """A line for one state."""
    return ProfileCurve(label, ask(setup(density, p_s, **others), [speed]))


def sheet_item(name: str, title: str, sheet: Callable[[Scope], Sheet]) -> Item:
    """The item of a figure of profiles."""

    def requests(scope: Scope) -> list[Request]:
        return [c.request for c in sheet(scope).curves]

    def make(store: Store, scope: Scope) -> FigureContent:
        return _product(name, sheet(scope), store)

    return Item(name, title, make, requests)


def _product(name: str, sheet: Sheet, store: Store) -> FigureContent:
    states = {c: store.state(c.request.setup, c.speed) for c in sheet.curves}
    series = [(c.label, state) for c, state in states.items()]
    rows = -(-len(sheet.panels) // sheet.columns)

    def draw(figure: Figure) -> None:
        axes = figure.subplots(rows, sheet.columns, squeeze=False).ravel()
        for one, panel, letter in zip(axes, sheet.panels, "abcdefgh", strict=False):
            _draw_panel(one, panel, states)
            one.set_title(f"({letter}) {panel.title}")
        for one in axes[len(sheet.panels) :]:
            one.set_axis_off()

    tables = {name: profile_table(series), f"{name}_states": state_table(series)}
    caption = sheet.caption + verdict_note([state for _, state in series])
    return FigureContent(tables, caption, draw, (3.6 * sheet.columns, 2.9 * rows))


def _draw_panel(
    axes: Axes, panel: Panel, states_of_curves: dict[ProfileCurve, RequestedState]
) -> None:
    for c, color in zip(panel.curves, drawing.shades(len(panel.curves)), strict=True):
        drawing.draw_profile(axes, states_of_curves[c], panel.value, c.label, color)
    states = [states_of_curves[c] for c in panel.curves]
    axes.set_xlabel(drawing.POSITION)
    axes.set_ylabel(drawing.FILM if panel.value is drawing.film else drawing.PRESSURE)
    drawing.around_contact(axes, states, panel.around)
    films = [s.h_star for s in states if s.usable]
    if panel.log:
        axes.set_yscale("log")
    if panel.y:
        axes.set_ylim(*panel.y)
    elif panel.value is drawing.film and films:
        axes.set_ylim(
            *((0.3 * min(films), 12 * max(films)) if panel.log else (0, 3.5 * max(films)))
        )
    axes.legend()


def pressure_and_film(curves: Sequence[ProfileCurve], **limits: Any) -> list[Panel]:
    """Panels (a) pressure and (b) film thickness of the same curves."""
    return [
        Panel("pressure", drawing.pressure, curves, **limits),
        Panel("film thickness", drawing.film, curves, **limits),
    ]


def fig_5(scope: Scope) -> Sheet:
    """Two sealed pressures, both strokes, |U| = 100."""
    density, u = scope.mesh(16), scope.speed(100.0)
    curves = [
        curve(f"$p_s$ = {p_s:g} MPa, {stroke}", density, p_s, speed)
        for p_s in scope.some_pressures((0.0, 2.0))
        for speed, stroke in ((u, "outstroke"), (-u, "instroke"))
    ]
    note = f" |U| = {u:g} mm/s. Which two pressures the paper shows is not in its text."
    return Sheet(pressure_and_film(curves), density_words(density, 16) + note)


INLET, OUTLET = ("start", -0.3, 0.2), ("end", -0.25, 0.25)
"""Details at the ends of the contact, mm from there."""


def fig_6(scope: Scope) -> Sheet:
    """The inlet and outlet zones of Fig. 5 at p_s = 2 MPa."""
    density, u, p_s = scope.mesh(16), scope.speed(100.0), scope.pressure(2.0)
    curves = [curve("outstroke", density, p_s, u), curve("instroke", density, p_s, -u)]
    details = ((INLET, "sealed side"), (OUTLET, "air side"))
    panels = [
        replace(panel, title=f"{panel.title}, {side}", around=zoom)
        for panel in pressure_and_film(curves)
        for zoom, side in details
    ]
    return Sheet(panels, f"{density_words(density, 16)} p_s = {p_s:g} MPa, |U| = {u:g} mm/s.")


def _falling(
    scope: Scope, density: int, p_s: float, sign: float, **others: Any
) -> list[ProfileCurve]:
    """One stroke at falling speed."""
    return [
        curve(f"{sign * u:+g}", density, p_s, sign * u, **others)
        for u in scope.some_speeds((800.0, 400.0, 200.0, 100.0, 50.0, 25.0))
    ]


FIG_7_SPEEDS = (1600.0, 400.0, 100.0, 25.0)


def fig_7(scope: Scope) -> Sheet:
    """The effect of rod speed at p_s = 1 MPa."""
    density, p_s = scope.mesh(16), scope.pressure(1.0)
    curves = [curve(f"{u:+g}", density, p_s, u) for u in both(scope.some_speeds(FIG_7_SPEEDS))]
    panels = pressure_and_film(curves)
    return Sheet(panels, density_words(density, 16) + f" p_s = {p_s:g} MPa; labels: U in mm/s.")


def fig_8(scope: Scope) -> Sheet:
    """Details of Fig. 7 (a)."""
    full_sheet = fig_7(scope)
    panels = [
        Panel("sealed side", drawing.pressure, full_sheet.curves, INLET),
        Panel("air side", drawing.pressure, full_sheet.curves, OUTLET),
    ]
    return Sheet(panels, full_sheet.caption)


def fig_10(scope: Scope) -> Sheet:
    """Convergence with mesh refinement, outstroke."""
    densities = scope.meshes(DENSITIES, default=8)
    u, p_s = scope.speed(400.0), scope.pressure(1.0)
    curves = [curve(f"density {d}", d, p_s, u) for d in densities]
    note = f" FE, m_p = 4, outstroke, p_s = {p_s:g} MPa, U = {u:g} mm/s."
    return Sheet(pressure_and_film(curves), density_words(densities, DENSITIES) + note)


def fig_11(scope: Scope) -> Sheet:
    """The dip of the film in Fig. 10 (b)."""
    densities = scope.meshes((4, 8, 16), default=8)
    u, p_s = scope.speed(400.0), scope.pressure(1.0)
    curves = [curve(f"density {d}", d, p_s, u) for d in densities]
    panel = Panel("the dip", drawing.film, curves, ("end", -0.2, -0.07), (0.8, 1.8))
    note = f" The detail of Fig. 10 at the outlet, outstroke, U = {u:g} mm/s."
    return Sheet([panel], density_words(densities, (4, 8, 16)) + note, columns=1)


def fig_12(scope: Scope) -> Sheet:
    """Pressure orders, continuous and discontinuous, on a coarse mesh."""
    density = scope.mesh(paper=2, default=2)
    u, p_s = scope.speed(400.0), scope.pressure(1.0)
    panels = []
    for kind, title in (("fe", "FE"), ("dg", "DG")):
        curves = [
            curve(f"{title}, $m_p$ = {m}", density, p_s, u, reynolds=kind, pressure_order=m)
            for m in (1, 2, 3, 4, 5)
        ]
        panels.append(Panel(title, drawing.pressure, curves))
    note = f" Outstroke, p_s = {p_s:g} MPa, U = {u:g} mm/s."
    return Sheet(panels, density_words(density, 2) + note)


def _fig_13_or_14(scope: Scope, kind: str) -> Sheet:
    density, p_s = scope.mesh(paper=8, default=4), scope.pressure(5.0)
    panels = [
        Panel(title, drawing.film, _falling(scope, density, p_s, sign, reynolds=kind), log=True)
        for sign, title in ((1.0, "outstroke"), (-1.0, "instroke"))
    ]
    note = (
        f" {kind.upper()}, m_p = 4; labels: U in mm/s. p_s = {p_s:g} MPa, as in Fig. 15 (the text"
        " gives none for this figure)."
    )
    return Sheet(panels, density_words(density, 8) + note)


def fig_13(scope: Scope) -> Sheet:
    """The effect of speed on the film, continuous pressure."""
    return _fig_13_or_14(scope, "fe")


def fig_14(scope: Scope) -> Sheet:
    """The effect of speed on the film, discontinuous pressure."""
    return _fig_13_or_14(scope, "dg")


def fig_15(scope: Scope) -> Sheet:
    """Rod speed and mesh density, outstroke."""
    paper = (4, 8, 16)
    densities, p_s = scope.meshes(paper, default=8), scope.pressure(5.0)
    panels = [
        Panel(f"density {d}", drawing.film, _falling(scope, d, p_s, 1.0), log=True)
        for d in densities
    ]
    note = f" FE, m_p = 4, outstroke, p_s = {p_s:g} MPa; labels: U in mm/s."
    return Sheet(panels, density_words(densities, paper) + note, columns=len(densities))


def fig_19(scope: Scope) -> Sheet:
    """Constant viscosity and that of Barus."""
    density, u, p_s = scope.mesh(16), scope.speed(100.0), scope.pressure(5.0)
    laws = ((0.02, "Barus (13)"), (0.0, "constant"))
    panels = [
        Panel(
            title,
            drawing.film,
            [
                curve(f"{title}, {law}", density, p_s, sign * u, pressure_viscosity=alpha)
                for alpha, law in laws
            ],
        )
        for sign, title in ((1.0, "outstroke"), (-1.0, "instroke"))
    ]
    note = f" p_s = {p_s:g} MPa, |U| = {u:g} mm/s."
    return Sheet(panels, density_words(density, 16) + note)


ITEMS = (
    sheet_item("fig5", "Pressure and film thickness for two sealed pressures", fig_5),
    sheet_item("fig6", "Details of the inlet and outlet zones of Fig. 5", fig_6),
    sheet_item("fig7", "Effect of the rod speed on pressure and film thickness", fig_7),
    sheet_item("fig8", "Details of the pressure profile of Fig. 7", fig_8),
    sheet_item("fig10", "Convergence with mesh refinement", fig_10),
    sheet_item("fig11", "Film thickness, a detail of Fig. 10", fig_11),
    sheet_item("fig12", "Pressure for different pressure orders, FE and DG", fig_12),
    sheet_item("fig13", "Effect of the rod speed on the film thickness, FE", fig_13),
    sheet_item("fig14", "Effect of the rod speed on the film thickness, DG", fig_14),
    sheet_item("fig15", "Effect of rod speed and mesh density on the film thickness", fig_15),
    sheet_item("fig19", "Effect of pressure dependence of viscosity on the film thickness", fig_19),
)
