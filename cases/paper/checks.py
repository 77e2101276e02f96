"""Items beyond the paper: verdicts, mesh study, leakage, shear traction, oscillations, choices.

Choices are those that the paper does not show to be harmless: ends of the arc, cavitation, order of
the pressure, number of quadrature points (rules of Gauss and Lobatto).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, log2, nan
from typing import TYPE_CHECKING, Any

import meshio
import numpy as np

from softehl.cases.paper import drawing
from softehl.cases.paper.figure_spec import (
    STUDY_DENSITIES,
    CsvTable,
    FigureContent,
    Item,
    Scope,
    both,
    density_words,
    state_table,
    with_all,
)
from softehl.cases.paper.lookup import ripple
from softehl.cases.paper.states import PAPER, STABILISED, Request, RequestedState, Store, ask, setup
from softehl.cases.paper.tables import counted
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.states.leakage import LeakageRow, net_leakage
from softehl.runtime.io import Cell

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MATRIX_PRESSURES = (0.0, 1.0, 2.0, 5.0)
STUDY_PRESSURES = (1.0, 5.0)
LETTERS = {"ok": ".", "oscillating": "o", "under-resolved": "U", "collapsed": "C"}
"""Verdict -> its letter in the matrix; a state that is not reached is a dash."""


# --- every combination of p_s, stroke, speed and density ----------------------------------------


def _matrix_setups(scope: Scope) -> list[Seal]:
    pressures = scope.some_pressures(MATRIX_PRESSURES)
    return [setup(d, p) for d in scope.meshes((4, 8, 16)) for p in pressures]


def _matrix_requests(scope: Scope) -> list[Request]:
    return [ask(s, both(scope.some_speeds())) for s in _matrix_setups(scope)]


def matrix(store: Store, scope: Scope) -> FigureContent:
    """The verdict on every state, and its numbers."""
    speeds, rows, states = scope.some_speeds(), [], []
    for p in _matrix_setups(scope):
        strokes = [[store.state(p, sign * u) for u in speeds] for sign in (1.0, -1.0)]
        other = "-" if store.ended(p) else "?"
        letters = ["".join(LETTERS.get(s.verdict, other) for s in some) for some in strokes]
        rows.append((p.density, p.sealed_pressure, *letters))
        states += [("", s) for some in strokes for s in some]
    header = ("density", "sealed_pressure_MPa", "outstroke", "instroke")
    caption = (
        f"A letter for each |U| = {', '.join(f'{u:g}' for u in speeds)} mm/s: . ok, o oscillating,"
        " U under-resolved, C collapsed, - not reached, ? not run to its end."
    )
    tables = {"matrix": CsvTable(header, rows), "matrix_states": state_table(states)}
    return FigureContent(tables, caption)


# --- mesh study ---------------------------------------------------------------------------------


def observed_order(values: Sequence[float]) -> tuple[float, float]:
    """Order of convergence and extrapolated value of three results, each mesh twice as fine.

    nan where the differences do not fall with one sign, so that no order can be seen.
    """
    coarse, middle, fine = values[-3:]
    first, second = middle - coarse, fine - middle
    if not (isfinite(first) and isfinite(second)) or second == 0.0 or first / second <= 1.0:
        return nan, nan
    ratio = first / second
    return log2(ratio), fine + second / (ratio - 1.0)


def _study_requests(scope: Scope) -> list[Request]:
    pressures = scope.some_pressures(STUDY_PRESSURES)
    return [
        ask(setup(d, p, **scheme), both(scope.some_speeds()))
        for scheme in (PAPER, STABILISED)
        for d in scope.meshes(STUDY_DENSITIES, default=8)
        for p in pressures
    ]


def mesh_study(store: Store, scope: Scope) -> FigureContent:
    """h* over density at two sealed pressures: observed order and extrapolated value."""
    caption = (
        "h* on three meshes, the order seen in the last three and Richardson's extrapolation; nan"
        " where the differences do not fall with one sign."
    )
    tables = {
        "mesh_study": _study(store, scope, PAPER),
        "mesh_study_stabilised": _study(store, scope, STABILISED),
    }
    return FigureContent(tables, caption)


def _study(store: Store, scope: Scope, scheme: dict[str, Any]) -> CsvTable:
    densities = scope.meshes(STUDY_DENSITIES, default=8)
    rows: list[list[Cell]] = []
    for p_s in scope.some_pressures(STUDY_PRESSURES):
        for u in both(scope.some_speeds()):
            states = [store.state(setup(d, p_s, **scheme), u) for d in densities]
            films = [s.h_star for s in states]
            order, limit = observed_order(films) if len(films) >= 3 else (nan, nan)
            marks = "".join(LETTERS.get(s.verdict, "-") for s in states)
            rows.append([p_s, u, *films, marks, order, limit])
    header = (
        *("sealed_pressure_MPa", "rod_speed_mm_s"),
        *(f"h_star_um_density_{d}" for d in densities),
        *("verdicts", "observed_order", "extrapolated_um"),
    )
    return CsvTable(header, rows)


# --- net leakage --------------------------------------------------------------------------------


def _leakage_setups(scope: Scope) -> list[Seal]:
    return [setup(scope.mesh(16), p) for p in scope.some_pressures(MATRIX_PRESSURES)]


def leakage(store: Store, scope: Scope) -> FigureContent:
    """Net leakage of a cycle over sealed pressure and speed, `cases.seal.states.leakage`."""
    setups, speeds = _leakage_setups(scope), both(scope.some_speeds())
    rows = []
    for p in setups:
        usable = [s.row for s in store.states(p, speeds) if s.usable and s.row is not None]
        rows += net_leakage(usable)
    cells = [row.cells() for row in rows]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for p, color in zip(setups, drawing.shades(len(setups)), strict=True):
            selected = [r for r in rows if r.sealed_pressure_MPa == p.sealed_pressure]
            u, net = [r.speed_mm_s for r in selected], [r.net_film_um for r in selected]
            axes.plot(u, net, color=color, label=f"$p_s$ = {p.sealed_pressure:g} MPa")
            for r in selected:
                face = color if r.verdict == "ok" else "white"
                x, y = [r.speed_mm_s], [r.net_film_um]
                axes.plot(x, y, marker="o", color=color, markerfacecolor=face)
        axes.set_xscale("log")
        axes.set_xlabel("rod speed $|U|$ [mm/s]")
        axes.set_ylabel(r"$h^*_\mathrm{out} - h^*_\mathrm{in}$ [$\mu$m]")
        axes.legend()

    note = " What leaves in a cycle per unit of stroke and area; positive: the seal leaks."
    caption = density_words(scope.mesh(16), 16) + note + " Hollow: not ok."
    return FigureContent(
        {"leakage": CsvTable(LeakageRow.header(), cells)}, caption, draw, (4.6, 3.2)
    )


# --- the shear traction -------------------------------------------------------------------------


def _shear_requests(scope: Scope) -> list[Request]:
    speeds = both(scope.some_speeds())
    return [ask(s, speeds) for s in _shear_setups(scope)]


def _shear_setups(scope: Scope) -> list[Seal]:
    density, p_s = scope.mesh(16), scope.pressure(1.0)
    return [setup(density, p_s), setup(density, p_s, shear_traction=False)]


def shear(store: Store, scope: Scope) -> FigureContent:
    """Effect of the shear stress (17) on the deformation of the seal and on h*."""
    with_it, without = _shear_setups(scope)
    rows: list[list[Cell]] = []
    for u in both(scope.some_speeds()):
        a, b = store.state(with_it, u), store.state(without, u)
        if a.row is None or b.row is None or not (a.usable and b.usable):
            rows.append([u, a.verdict, b.verdict, *[nan] * 8])
            continue
        shift, largest = _movement(a, b)
        films = [a.row.h_star_um, b.row.h_star_um, 100 * (a.row.h_star_um / b.row.h_star_um - 1)]
        minima = 100 * (a.row.h_min_um / b.row.h_min_um - 1)
        shifts = [1e3 * (getattr(a.row, k) - getattr(b.row, k)) for k in _ENDS]
        rows.append([u, a.verdict, b.verdict, largest, shift, *shifts, *films, minima])
    header = (
        *("rod_speed_mm_s", "verdict_with", "verdict_without"),
        *("largest_movement_um", "mean_axial_movement_of_contact_um"),
        *("contact_start_moves_um", "contact_end_moves_um"),
        *("h_star_with_um", "h_star_without_um", "h_star_change_percent", "h_min_change_percent"),
    )
    p_s = with_it.sealed_pressure
    caption = f"{density_words(scope.mesh(16), 16)} p_s = {p_s:g} MPa, mean rotation held."
    return FigureContent({"shear": CsvTable(header, rows)}, caption)


_ENDS = ("contact_start_mm", "contact_end_mm")


def _movement(a: RequestedState, b: RequestedState) -> tuple[float, float]:
    """Of the nodes in b's contact the mean axial movement from b to a, and the largest, um."""
    points = [np.asarray(meshio.read(_section(s)).points)[:, :2] for s in (a, b)]
    moved = 1e3 * (points[0] - points[1])
    assert b.row is not None
    start, end = b.row.contact_start_mm, b.row.contact_end_mm
    z, r = points[1].T
    inside = (z > start) & (z < end) & (r < 0.5 * b.setup.rod_diameter + 0.02)
    shift = float(moved[inside, 0].mean()) if inside.any() else nan
    return shift, float(np.hypot(*moved.T).max())


