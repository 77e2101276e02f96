"""Statements on the numerical scheme: section 5.2."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from math import isfinite

from softehl.cases.paper.checks import observed_order
from softehl.cases.paper.curves import ORDERS
from softehl.cases.paper.query import Finding, Measure, Query, counted, difference, numbers, ripple
from softehl.cases.seal.gland.records.discretisation import DENSITIES

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
    words = f"{text}index of the mid contact {numbers(values, '.2g')}"
    return Finding(words, max(fine) < RIPPLE if fine else None)


def _dip(query: Query) -> Finding:
    densities = query.scope.meshes((4, 8, 16), default=8)
    values = [query.row(d, 1.0, 400.0).h_min_um for d in densities]
    text = f"least h {numbers(values, '.4f')} um at densities {numbers(densities)}"
    return Finding(
        text, abs(values[0] - values[-1]) > 0.002 * values[-1] if len(values) > 1 else None
    )


def _high_orders(query: Query) -> Finding:
    d, off = query.scope.mesh(2, 2), []
    for kind in ("fe", "dg"):
        pair = [query.state(d, 1.0, 400.0, reynolds=kind, pressure_order=m) for m in (5, 4)]
        off.append(100.0 * difference(pair[0], pair[1]) / query.row(d, 1.0, 400.0).p_max_MPa)
    text = f"m_p = 4 against 5: at most {numbers(off, '.2g')} % of p_max (FE, DG)"
    return Finding(text, max(off) < 2.0)


def _jumps(query: Query) -> Finding:
    d = query.scope.mesh(2, 2)
    rows = [query.state(d, 1.0, 400.0, reynolds="dg", pressure_order=m).row for m in ORDERS]
    values = [r.pressure_jump_max_MPa if r else float("nan") for r in rows]
    found = counted(list(zip(values[1:], values, strict=False)), "falls with m_p")
    return Finding(f"{numbers(values, '.2g')} MPa for m_p = 1 to 5; {found.text}", found.holds)


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
    found = counted(_seen(itertools.pairwise(values)), "halvings over which it grows")
    return Finding(f"ripple {numbers(values, '.2g')} h*; {found.text}", found.holds)


def _severe(query: Query) -> Finding:
    d = query.scope.mesh(16)
    values = [ripple(query.state(d, p, s * 200.0)) for p in (1.0, 5.0) for s in (1.0, -1.0)]
    text = f"ripple at |U| = 200: p_s 1 out {values[0]:.2g} in {values[1]:.2g} h*;"
    pairs = [(values[0], values[1]), (values[0], values[2]), (values[1], values[3])]
    found = counted(_seen(pairs), "comparisons that hold")
    return Finding(
        f"{text} p_s 5 out {values[2]:.2g} in {values[3]:.2g}; {found.text}", found.holds
    )


def _seen(pairs: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
    """The pairs of ripples of which one can be seen: the others are no oscillations."""
    return [pair for pair in pairs if not max(pair) <= RIPPLE]


def _mild_oscillations(query: Query) -> Finding:
    densities = query.scope.meshes((4, 8, 16), default=8)
    off: dict[bool, list[float]] = {True: [], False: []}
    for u in _FALLING:
        coarse, fine = (query.state(d, 5.0, u) for d in (densities[0], densities[-1]))
        change = 100.0 * (coarse.h_star / fine.h_star - 1.0)
        if coarse.verdict == "oscillating" and densities[-1] > densities[0] and isfinite(change):
            off[_index(query, densities[0], 5.0, u) < MILD].append(change)
    mild, severe = (numbers(off[which], "+.2f") or "-" for which in (True, False))
    text = f"h* of density {densities[0]} against {densities[-1]}: {mild} % where the index is "
    holds = max(map(abs, off[True])) < 1.0 if off[True] else None
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
    known = all(isfinite(e) for e in errors)
    return Finding(
        f"{numbers(errors, '+.2f')} % for m_p = 3, 4, 5",
        max(map(abs, errors)) < 0.3 if known else None,
    )


def _dg_worse(query: Query) -> Finding:
    d = query.scope.mesh(2, 2)
    fe, dg = mesh_errors(query, d, ORDERS), mesh_errors(query, d, ORDERS, reynolds="dg")
    text = f"density {d}, m_p = 1 to 5: FE {numbers(fe, '+.2f')} %, DG {numbers(dg, '+.2f')} %"
    held, known = (lambda pairs: (sum(abs(a) < abs(b) for a, b in pairs), len(pairs)))(
        [(a, b) for a, b in zip(fe, dg, strict=True) if isfinite(a) and isfinite(b)]
    )
    return Finding(f"{text}; FE closer for {held} of {known}", held > known / 2 if known else None)


def _dg_agrees(query: Query) -> Finding:
    d, off = query.scope.mesh(8), []
    for sign in (1.0, -1.0):
        for u in _FALLING:
            a, b = query.h(d, 5.0, sign * u, reynolds="dg"), query.h(d, 5.0, sign * u)
            off.append(100.0 * (a / b - 1.0))
    text = f"h* DG against FE, density {d}, p_s = 5: out {numbers(off[:6], '+.2f')}, in "
    known = [x for x in off if isfinite(x)]
    return Finding(
        f"{text}{numbers(off[6:], '+.2f')} %", max(map(abs, known)) < 1.0 if known else None
    )


def _solids(query: Query) -> Finding:
    densities, value = query.scope.meshes((1, 2, 4)), _converged(query)
    rows = [
        [100 * (query.h(d, 1.0, 400.0, solid=s) / value - 1) for d in densities]
        for s in ("taylor", "fbar")
    ]
    text = f"errors of h* at densities {numbers(densities)}: Taylor {numbers(rows[0], '+.2f')} %, "
    pairs = [(abs(a), abs(b)) for a, b in zip(*rows, strict=True)]
    found = counted(pairs, "Taylor closer")
    return Finding(f"{text}F-bar {numbers(rows[1], '+.2f')} %; {found.text}", found.holds)


def _solids_oscillate_alike(query: Query) -> Finding:
    d = query.scope.mesh(2, 2)
    values = [_index(query, d, 1.0, 400.0, solid=s) for s in ("taylor", "fbar")]
    text = f"density {d}: index {numbers(values, '.3g')} (Taylor, F-bar)"
    known = all(isfinite(v) for v in values)
    return Finding(text, abs(values[0] - values[1]) < VISIBLE if known else None)


def _quadrature(query: Query) -> Finding:
    cells: list[str] = []
    matters: list[bool] = []
    same: list[bool] = []
    for d in query.scope.meshes((1, 2, 4)):
        off = []
        for m in (1, 2, 4):
            a, b = (
                query.h(d, 1.0, 400.0, pressure_order=m, quadrature=q) for q in ("lobatto", "gauss")
            )
            off.append(100.0 * (a / b - 1.0))
            where = matters if d < 4 and m <= 2 else same
            where += [abs(off[-1]) > SAME] if isfinite(off[-1]) else []
        cells.append(f"density {d}: {numbers(off, '+.2f')}")
    text = f"Lobatto against Gauss, m_p = 1, 2, 4: {'; '.join(cells)} %"
    return Finding(text, any(matters) and not any(same) if matters and same else None)


def _quadrature_oscillates_alike(query: Query) -> Finding:
    d = query.scope.mesh(2, 2)
    values = [_index(query, d, 1.0, 400.0, quadrature=q) for q in ("gauss", "lobatto")]
    known = all(isfinite(v) for v in values)
    text = f"density {d}: index {numbers(values, '.3g')} (Gauss, Lobatto)"
    return Finding(text, abs(values[0] - values[1]) < VISIBLE if known else None)


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
