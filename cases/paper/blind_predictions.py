"""Blind predictions: numbers of the paper that its text here withholds, with their mesh study."""

from __future__ import annotations

from math import exp, isfinite, log2, nan
from typing import Any

from softehl.cases.paper.checks import LETTERS, observed_order
from softehl.cases.paper.curves import ORDERS
from softehl.cases.paper.figure_spec import STUDY_DENSITIES, CsvTable, FigureContent, Item, Scope
from softehl.cases.paper.states import PAPER, STABILISED, Request, RequestedState, Store, ask, setup
from softehl.cases.seal.gland.records import DENSITIES
from softehl.runtime.io import Cell

# --- Sec. 5.2: the largest pressure jump for each density and order -----------------------------


def _jump_requests(scope: Scope) -> list[Request]:
    u, p_s = scope.speed(400.0), scope.pressure(1.0)
    return [
        ask(setup(d, p_s, reynolds="dg", pressure_order=m), [u])
        for d in scope.meshes(DENSITIES)
        for m in ORDERS
    ]


def jumps(store: Store, scope: Scope) -> FigureContent:
    """The largest pressure jump of the DG method over density and order, and its orders."""
    u, p_s, densities = scope.speed(400.0), scope.pressure(1.0), scope.meshes(DENSITIES)
    rows: list[list[Cell]] = []
    for m in ORDERS:
        states = [store.state(setup(d, p_s, reynolds="dg", pressure_order=m), u) for d in densities]
        values = [s.row.pressure_jump_max_MPa if s.row and s.usable else nan for s in states]
        marks = "".join(LETTERS.get(s.verdict, "-") for s in states)
        order = nan
        if len(values) > 1 and isfinite(values[-1]) and isfinite(values[-2]) and values[-1] > 0:
            order = log2(values[-2] / values[-1])
        rows.append([m, *values, marks, order])
    header = (
        "pressure_order",
        *(f"jump_MPa_density_{d}" for d in densities),
        *("verdicts", "order_of_last_two"),
    )
    caption = f"Outstroke, p_s = {p_s:g} MPa, U = {u:g} mm/s."
    return FigureContent({"jumps": CsvTable(header, rows)}, caption)


# --- Sec. 5.3: how much the piezo-viscous effect changes ----------------------------------------


def _piezo_requests(scope: Scope) -> list[Request]:
    u, p_s = scope.speed(100.0), scope.pressure(5.0)
    return [
        ask(setup(d, p_s, pressure_viscosity=alpha, **scheme), [u, -u])
        for scheme in (PAPER, STABILISED)
        for d in scope.meshes(STUDY_DENSITIES, default=8)
        for alpha in (0.02, 0.0)
    ]


def piezo(store: Store, scope: Scope) -> FigureContent:
    """Changes of film by (13), the largest pressure and its viscosity, on several meshes."""
    u, p_s = scope.speed(100.0), scope.pressure(5.0)
    caption = f"p_s = {p_s:g} MPa, |U| = {u:g} mm/s, alpha = 0.02 against 0."
    tables = {
        "piezo": _piezo_table(store, scope, PAPER),
        "piezo_stabilised": _piezo_table(store, scope, STABILISED),
    }
    return FigureContent(tables, caption)


def _piezo_table(store: Store, scope: Scope, scheme: dict[str, Any]) -> CsvTable:
    u, p_s = scope.speed(100.0), scope.pressure(5.0)
    densities = scope.meshes(STUDY_DENSITIES, default=8)
    rows: list[list[Cell]] = []
    for sign, stroke in ((1.0, "outstroke"), (-1.0, "instroke")):
        pairs = [
            [
                store.state(setup(d, p_s, pressure_viscosity=alpha, **scheme), sign * u)
                for alpha in (0.02, 0.0)
            ]
            for d in densities
        ]
        rows += _piezo_rows(stroke, pairs)
    header = (
        "quantity",
        *(f"density_{d}" for d in densities),
        *("verdicts", "observed_order", "extrapolated"),
    )
    return CsvTable(header, rows)


def _piezo_rows(stroke: str, pairs: list[list[RequestedState]]) -> list[list[Cell]]:
    """Rows of one stroke from pairs of states with and without (13)."""
    marks = "".join(LETTERS.get(barus.verdict, "-") for barus, _ in pairs)
    rows: list[list[Cell]] = []
    for name in ("h_star_um", "h_min_um", "p_max_MPa"):
        changes = [_change(barus, plain, name) for barus, plain in pairs]
        rows.append([f"change of {name}, {stroke}, %", *changes, marks, *_limit(changes)])
    top = [_number(barus, "p_max_MPa") for barus, _ in pairs]
    ratio = [exp(0.02 * p) for p in top]
    rows.append([f"largest pressure, {stroke}, MPa", *top, marks, *_limit(top)])
    rows.append([f"viscosity there / eta_0, {stroke}", *ratio, marks, *_limit(ratio)])
    return rows


def _change(barus: RequestedState, plain: RequestedState, name: str) -> float:
    return 100.0 * (_number(barus, name) / _number(plain, name) - 1.0)


def _number(state: RequestedState, name: str) -> float:
    return float(getattr(state.row, name)) if state.row is not None and state.usable else nan


def _limit(values: list[float]) -> tuple[float, float]:
    return observed_order(values) if len(values) >= 3 else (nan, nan)


ITEMS = (
    Item("jumps", "Largest pressure jumps of the DG method (blind)", jumps, _jump_requests),
    Item("piezo", "Piezo-viscous effect on several meshes (blind)", piezo, _piezo_requests),
)