def _section(state: RequestedState) -> str:
    assert state.row is not None
    assert state.folder is not None
    _, section = state.row.file_names()
    return str(state.folder / section)


ITEMS = (
    Item(
        "matrix",
        "Verdicts over sealed pressure, stroke, speed and density",
        matrix,
        _matrix_requests,
    ),
    Item("mesh_study", "Mesh convergence of h*", mesh_study, _study_requests),
    Item(
        "leakage",
        "Net leakage of a cycle",
        leakage,
        lambda scope: [ask(s, both(scope.some_speeds())) for s in _leakage_setups(scope)],
    ),
    Item("shear", "Effect of the shear traction", shear, _shear_requests),
)


def _onset_requests(scope: Scope) -> list[Request]:
    return [
        ask(setup(d, p), both(scope.some_speeds()))
        for d in scope.meshes(STUDY_DENSITIES, default=8)
        for p in scope.some_pressures(STUDY_PRESSURES)
    ]


def onset(store: Store, scope: Scope) -> FigureContent:
    """The ripple in h*, a row for each density, p_s and stroke, a column for each |U|."""
    speeds, rows = scope.some_speeds(), []
    for p_s in scope.some_pressures(STUDY_PRESSURES):
        for sign, stroke in ((1.0, "out"), (-1.0, "in")):
            for d in scope.meshes(STUDY_DENSITIES, default=8):
                states = store.states(setup(d, p_s), [sign * u for u in speeds])
                row: list[Cell] = [p_s, stroke, d, *(round(ripple(s), 4) for s in states)]
                rows.append(row)
    header = ("sealed_pressure_MPa", "stroke", "density", *(f"U_{u:g}" for u in speeds))
    caption = (
        "Largest rise of h on the way from the inlet to the dip, in h*; a smooth film has none."
    )
    return FigureContent({"onset": CsvTable(header, rows)}, caption)


