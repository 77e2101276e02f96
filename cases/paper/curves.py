"""h* over a parameter: Fig. 9 (p_s), Figs. 16 to 18 (mesh density) and Fig. 20 (p_s, viscosity)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from softehl.cases.paper import drawing
from softehl.cases.paper.drawing import SeriesLine
from softehl.cases.paper.figure_spec import (
    FigureContent,
    Item,
    Scope,
    density_words,
    state_table,
    verdict_note,
)
from softehl.cases.paper.states import Request, Store, ask, setup
from softehl.cases.seal.gland.records import DENSITIES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PRESSURES = (0.0, 0.5, 1.0, 2.0, 3.0, 5.0)
SPEEDS = (800.0, 400.0, 200.0, 100.0, 50.0)
ORDERS = (1, 2, 3, 4, 5)


@dataclass(frozen=True)
class CurveSeries:
    """A line of a diagram: its label, what it asks for at each abscissa, panel and style."""

    label: str
    x: tuple[float, ...]
    requests: tuple[Request, ...]
    panel: int = 0
    shade: int = 0
    style: str = "-"


@dataclass(frozen=True)
class Chart:
    """Panels of h* over something."""

    titles: Sequence[str]
    series: Sequence[CurveSeries]
    abscissa: str
    caption: str
    log_x: bool = False
    log_y: bool = False


def chart_item(name: str, title: str, chart: Callable[[Scope], Chart]) -> Item:
    """The item of a diagram of h*."""

    def requests(scope: Scope) -> list[Request]:
        return [request for s in chart(scope).series for request in s.requests]

    def make(store: Store, scope: Scope) -> FigureContent:
        return _product(name, chart(scope), store)

    return Item(name, title, make, requests)


def _product(name: str, chart: Chart, store: Store) -> FigureContent:
    states_by_series = [
        (s, [store.state(r.setup, u) for r in s.requests for u in r.speeds]) for s in chart.series
    ]
    states = [state for _, some in states_by_series for state in some]

    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, len(chart.titles), squeeze=False, sharey=True)[0]
        colors = drawing.shades(1 + max(s.shade for s in chart.series))
        for axes, title in zip(panels, chart.titles, strict=True):
            axes.set_title(title)
            axes.set_xlabel(chart.abscissa)
        for s, some in states_by_series:
            line = SeriesLine(s.label, s.x, some, colors[s.shade], s.style)
            drawing.draw_line(panels[s.panel], line)
        panels[0].set_ylabel(drawing.H_STAR)
        for axes in panels:
            drawing.logarithmic(axes, x=chart.log_x, y=chart.log_y)
            axes.legend(ncols=2)

    table = state_table([(s.label, state) for s, some in states_by_series for state in some])
    marks = "" if all(s.plain for s in states) else f" {drawing.marks_words()}"
    caption = chart.caption + marks + verdict_note(states)
    return FigureContent({name: table}, caption, draw, (3.6 * len(chart.titles) + 1.4, 3.6))


def fig_9(scope: Scope) -> Chart:
    """h* over p_s at several speeds, both strokes."""
    density, pressures = scope.mesh(16), scope.some_pressures(PRESSURES)
    series = [
        CurveSeries(
            f"U = {sign * u:+g}",
            pressures,
            tuple(ask(setup(density, p), [sign * u]) for p in pressures),
            shade=shade,
            style=style,
        )
        for shade, u in enumerate(scope.some_speeds(SPEEDS))
        for sign, style in ((1.0, "--"), (-1.0, "-"))
    ]
    note = " Instroke full, outstroke dashed; which speeds the paper shows is not in its text."
    caption = density_words(density, 16) + note
    return Chart([""], series, "sealed pressure $p_s$ [MPa]", caption, log_y=True)


def _over_density(
    scope: Scope, label: str, panel: int, shade: int, style: str = "-", **others: Any
) -> CurveSeries:
    """h* over mesh density of one discretisation, in the state of Fig. 16."""
    densities, u, p_s = _figure_16_state(scope)
    requests = tuple(ask(setup(d, p_s, **others), [u]) for d in densities)
    return CurveSeries(label, tuple(map(float, densities)), requests, panel, shade, style)


def _figure_16_state(scope: Scope) -> tuple[tuple[int, ...], float, float]:
    return scope.meshes(DENSITIES, default=4), scope.speed(400.0), scope.pressure(1.0)


def _density_caption(scope: Scope, more: str = "") -> str:
    densities, u, p_s = _figure_16_state(scope)
    note = f" Outstroke, p_s = {p_s:g} MPa, U = {u:g} mm/s.{more}"
    return density_words(densities, DENSITIES) + note


def fig_16(scope: Scope) -> Chart:
    """h* over density for FE and DG and all pressure orders."""
    series = [
        _over_density(scope, f"$m_p$ = {m}", panel, m - 1, reynolds=kind, pressure_order=m)
        for panel, kind in enumerate(("fe", "dg"))
        for m in ORDERS
    ]
    titles = ("(a) FE", "(b) DG")
    return Chart(titles, series, "mesh density", _density_caption(scope), log_x=True)


def fig_17(scope: Scope) -> Chart:
    """h* over density for the solid elements."""
    series = [
        _over_density(scope, name, 0, i, solid=name) for i, name in enumerate(("taylor", "fbar"))
    ]
    caption = _density_caption(scope, " FE, m_p = 4.")
    return Chart([""], series, "mesh density", caption, log_x=True)


def fig_18(scope: Scope) -> Chart:
    """h* over density for the rules of Gauss and Lobatto."""
    series = [
        _over_density(
            scope,
            f"{rule}, $m_p$ = {m}",
            panel=panel,
            shade=i,
            style=style,
            reynolds=kind,
            quadrature=rule,
            pressure_order=m,
        )
        for panel, kind in enumerate(("fe", "dg"))
        for i, m in enumerate((1, 2, 4))
        for rule, style in (("gauss", "-"), ("lobatto", "--"))
    ]
    titles = ("(a) FE", "(b) DG")
    return Chart(titles, series, "mesh density", _density_caption(scope), log_x=True)


FIG_20_PRESSURES = (0.0, 1.0, 2.0, 5.0)


def fig_20(scope: Scope) -> Chart:
    """h* over p_s with constant viscosity and with that of Barus, both strokes."""
    density, u = scope.mesh(16), scope.speed(100.0)
    pressures = scope.some_pressures(FIG_20_PRESSURES)
    series = [
        CurveSeries(
            f"{stroke}, {law}",
            pressures,
            tuple(ask(setup(density, p, pressure_viscosity=a), [sign * u]) for p in pressures),
            shade=shade,
            style=style,
        )
        for shade, (sign, stroke) in enumerate(((1.0, "outstroke"), (-1.0, "instroke")))
        for a, law, style in ((0.02, "Barus (13)", "-"), (0.0, "constant", "--"))
    ]
    caption = f"{density_words(density, 16)} |U| = {u:g} mm/s."
    return Chart([""], series, "sealed pressure $p_s$ [MPa]", caption)


ITEMS = (
    chart_item("fig9", "h* over the sealed pressure", fig_9),
    chart_item("fig16", "Convergence of h* with mesh refinement, FE and DG", fig_16),
    chart_item("fig17", "Effect of the solid element on the convergence of h*", fig_17),
    chart_item("fig18", "Effect of the quadrature on the convergence of h*", fig_18),
    chart_item("fig20", "Effect of pressure dependence of viscosity on h*", fig_20),
)
