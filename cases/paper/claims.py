"""Claims of the paper, each with the number measured here and whether it holds.

Section 5.2 on the numerical scheme; sections 5.1, 5.3 and the introduction on the lubricated seal.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import exp, isfinite, log

import numpy as np

from softehl.cases.paper import blind_predictions, checks, curves, inverse_theory, profiles, tables
from softehl.cases.paper.checks import observed_order
from softehl.cases.paper.curves import ORDERS
from softehl.cases.paper.figure_spec import STUDY_DENSITIES, CsvTable, FigureContent, Item, Scope
from softehl.cases.paper.lookup import (
    Finding,
    Measure,
    Query,
    angle,
    counted,
    difference,
    numbers,
    ripple,
)
from softehl.cases.paper.states import Request, Store
from softehl.cases.paper.tables import FIG_4_PRESSURES, TABLE_2, table_2_densities, unknowns
from softehl.cases.seal.gland.records import DENSITIES

VISIBLE = 0.05
"""Oscillation index that can be seen in a diagram: a zigzag of 1.25 % of h."""

RIPPLE = 0.02
"""Limit for a ripple, which includes the surroundings of the dip: 2 % of h*."""

MILD = 0.5
"""Oscillation index of a mild oscillation: a zigzag of an eighth of h."""

SAME = 0.1
"""Change of h* that a diagram of its errors shows, per cent."""

_FALLING = (800.0, 400.0, 200.0, 100.0, 50.0, 25.0)


def _index(query: Query, density: int, p_s: float, speed: float, **others: object) -> float:
    row = query.state(density, p_s, speed, **others).row
    return row.oscillation_index if row is not None else float("nan")


def _onset(query: Query, density: int, p_s: float, sign: float, **others: object) -> float:
    """The fastest |U| from 800 down with a visible ripple; 0 if none, nan if not known."""
    values = [(u, ripple(query.state(density, p_s, sign * u, **others))) for u in _FALLING]
    seen = [u for u, rise in values if rise > RIPPLE]
    return seen[0] if seen else (0.0 if all(isfinite(i) for _, i in values) else float("nan"))


def _refinement(query: Query) -> Finding:
    densities = query.scope.meshes(DENSITIES, default=8)
    rises = [ripple(query.state(d, 1.0, 400.0)) for d in densities]
    values = [_index(query, d, 1.0, 400.0) for d in densities]
    text = f"densities {numbers(densities)}: ripple {numbers(rises, '.2g')} h*, "
    fine = [rise for d, rise in zip(densities, rises, strict=True) if d >= 4]
    message = f"{text}index of the mid contact {numbers(values, '.2g')}"
    return Finding(message, max(fine) < RIPPLE if fine else None)


def _dip(query: Query) -> Finding:
    densities = query.scope.meshes((4, 8, 16), default=8)
    values = [query.row(d, 1.0, 400.0).h_min_um for d in densities]
    text = f"least h {numbers(values, '.4f')} um at densities {numbers(densities)}"
    return Finding(
        text, abs(values[0] - values[-1]) > 0.002 * values[-1] if len(values) > 1 else None
    )


def _high_orders(query: Query) -> Finding:
    d, errors = query.scope.mesh(2, 2), []
    for kind in ("fe", "dg"):
        pair = [query.state(d, 1.0, 400.0, reynolds=kind, pressure_order=m) for m in (5, 4)]
        errors.append(100.0 * difference(pair[0], pair[1]) / query.row(d, 1.0, 400.0).p_max_MPa)
    text = f"m_p = 4 against 5: at most {numbers(errors, '.2g')} % of p_max (FE, DG)"
    return Finding(text, max(errors) < 2.0)


def _jumps(query: Query) -> Finding:
    d = query.scope.mesh(2, 2)
    rows = [query.state(d, 1.0, 400.0, reynolds="dg", pressure_order=m).row for m in ORDERS]
    values = [r.pressure_jump_max_MPa if r else float("nan") for r in rows]
    comparison = counted(list(zip(values[1:], values, strict=False)), "falls with m_p")
    return Finding(
        f"{numbers(values, '.2g')} MPa for m_p = 1 to 5; {comparison.text}", comparison.holds
    )


def _dg_no_better(query: Query) -> Finding:
    d, rows = query.scope.mesh(8), []
    for sign in (1.0, -1.0):
        fe = [_index(query, d, 5.0, sign * u) for u in _FALLING]
        dg = [_index(query, d, 5.0, sign * u, reynolds="dg") for u in _FALLING]
        rows.append((fe, dg))
    text = "; ".join(
        f"{word} FE {numbers(fe, '.2g')} DG {numbers(dg, '.2g')}"
        for word, (fe, dg) in zip(("out", "in"), rows, strict=True)
    )
    pairs = [
        pair for fe, dg in rows for pair in zip(fe, dg, strict=True) if all(map(isfinite, pair))
    ]
    better = [a > 0.1 and b < 0.5 * a for a, b in pairs]
    holds = not any(better) if better else None
    return Finding(f"density {d}, index at 800 to 25: {text}", holds)


def _onset_density_8(query: Query) -> Finding:
    d = query.scope.meshes((4, 8, 16), default=8)[-1]
    out, back = _onset(query, d, 5.0, 1.0), _onset(query, d, 5.0, -1.0)
    text = f"density {d}: first ripple above {RIPPLE:g} h* at |U| = {out:g} (out), {back:g} (in)"
    return Finding(text, None if d != 8 else out == 200.0)


def _onset_by_density(query: Query) -> Finding:
    densities = query.scope.meshes((4, 8, 16), default=8)
    onsets = [_onset(query, d, 5.0, 1.0) for d in densities]
    text = f"outstroke, p_s = 5: |U| = {numbers(onsets)} at densities {numbers(densities)}"
    return Finding(text, counted(list(zip(onsets[1:], onsets, strict=False)), "").holds)


def _more_at_low_speed(query: Query) -> Finding:
    d = query.scope.mesh(16)
    values = [ripple(query.state(d, 5.0, u)) for u in _FALLING]
    comparison = counted(_seen(itertools.pairwise(values)), "halvings over which it grows")
    return Finding(f"ripple {numbers(values, '.2g')} h*; {comparison.text}", comparison.holds)


def _severe(query: Query) -> Finding:
    d = query.scope.mesh(16)
    values = [ripple(query.state(d, p, s * 200.0)) for p in (1.0, 5.0) for s in (1.0, -1.0)]
    text = f"ripple at |U| = 200: p_s 1 out {values[0]:.2g} in {values[1]:.2g} h*;"
    pairs = [(values[0], values[1]), (values[0], values[2]), (values[1], values[3])]
    comparison = counted(_seen(pairs), "comparisons that hold")
    return Finding(
        f"{text} p_s 5 out {values[2]:.2g} in {values[3]:.2g}; {comparison.text}", comparison.holds
    )


def _seen(pairs: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """The pairs of ripples of which one can be seen: the others are no oscillations."""
    return [pair for pair in pairs if not max(pair) <= RIPPLE]


def _mild_oscillations(query: Query) -> Finding:
    densities = query.scope.meshes((4, 8, 16), default=8)
    errors: dict[bool, list[float]] = {True: [], False: []}
    for u in _FALLING:
        coarse, fine = (query.state(d, 5.0, u) for d in (densities[0], densities[-1]))
        change = 100.0 * (coarse.h_star / fine.h_star - 1.0)
        if coarse.verdict == "oscillating" and densities[-1] > densities[0] and isfinite(change):
            errors[_index(query, densities[0], 5.0, u) < MILD].append(change)
    mild, severe = (numbers(errors[which], "+.2f") or "-" for which in (True, False))
    text = f"h* of density {densities[0]} against {densities[-1]}: {mild} % where the index is "
    holds = max(map(abs, errors[True])) < 1.0 if errors[True] else None
    return Finding(f"{text}below {MILD:g}, {severe} % above", holds)


def _converged(query: Query) -> float:
    """h* of the state of Fig. 16 extrapolated from the finest FE meshes, m_p = 4."""
    densities = query.scope.meshes(DENSITIES, default=8)
    films = [query.h(d, 1.0, 400.0) for d in densities]
    limit = observed_order(films)[1] if len(films) >= 3 else films[-1]
    return limit if isfinite(limit) else films[-1]


def mesh_errors(query: Query, density: int, orders: Sequence[int], **others: object) -> list[float]:
    """Errors of h* of the state of Fig. 16 at a density, one for each pressure order, per cent."""
    value = _converged(query)
    films = [query.h(density, 1.0, 400.0, pressure_order=m, **others) for m in orders]
    return [100.0 * (h / value - 1.0) for h in films]


def _order_2(query: Query) -> Finding:
    (error,) = mesh_errors(query, query.scope.mesh(2, 2), [2])
    text = f"{error:+.2f} % (converged: {_converged(query):.4f} um)"
    return Finding(text, -1.5 <= error <= -0.5 if isfinite(error) else None)


def _order_3(query: Query) -> Finding:
    errors = mesh_errors(query, query.scope.mesh(2, 2), [3, 4, 5])
    finite = all(isfinite(e) for e in errors)
    return Finding(
        f"{numbers(errors, '+.2f')} % for m_p = 3, 4, 5",
        max(map(abs, errors)) < 0.3 if finite else None,
    )


def _dg_worse(query: Query) -> Finding:
    d = query.scope.mesh(2, 2)
    fe, dg = mesh_errors(query, d, ORDERS), mesh_errors(query, d, ORDERS, reynolds="dg")
    text = f"density {d}, m_p = 1 to 5: FE {numbers(fe, '+.2f')} %, DG {numbers(dg, '+.2f')} %"
    count, total = (lambda pairs: (sum(abs(a) < abs(b) for a, b in pairs), len(pairs)))(
        [(a, b) for a, b in zip(fe, dg, strict=True) if isfinite(a) and isfinite(b)]
    )
    return Finding(
        f"{text}; FE closer for {count} of {total}", count > total / 2 if total else None
    )


def _dg_agrees(query: Query) -> Finding:
    d, errors = query.scope.mesh(8), []
    for sign in (1.0, -1.0):
        for u in _FALLING:
            a, b = query.h(d, 5.0, sign * u, reynolds="dg"), query.h(d, 5.0, sign * u)
            errors.append(100.0 * (a / b - 1.0))
    text = f"h* DG against FE, density {d}, p_s = 5: out {numbers(errors[:6], '+.2f')}, in "
    finite = [x for x in errors if isfinite(x)]
    return Finding(
        f"{text}{numbers(errors[6:], '+.2f')} %", max(map(abs, finite)) < 1.0 if finite else None
    )


def _solids(query: Query) -> Finding:
    densities, value = query.scope.meshes((1, 2, 4)), _converged(query)
    taylor, fbar = (
        [100 * (query.h(d, 1.0, 400.0, solid=s) / value - 1) for d in densities]
        for s in ("taylor", "fbar")
    )
    text = f"errors of h* at densities {numbers(densities)}: Taylor {numbers(taylor, '+.2f')} %, "
    pairs = [(abs(a), abs(b)) for a, b in zip(taylor, fbar, strict=True)]
    comparison = counted(pairs, "Taylor closer")
    return Finding(f"{text}F-bar {numbers(fbar, '+.2f')} %; {comparison.text}", comparison.holds)


def _solids_oscillate_alike(query: Query) -> Finding:
    d = query.scope.mesh(2, 2)
    values = [_index(query, d, 1.0, 400.0, solid=s) for s in ("taylor", "fbar")]
    text = f"density {d}: index {numbers(values, '.3g')} (Taylor, F-bar)"
    finite = all(isfinite(v) for v in values)
    return Finding(text, abs(values[0] - values[1]) < VISIBLE if finite else None)


def _quadrature(query: Query) -> Finding:
    cells: list[str] = []
    matters: list[bool] = []
    same: list[bool] = []
    for d in query.scope.meshes((1, 2, 4)):
        errors = []
        for m in (1, 2, 4):
            a, b = (
                query.h(d, 1.0, 400.0, pressure_order=m, quadrature=q) for q in ("lobatto", "gauss")
            )
            errors.append(100.0 * (a / b - 1.0))
            where = matters if d < 4 and m <= 2 else same
            where += [abs(errors[-1]) > SAME] if isfinite(errors[-1]) else []
        cells.append(f"density {d}: {numbers(errors, '+.2f')}")
    text = f"Lobatto against Gauss, m_p = 1, 2, 4: {'; '.join(cells)} %"
    return Finding(text, any(matters) and not any(same) if matters and same else None)


def _quadrature_oscillates_alike(query: Query) -> Finding:
    d = query.scope.mesh(2, 2)
    values = [_index(query, d, 1.0, 400.0, quadrature=q) for q in ("gauss", "lobatto")]
    finite = all(isfinite(v) for v in values)
    text = f"density {d}: index {numbers(values, '.3g')} (Gauss, Lobatto)"
    return Finding(text, abs(values[0] - values[1]) < VISIBLE if finite else None)


MESH: tuple[tuple[str, str, Measure], ...] = (
    ("5.2, Fig. 10", "p_s = 1, U = 400: free of oscillations from density 4 on", _refinement),
    ("5.2, Fig. 11", "the dip is resolved better beyond density 4", _dip),
    ("5.2, Fig. 12", "pressures of m_p = 4 and 5 hardly distinguished at density 2", _high_orders),
    ("5.2, Fig. 12", "DG jumps quickly decrease with the order", _jumps),
    ("5.2", "DG does not perform noticeably better as regards oscillations", _dg_no_better),
    (
        "5.2, Fig. 15",
        "density 8, p_s = 5, outstroke: oscillations appear at U = 200",
        _onset_density_8,
    ),
    (
        "5.2, Fig. 15",
        "the higher the density the lower the speed at which they appear",
        _onset_by_density,
    ),
    ("5.2, Figs. 13, 14", "oscillations more pronounced for decreasing speed", _more_at_low_speed),
    ("5.2", "severer with higher p_s and at instroke", _severe),
    ("5.2", "mild oscillations do not affect the film much", _mild_oscillations),
    ("5.2, Fig. 16", "density 2, FE, m_p = 2: h* 1 % low", _order_2),
    ("5.2, Fig. 16", "density 2, FE, m_p >= 3: error of h* below 0.3 %", _order_3),
    ("5.2, Fig. 16", "h* of DG somewhat worse than of FE", _dg_worse),
    ("5.2", "films of FE and DG do not differ significantly", _dg_agrees),
    ("5.2, Fig. 17", "convergence of h* slightly worse for F-bar", _solids),
    ("5.2", "no visible effect of the solid element on oscillations", _solids_oscillate_alike),
    ("5.2, Fig. 18", "quadrature matters only at densities 1, 2 and m_p <= 2", _quadrature),
    ("5.2", "oscillations not affected by the quadrature", _quadrature_oscillates_alike),
)


_LOW, _HIGH = 5.0, 20.0
"""Film thicknesses between which the inclination is taken, um."""


def _unknowns(query: Query) -> Finding:
    densities = table_2_densities(query.scope)
    counts = [unknowns(d)[0] for d in densities]
    errors = [100.0 * (n / TABLE_2[d][0] - 1.0) for d, n in zip(densities, counts, strict=True)]
    text = f"{', '.join(map(str, counts))}: {numbers(errors, '+.2f')} %"
    return Finding(text, all(x == 0.0 for x in errors))


def _pressure_unknowns(query: Query) -> Finding:
    densities = table_2_densities(query.scope)
    counts = [unknowns(d)[1] for d in densities]
    return Finding(", ".join(map(str, counts)), counts == [TABLE_2[d][1] for d in densities])


def _zone_expands(query: Query) -> Finding:
    density = query.scope.mesh(2, 2)
    pressures = query.scope.some_pressures(FIG_4_PRESSURES)
    rows = [query.row(density, p_s, 400.0) for p_s in pressures]
    starts, stops = [r.contact_start_mm for r in rows], [r.contact_end_mm for r in rows]
    moved = (max(starts) - min(starts), stops[-1] - stops[0])
    text = f"air end {numbers(stops)} mm, sealed end {numbers(starts)} mm over p_s"
    if len(rows) < 2:
        return Finding(text, None)
    return Finding(text, stops == sorted(stops) and moved[0] < 0.25 * moved[1])


def _minimum_at_outlet(query: Query) -> Finding:
    fractions = []
    for sign in (1.0, -1.0):
        row = query.row(query.density, 1.0, sign * 100.0)
        profile = query.state(query.density, 1.0, sign * 100.0).profile
        x = float(profile.x_mm[int(np.argmin(profile.h_um))])
        inside = row.contact_end_mm - x if sign > 0 else x - row.contact_start_mm
        fractions.append(100.0 * inside / (row.contact_end_mm - row.contact_start_mm))
    text = f"{numbers(fractions)} % of the width (h < 20 um) from the outlet end (out, in)"
    return Finding(text, all(0.0 <= share < 10.0 for share in fractions))


def _pressure_drop(query: Query) -> Finding:
    p_s = query.scope.pressure(2.0)
    out = query.state(query.density, p_s, 100.0).profile
    back = query.state(query.density, p_s, -100.0)
    row, profile = query.row(query.density, p_s, -100.0), back.profile
    vicinity = np.abs(profile.x_mm - row.contact_start_mm) < 0.1
    drop = p_s - float(profile.p_MPa[vicinity].min())
    text = (
        f"instroke: p falls {drop:.2f} MPa below p_s at the sealed end; outstroke: least p "
        f"{float(out.p_MPa.min()):.1e} MPa"
    )
    return Finding(text, drop > 0.1 and float(out.p_MPa.min()) > -0.05)


def _inclination(query: Query) -> Finding:
    angles = []
    for p_s in (1.0, 2.0):
        for sign in (1.0, -1.0):
            profile = query.state(query.density, p_s, sign * 100.0).profile
            x, h = profile.x_mm, profile.h_um
            low = int(np.argmin(h))
            angles.append(angle(x[: low + 1][::-1], h[: low + 1][::-1], low=_LOW, high=_HIGH))
            angles.append(angle(x[low:], h[low:], low=_LOW, high=_HIGH))
    holds = all(10.0 <= a <= 15.0 for a in angles)
    text = f"p_s 1: out {numbers(angles[:2])}, in {numbers(angles[2:4])}; p_s 2: out "
    text += (
        f"{numbers(angles[4:6])}, in {numbers(angles[6:])} degrees (sealed, air; h = 5 to 20 um)"
    )
    return Finding(text, holds)


def _thinner_instroke(query: Query) -> Finding:
    d = query.density
    pairs = [
        (query.h(d, p, -u), query.h(d, p, u))
        for p in query.pressures
        if p > 0
        for u in query.speeds
    ]
    return counted(pairs, "pairs at p_s > 0 with the thinner film at instroke")


def _falls_with_speed(query: Query) -> Finding:
    d, exponents = query.density, []
    fast, slow = query.speeds[0], query.speeds[-1]
    for p in query.pressures:
        for sign in (1.0, -1.0):
            films = [(u, query.h(d, p, sign * u)) for u in (fast, slow)]
            if fast > slow and all(isfinite(h) for _, h in films):
                exponents.append(log(films[0][1] / films[1][1]) / log(fast / slow))
    if not exponents:
        return Finding("not measured", None)
    text = (
        f"h* ~ |U|^n with n = {min(exponents):.3f} to {max(exponents):.3f} between the end speeds"
    )
    return Finding(text, min(exponents) > 0.3)


def _with_sealed_pressure(sign: float) -> Measure:
    def measure(query: Query) -> Finding:
        d, pairs = query.density, []
        for u in query.speeds:
            films = [query.h(d, p, sign * u) for p in query.pressures]
            pairs += [(a, b) if sign > 0 else (b, a) for a, b in itertools.pairwise(films)]
        word = "rises" if sign > 0 else "falls"
        comparison = counted(pairs, f"steps of p_s over which h* {word}")
        films = [query.h(d, p, sign * 400.0) for p in query.pressures]
        return Finding(
            f"{comparison.text}; h* at |U| = 400: {numbers(films, '.4g')} um", comparison.holds
        )

    return measure


def _weaker_at_outstroke(query: Query) -> Finding:
    low, high = query.pressures[0], query.pressures[-1]
    changes = [
        100.0
        * (query.h(query.density, high, s * 400.0) / query.h(query.density, low, s * 400.0) - 1.0)
        for s in (1.0, -1.0)
    ]
    text = f"|U| = 400, p_s {low:g} to {high:g}: outstroke {changes[0]:+.1f} %, instroke "
    return Finding(f"{text}{changes[1]:+.1f} %", _less(abs(changes[0]), abs(changes[1])))


def _less(a: float, b: float) -> bool | None:
    return a < b if isfinite(a) and isfinite(b) and (a or b) else None


def _h_star_at_maximum(query: Query) -> Finding:
    errors = []
    for sign in (1.0, -1.0):
        state = query.state(query.density, 1.0, sign * 400.0)
        profile = state.profile
        h = float(profile.h_um[int(np.argmax(profile.p_MPa))])
        errors.append(100.0 * (h / state.h_star - 1.0))
    return Finding(
        f"h there differs from q/u by {numbers(errors, '+.2g')} %", max(map(abs, errors)) < 1.0
    )


def _flux_constant(query: Query) -> Finding:
    rows = [
        query.state(query.density, p, s * u).row
        for p in query.pressures
        for u in query.speeds
        for s in (1.0, -1.0)
    ]
    worst = max(
        row.flux_variation for row in rows if row is not None and row.verdict != "collapsed"
    )
    return Finding(
        f"element means vary by at most {worst:.1e} of q outside cavitation", worst < 1e-5
    )


def _zones_shrink(query: Query) -> Finding:
    pairs, d = [], query.density
    for sign in (1.0, -1.0):
        rows = [query.state(d, 1.0, sign * u).row for u in query.speeds]
        widths = [r.inlet_segments if r else float("nan") for r in rows]
        pairs += list(zip(widths[1:], widths, strict=False))
    return counted(pairs, "halvings of |U| over which the inlet (10 h* to 1.5 h*) gets shorter")


def _near_contact(query: Query) -> Finding:
    errors, p_s = [], query.scope.pressure(1.0)
    for sign in (1.0, -1.0):
        row = query.row(query.density, p_s, sign * 100.0)
        errors.append(100.0 * (row.p_max_MPa / row.contact_p_max_MPa - 1.0))
    return Finding(
        f"largest pressure against dry contact: {numbers(errors, '+.2f')} %",
        max(map(abs, errors)) < 2.0,
    )


def _contact_width(query: Query) -> Finding:
    def width(p_s: float, u: float) -> float:
        row = query.row(query.density, p_s, u)
        return row.contact_end_mm - row.contact_start_mm

    fast, slow = query.speeds[0], query.speeds[-1]
    low, high = query.pressures[0], query.pressures[-1]
    by_p, by_u = width(high, fast) - width(low, fast), width(1.0, slow) - width(1.0, fast)
    text = f"width changes by {by_p:+.3f} mm over p_s and {by_u:+.3f} mm over |U| (outstroke)"
    return Finding(text, _less(abs(by_u), abs(by_p)))


def _thin(query: Query) -> Finding:
    rows = [
        query.state(query.density, p, s * u).row
        for p in query.pressures
        for u in query.speeds
        for s in (1.0, -1.0)
    ]
    minimum = min(row.h_star_um for row in rows if row is not None and row.verdict == "ok")
    return Finding(f"smallest h* with verdict ok: {minimum:.3f} um", minimum < 1.0)


def _shear(query: Query) -> Finding:
    p_s, d, changes = query.scope.pressure(1.0), query.density, []
    for u in (sign * speed for sign in (1.0, -1.0) for speed in query.speeds):
        a, b = query.state(d, p_s, u), query.state(d, p_s, u, shear_traction=False)
        if a.plain and b.plain:
            changes.append(100.0 * (a.h_star / b.h_star - 1.0))
    if not changes:
        return Finding("no state with the verdict ok", None)
    (error,) = mesh_errors(query, d, [4])
    extremes = min(changes), max(changes)
    text = (
        f"with it h* changes by {numbers(extremes, '+.2f')} % (down, up); h* is {error:+.2f} % off"
    )
    finite = isfinite(error)
    return Finding(f"{text} itself", max(map(abs, extremes)) > 2.0 * abs(error) if finite else None)


def _barus_30(query: Query) -> Finding:
    ratio = exp(0.02 * 30.0)
    return Finding(f"{ratio:.2f}", abs(ratio - 1.8) < 0.05)


def _piezo(sign: float) -> Measure:
    def measure(query: Query) -> Finding:
        changes = []
        for p in query.pressures:
            fine = (
                query.scope.meshes(STUDY_DENSITIES, default=8)[-1]
                if p == query.scope.pressure(5.0)
                else 0
            )
            d = max(fine, query.density)  # at 5 MPa there is a mesh study
            a = query.h(d, p, sign * 100.0)
            b = query.h(d, p, sign * 100.0, pressure_viscosity=0.0)
            changes.append(100.0 * (a / b - 1.0))
        text = f"p_s {numbers(query.pressures)}: {numbers(changes, '+.2f')} %"
        finite = [c for c in changes if isfinite(c)]
        if sign > 0:
            return Finding(
                text, finite == sorted(finite) and finite[-1] > 1.0 if len(finite) > 1 else None
            )
        return Finding(text, max(map(abs, finite)) < 1.0 if finite else None)

    return measure


def _piezo_pressure(query: Query) -> Finding:
    d, errors = query.density, []
    for sign in (1.0, -1.0):
        query.row(d, 5.0, sign * 100.0)
        constant = query.state(d, 5.0, sign * 100.0, pressure_viscosity=0.0)
        change = difference(constant, query.state(d, 5.0, sign * 100.0), margin=0.1)
        errors.append(change / query.row(d, 5.0, sign * 100.0).p_max_MPa)
    percent = numbers([100 * x for x in errors], ".2g")
    text = f"largest difference in the mid contact {percent} % of p_max"
    return Finding(text, max(errors) < 0.01)


FILM: tuple[tuple[str, str, Measure], ...] = (
    ("Table 2", "unknowns 1076, 3587, 12929, 48893, 189941", _unknowns),
    ("Table 2", "pressure unknowns 109, 217, 433, 865, 1729", _pressure_unknowns),
    (
        "5.1, Fig. 4",
        "contact expands at the air side with p_s, the sealed side hardly moves",
        _zone_expands,
    ),
    ("5.1", "sharp film minimum at the end of the contact, in the outlet", _minimum_at_outlet),
    (
        "5.1",
        "instroke: sudden pressure drop at the sealed side; outstroke: excluded by cavitation",
        _pressure_drop,
    ),
    ("5.1", "inclination of 10 to 15 degrees in the inlet and outlet zones", _inclination),
    ("5.1", "film thinner at instroke than at outstroke", _thinner_instroke),
    ("5.1", "film thickness strongly decreases if the rod speed decreases", _falls_with_speed),
    ("5.1, Fig. 9", "instroke: film decreases with p_s", _with_sealed_pressure(-1.0)),
    ("5.1, Fig. 9", "outstroke: film increases with p_s", _with_sealed_pressure(1.0)),
    ("5.1, Fig. 9", "the effect of p_s is weaker at outstroke", _weaker_at_outstroke),
    ("3, (16)", "h* is the film thickness at the point of maximum pressure", _h_star_at_maximum),
    ("3, (14)", "flux is constant along the boundary", _flux_constant),
    ("5.1, Fig. 8", "lower speed: smaller inlet and outlet zones", _zones_shrink),
    ("5.1", "pressure is very close to that of pure contact", _near_contact),
    ("6", "size of the contact depends on p_s, much more weakly on speed", _contact_width),
    ("6", "film in some cases well below 1 um", _thin),
    ("3", "effect of the shear stress not negligible in some conditions", _shear),
    ("5.3", "viscosity 1.8 times at 30 MPa", _barus_30),
    ("5.3, Fig. 20", "outstroke: (13) raises the film, more with p_s", _piezo(1.0)),
    ("5.3, Fig. 20", "instroke: (13) has no visible effect", _piezo(-1.0)),
    ("5.3", "pressure not visibly affected by (13)", _piezo_pressure),
)


__all__ = ["FINDINGS", "Finding", "Query"]

FINDINGS: tuple[tuple[str, str, Callable[[Query], Finding]], ...] = (*FILM, *MESH)


WORDS = {True: "yes", False: "no", None: "-"}
"""True if a statement holds; None where a number that it takes was not reached."""

_SOURCES: Sequence[Item] = (
    *tables.ITEMS,
    *profiles.ITEMS,
    *curves.ITEMS,
    *checks.ITEMS,
    *blind_predictions.ITEMS,
    *inverse_theory.ITEMS,
    *checks.ONSET_ITEMS,
)


@dataclass(frozen=True)
class Claim:
    """A statement: where the paper makes it, what it says, and how it is measured."""

    reference: str
    text: str
    measure: Callable[[Query], Finding]


STATEMENTS = tuple(Claim(reference, text, measure) for reference, text, measure in FINDINGS)


def _requests(scope: Scope) -> list[Request]:
    return [request for item in _SOURCES for request in item.requests(scope)]


def statements(store: Store, scope: Scope) -> FigureContent:
    """Every statement with its measured number."""
    query = Query(store, scope)
    rows = []
    for number, statement in enumerate(STATEMENTS, start=1):
        try:
            finding = statement.measure(query)
        except ValueError as error:  # a state that it needs was not reached
            finding = Finding(str(error), None)
        verdict = WORDS[finding.holds]
        rows.append((str(number), statement.reference, statement.text, finding.text, verdict))
    header = ("number", "place", "statement", "measured", "holds")
    caption = "Measured from the runs of the other items."
    return FigureContent({"statements": CsvTable(header, rows)}, caption)


ITEMS = (Item("statements", "The paper's statements", statements, _requests),)