ONSET_ITEMS = (Item("onset", "Onset of oscillations", onset, _onset_requests),)


POINT_DENSITIES = (1, 2)
POINTS = (2, 3, 4)
POINT_ORDER = 2
POINT_RULES = ("gauss", "lobatto")


def _point_request(scope: Scope, density: int, points: int, rule: str) -> Request:
    others = {"pressure_order": POINT_ORDER, "quadrature": rule, "quadrature_points": points}
    return ask(setup(density, scope.pressure(1.0), **others), [scope.speed(400.0)])


def _point_cases(scope: Scope) -> list[tuple[int, int]]:
    return [(d, n) for d in scope.meshes(POINT_DENSITIES, default=2) for n in POINTS]


def _point_requests(scope: Scope) -> list[Request]:
    return [
        _point_request(scope, d, n, rule) for d, n in _point_cases(scope) for rule in POINT_RULES
    ]


def points(store: Store, scope: Scope) -> FigureContent:
    """h* over density and number of points, and how far the rules differ."""
    rows, u = [], scope.speed(400.0)
    for d, n in _point_cases(scope):
        gauss, lobatto = (
            store.state(_point_request(scope, d, n, r).setup, u).h_star for r in POINT_RULES
        )
        rows.append((d, n, gauss, lobatto, 100.0 * (lobatto / gauss - 1.0)))
    header = ("density", "points", "gauss_um", "lobatto_um", "difference_percent")
    caption = (
        f"h*, FE, m_p = {POINT_ORDER}, outstroke, p_s = {scope.pressure(1.0):g} MPa, "
        f"U = {u:g} mm/s."
    )
    return FigureContent({"points": CsvTable(header, rows)}, caption)


