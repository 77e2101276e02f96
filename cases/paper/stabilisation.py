"""The paper's scheme beside the stabilised film: same density, same unknowns. Not in the paper."""

from __future__ import annotations

from math import isnan, nan
from typing import TYPE_CHECKING, Any

from softehl.cases.paper import drawing
from softehl.cases.paper.figure_spec import CsvTable, FigureContent, Item, Scope, both
from softehl.cases.paper.states import STABILISED, Request, RequestedState, Store, ask, setup
from softehl.runtime.io import Cell

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PRESSURES = (0.0, 1.0, 2.0, 5.0)
DENSITY, REFERENCE = 2, 8
SHOWN = ((1.0, 100.0), (5.0, -100.0))
"""Sealed pressures and rod speeds U of the profiles, MPa and mm/s."""


def _finest(scope: Scope) -> int:
    return scope.mesh(REFERENCE)


def _requests(scope: Scope) -> list[Request]:
    speeds, density = both(scope.some_speeds()), scope.mesh(DENSITY)
    requests = []
    for p_s in scope.some_pressures(PRESSURES):
        requests += [
            ask(setup(density, p_s), speeds),
            ask(setup(density, p_s, **STABILISED), speeds),
        ]
        reference = setup(_finest(scope), p_s, **STABILISED)
        requests.append(ask(reference, speeds))
    return requests


def stabilisation(store: Store, scope: Scope) -> FigureContent:
    """h*, oscillation and error of both schemes; profiles and curves beside each other."""
    density, rows = scope.mesh(DENSITY), list[list[Cell]]()
    for p_s in scope.some_pressures(PRESSURES):
        paper, stabilised = setup(density, p_s), setup(density, p_s, **STABILISED)
        reference = setup(_finest(scope), p_s, **STABILISED)
        for u in both(scope.some_speeds()):
            row = _row(
                p_s,
                u,
                paper=store.state(paper, u),
                stabilised=store.state(stabilised, u),
                reference=store.state(reference, u),
            )
            rows.append(row)
    header = (
        *("sealed_pressure_MPa", "rod_speed_mm_s"),
        *("h_star_paper_um", "error_percent", "oscillation", "verdict"),
        *("h_star_stabilised_um", "stabilised_error_percent", "estimate_percent"),
        *("stabilised_oscillation", "stabilised_verdict", "h_star_reference_um"),
    )
    caption = (
        f"Density {density}, the same unknowns: the paper's scheme and the stabilised film. Errors "
        f"against the stabilised film at density {_finest(scope)}."
    )

    def draw(figure: Figure) -> None:
        _draw(figure, store, scope)

    return FigureContent({"stabilisation": CsvTable(header, rows)}, caption, draw, (10.8, 3.1))


def _row(
    p_s: float,
    u: float,
    paper: RequestedState,
    stabilised: RequestedState,
    reference: RequestedState,
) -> list[Cell]:
    def error(state: RequestedState) -> float:
        return 100.0 * (state.h_star / reference.h_star - 1.0)

    def oscillation(state: RequestedState) -> float:
        return state.row.oscillation_index if state.row else nan

    estimate = stabilised.row.h_star_error_percent if stabilised.row else nan
    return [
        *(p_s, u, paper.h_star, error(paper), oscillation(paper), paper.verdict),
        *(
            stabilised.h_star,
            error(stabilised),
            estimate,
            oscillation(stabilised),
            stabilised.verdict,
        ),
        reference.h_star,
    ]


def _draw(figure: Figure, store: Store, scope: Scope) -> None:
    axes = figure.subplots(1, 3)
    density, pressures = scope.mesh(DENSITY), scope.some_pressures(PRESSURES)
    for one, (p_s, u), letter in zip(axes, SHOWN, "ab", strict=False):
        pressure = p_s if p_s in pressures else pressures[-1]
        speed = scope.speed(abs(u)) * (1.0 if u > 0 else -1.0)
        _profiles(one, store, density, pressure, speed)
        title = f"({letter}) $p_s$ = {pressure:g} MPa, $U$ = {speed:+g} mm/s"
        one.set_title(title)
    _curves(axes[2], store, scope, pressures[-1])
    axes[2].set_title(f"(c) instroke, $p_s$ = {pressures[-1]:g} MPa")


def _profiles(axes: Axes, store: Store, density: int, p_s: float, u: float) -> None:
    states = [store.state(setup(density, p_s, **keys), u) for keys in _SCHEMES]
    for state, label, color in zip(states, _LABELS, _COLOURS, strict=True):
        drawing.draw_profile(axes, state, drawing.film, label, color)
    drawing.around_contact(axes, states, None)
    films = [state.h_star for state in states if not isnan(state.h_star)]
    if films:
        axes.set_ylim(0.0, 3.0 * max(films))
    axes.set_xlabel(drawing.POSITION)
    axes.set_ylabel(drawing.FILM)
    axes.legend()


def _curves(axes: Axes, store: Store, scope: Scope, p_s: float) -> None:
    speeds = [-u for u in scope.some_speeds()]
    sets = [setup(scope.mesh(DENSITY), p_s, **keys) for keys in _SCHEMES]
    reference = setup(_finest(scope), p_s, **STABILISED)
    labels = (*_LABELS, f"stabilised, density {_finest(scope)}")
    for which, label, color in zip([*sets, reference], labels, (*_COLOURS, "0.6"), strict=True):
        states = store.states(which, speeds)
        line = drawing.SeriesLine(label, [abs(u) for u in speeds], states, color)
        drawing.draw_line(axes, line)
    drawing.logarithmic(axes, x=True, y=True)
    axes.set_xlabel("rod speed $|U|$ [mm/s]")
    axes.set_ylabel(drawing.H_STAR)
    axes.legend()


_SCHEMES: tuple[dict[str, Any], ...] = ({}, STABILISED)
_LABELS = ("paper's scheme", "stabilised")
_COLOURS = ("tab:red", "tab:blue")

ITEMS = (Item("stabilisation", "A film without oscillations", stabilisation, _requests),)
