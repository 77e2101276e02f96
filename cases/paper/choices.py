"""Choices that the paper does not show to be harmless: arc, cavitation, pressure order."""

from __future__ import annotations

from math import nan
from typing import Any

from softehl.cases.paper.item import Item, Product, Scope, Table, both, density_words, with_all
from softehl.cases.paper.states import PAPER, STABILISED, Request, Store, ask, setup
from softehl.cases.paper.tables import counted
from softehl.cases.seal.gland.parameters import Seal
from softehl.runtime.io import Cell

ARCS = ((-34.0, 43.0), (-33.0, 42.0), (-36.0, 46.0), (-38.0, 49.0))
"""Ends of the lubricated arc, degrees from the bottom; the first is the one of every other item."""

CAVITATING = (1600.0, 400.0, 100.0)
"""|U| at which the outstroke is compared, mm/s."""

NO_CAVITATION = 1.0e-9
"""A cavitation penalty, mm/(MPa s), that holds nothing back."""

ORDERS = (1, 2, 3, 4, 5)
TO_THE_FILM = ("contact to film", "shear")
"""Stages that every run passes alike, whatever speeds it is asked for."""

SCHEMES = {"paper": PAPER, "stabilised": STABILISED}


# --- where the lubricated arc ends --------------------------------------------------------------


def _arc_setups(scope: Scope) -> dict[tuple[str, float, float], Seal]:
    density, p_s = scope.mesh(16), scope.pressure(1.0)
    return {
        (name, start, end): setup(density, p_s, **{**scheme, "arc_start": start, "arc_end": end})
        for name, scheme in SCHEMES.items()
        for start, end in ARCS
    }


def _arc_requests(scope: Scope) -> list[Request]:
    speeds = both([scope.speed(400.0)])
    return [ask(p, speeds) for p in _arc_setups(scope).values()]


def arc(store: Store, scope: Scope) -> Product:
    """h* over the ends of the arc, by the paper's scheme and the stabilised one."""
    rows: list[list[Cell]] = []
    speeds = both([scope.speed(400.0)])
    for (name, start, end), p in _arc_setups(scope).items():
        if (start, end) == ARCS[0]:
            first = [store.state(p, u).h_star for u in speeds]
        states = [store.state(p, u) for u in speeds]
        for state, reference in zip(states, first, strict=True):
            change = 100.0 * (state.h_star / reference - 1.0)
            rows.append([name, start, end, state.rod_speed, state.h_star, change, state.verdict])
    header = (
        *("scheme", "arc_start", "arc_end", "rod_speed_mm_s"),
        *("h_star_um", "change_percent", "verdict"),
    )
    words = f" p_s = {scope.pressure(1.0):g} MPa; changes against the first arc."
    return Product({"arc": Table(header, rows)}, density_words(scope.mesh(16), 16) + words)


# --- the outstroke without cavitation -----------------------------------------------------------


def _cavitation_setups(scope: Scope) -> list[tuple[Seal, Seal]]:
    density, pressures = scope.mesh(16), scope.some_pressures((0.0, 1.0, 5.0))
    return [
        (setup(density, p), setup(density, p, cavitation_penalty=NO_CAVITATION)) for p in pressures
    ]


def _cavitation_requests(scope: Scope) -> list[Request]:
    speeds = scope.some_speeds(CAVITATING)
    return [ask(p, speeds) for pair in _cavitation_setups(scope) for p in pair]


def cavitation(store: Store, scope: Scope) -> Product:
    """The outstroke with the penalty (25) and without: least pressure, film and friction."""
    rows: list[list[Cell]] = []
    for pair in _cavitation_setups(scope):
        for u in scope.some_speeds(CAVITATING):
            states = [store.state(p, u) for p in pair]
            least = [float(s.profile.p_MPa.min()) if s.usable else nan for s in states]
            verdicts = [s.verdict for s in states]
            row: list[Cell] = [pair[0].sealed_pressure, u, *least, *(s.h_star for s in states)]
            rows.append([*row, *_changes(states), *verdicts])
    header = (
        *("sealed_pressure_MPa", "rod_speed_mm_s", "least_p_MPa", "least_p_without_MPa"),
        *("h_star_um", "h_star_without_um", "h_star_change_percent", "h_min_change_percent"),
        *("friction_change_percent", "verdict", "verdict_without"),
    )
    caption = f"{density_words(scope.mesh(16), 16)} Changes: without the penalty against with it."
    return Product({"cavitation": Table(header, rows)}, caption)


def _changes(states: list[Any]) -> list[float]:
    with_it, without = (s.row if s.usable else None for s in states)
    if with_it is None or without is None:
        return [nan] * 3
    names = ("h_star_um", "h_min_um", "rod_friction_N")
    return [100.0 * (getattr(without, n) / getattr(with_it, n) - 1.0) for n in names]


# --- what a higher order of the pressure costs --------------------------------------------------


def _order_setups(scope: Scope) -> list[Seal]:
    return [
        setup(d, scope.pressure(1.0), reynolds=kind, pressure_order=m)
        for kind in ("fe", "dg")
        for d in scope.meshes((1, 2, 4, 8, 16))
        for m in ORDERS
    ]


def _order_requests(scope: Scope) -> list[Request]:
    return [ask(p, [scope.speed(400.0)]) for p in _order_setups(scope)]


def order_cost(store: Store, scope: Scope) -> Product:
    """Unknowns, iterations and time over the order of the pressure."""
    rows: list[list[Cell]] = []
    for p in _order_setups(scope):
        total, pressures = counted(p)
        iterations, seconds = store.effort(p, TO_THE_FILM, "out")
        lowest = with_all(p, pressure_order=ORDERS[0])
        more = 100.0 * (total / counted(lowest)[0] - 1.0)
        ratio = seconds / store.effort(lowest, TO_THE_FILM, "out")[1]
        verdict = store.state(p, scope.speed(400.0)).verdict
        first: list[Cell] = [p.reynolds, p.density, p.pressure_order, total, pressures, more]
        rows.append([*first, iterations, seconds, ratio, verdict])
    header = (
        *("reynolds", "density", "pressure_order", "unknowns", "pressures"),
        *("more_unknowns_percent", "iterations", "seconds", "seconds_ratio", "verdict"),
    )
    caption = (
        "Of the runs of Fig. 16: unknowns, and iterations and seconds from the dry contact to the"
        " film and its shear stress, outstroke; ratios to m_p = 1 on the same mesh."
    )
    return Product({"order_cost": Table(header, rows)}, caption)


ITEMS = (
    Item("arc", "Where the lubricated arc ends", arc, _arc_requests),
    Item("cavitation", "The outstroke without cavitation", cavitation, _cavitation_requests),
    Item("order_cost", "What the order of the pressure costs", order_cost, _order_requests),
)