POINT_ITEMS = (Item("points", "Number of quadrature points", points, _point_requests),)


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


def arc(store: Store, scope: Scope) -> FigureContent:
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
    note = f" p_s = {scope.pressure(1.0):g} MPa; changes against the first arc."
    return FigureContent({"arc": CsvTable(header, rows)}, density_words(scope.mesh(16), 16) + note)


# --- the outstroke without cavitation -----------------------------------------------------------


def _cavitation_setups(scope: Scope) -> list[tuple[Seal, Seal]]:
    density, pressures = scope.mesh(16), scope.some_pressures((0.0, 1.0, 5.0))
    return [
        (setup(density, p), setup(density, p, cavitation_penalty=NO_CAVITATION)) for p in pressures
    ]


def _cavitation_requests(scope: Scope) -> list[Request]:
    speeds = scope.some_speeds(CAVITATING)
    return [ask(p, speeds) for pair in _cavitation_setups(scope) for p in pair]


def cavitation(store: Store, scope: Scope) -> FigureContent:
    """The outstroke with the penalty (25) and without: least pressure, film and friction."""
    rows: list[list[Cell]] = []
    for pair in _cavitation_setups(scope):
        for u in scope.some_speeds(CAVITATING):
            states = [store.state(p, u) for p in pair]
            minima = [float(s.profile.p_MPa.min()) if s.usable else nan for s in states]
            verdicts = [s.verdict for s in states]
            row: list[Cell] = [pair[0].sealed_pressure, u, *minima, *(s.h_star for s in states)]
            rows.append([*row, *_changes(states), *verdicts])
    header = (
        *("sealed_pressure_MPa", "rod_speed_mm_s", "least_p_MPa", "least_p_without_MPa"),
        *("h_star_um", "h_star_without_um", "h_star_change_percent", "h_min_change_percent"),
        *("friction_change_percent", "verdict", "verdict_without"),
    )
    caption = f"{density_words(scope.mesh(16), 16)} Changes: without the penalty against with it."
    return FigureContent({"cavitation": CsvTable(header, rows)}, caption)


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


def order_cost(store: Store, scope: Scope) -> FigureContent:
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
    return FigureContent({"order_cost": CsvTable(header, rows)}, caption)


CHOICE_ITEMS = (
    Item("arc", "Where the lubricated arc ends", arc, _arc_requests),
    Item("cavitation", "The outstroke without cavitation", cavitation, _cavitation_requests),
    Item("order_cost", "What the order of the pressure costs", order_cost, _order_requests),
)
