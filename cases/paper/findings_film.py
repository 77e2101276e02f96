"""Statements on the lubricated seal: section 5.1, section 5.3 and the introduction."""

from __future__ import annotations

import itertools
from math import exp, isfinite, log

import numpy as np

from softehl.cases.paper.findings_mesh import mesh_errors
from softehl.cases.paper.item import STUDY_DENSITIES
from softehl.cases.paper.query import Finding, Measure, Query, angle, counted, difference, numbers
from softehl.cases.paper.tables import FIG_4_PRESSURES, TABLE_2, table_2_densities, unknowns

_LAYERS = (5.0, 20.0)
"""Film thicknesses between which the inclination is taken, um."""


def _unknowns(query: Query) -> Finding:
    densities = table_2_densities(query.scope)
    ours = [unknowns(d)[0] for d in densities]
    off = [100.0 * (n / TABLE_2[d][0] - 1.0) for d, n in zip(densities, ours, strict=True)]
    text = f"{', '.join(map(str, ours))}: {numbers(off, '+.2f')} %"
    return Finding(text, all(x == 0.0 for x in off))


def _pressure_unknowns(query: Query) -> Finding:
    densities = table_2_densities(query.scope)
    ours = [unknowns(d)[1] for d in densities]
    return Finding(", ".join(map(str, ours)), ours == [TABLE_2[d][1] for d in densities])


def _zone_expands(query: Query) -> Finding:
    density = query.scope.mesh(2, 2)
    ends = []
    for p_s in query.scope.some_pressures(FIG_4_PRESSURES):
        row = query.row(density, p_s, 400.0)
        ends.append((row.contact_start_mm, row.contact_end_mm))
    starts, stops = zip(*ends, strict=True)
    moved = (max(starts) - min(starts), stops[-1] - stops[0])
    text = f"air end {numbers(stops)} mm, sealed end {numbers(starts)} mm over p_s"
    if len(ends) < 2:
        return Finding(text, None)
    return Finding(text, list(stops) == sorted(stops) and moved[0] < 0.25 * moved[1])


def _minimum_at_outlet(query: Query) -> Finding:
    shares = []
    for sign in (1.0, -1.0):
        row = query.row(query.density, 1.0, sign * 100.0)
        profile = query.state(query.density, 1.0, sign * 100.0).profile
        x = float(profile.x_mm[int(np.argmin(profile.h_um))])
        inside = row.contact_end_mm - x if sign > 0 else x - row.contact_start_mm
        shares.append(100.0 * inside / (row.contact_end_mm - row.contact_start_mm))
    text = f"{numbers(shares)} % of the width (h < 20 um) from the outlet end (out, in)"
    return Finding(text, all(0.0 <= share < 10.0 for share in shares))


def _pressure_drop(query: Query) -> Finding:
    p_s = query.scope.pressure(2.0)
    out = query.state(query.density, p_s, 100.0).profile
    back = query.state(query.density, p_s, -100.0)
    row, profile = query.row(query.density, p_s, -100.0), back.profile
    near = np.abs(profile.x_mm - row.contact_start_mm) < 0.1
    drop = p_s - float(profile.p_MPa[near].min())
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
            angles.append(angle(x[: low + 1][::-1], h[: low + 1][::-1], *_LAYERS))
            angles.append(angle(x[low:], h[low:], *_LAYERS))
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
    d, slopes = query.density, []
    fast, slow = query.speeds[0], query.speeds[-1]
    for p in query.pressures:
        for sign in (1.0, -1.0):
            films = [(u, query.h(d, p, sign * u)) for u in (fast, slow)]
            if fast > slow and all(isfinite(h) for _, h in films):
                slopes.append(log(films[0][1] / films[1][1]) / log(fast / slow))
    if not slopes:
        return Finding("not measured", None)
    text = f"h* ~ |U|^n with n = {min(slopes):.3f} to {max(slopes):.3f} between the end speeds"
    return Finding(text, min(slopes) > 0.3)


def _with_sealed_pressure(sign: float) -> Measure:
    def measure(query: Query) -> Finding:
        d, pairs = query.density, []
        for u in query.speeds:
            films = [query.h(d, p, sign * u) for p in query.pressures]
            pairs += [(a, b) if sign > 0 else (b, a) for a, b in itertools.pairwise(films)]
        word = "rises" if sign > 0 else "falls"
        found = counted(pairs, f"steps of p_s over which h* {word}")
        films = [query.h(d, p, sign * 400.0) for p in query.pressures]
        return Finding(f"{found.text}; h* at |U| = 400: {numbers(films, '.4g')} um", found.holds)

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
    off = []
    for sign in (1.0, -1.0):
        state = query.state(query.density, 1.0, sign * 400.0)
        profile = state.profile
        h = float(profile.h_um[int(np.argmax(profile.p_MPa))])
        off.append(100.0 * (h / state.h_star - 1.0))
    return Finding(
        f"h there differs from q/u by {numbers(off, '+.2g')} %", max(map(abs, off)) < 1.0
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
    off, p_s = [], query.scope.pressure(1.0)
    for sign in (1.0, -1.0):
        row = query.row(query.density, p_s, sign * 100.0)
        off.append(100.0 * (row.p_max_MPa / row.contact_p_max_MPa - 1.0))
    return Finding(
        f"largest pressure against dry contact: {numbers(off, '+.2f')} %", max(map(abs, off)) < 2.0
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
    least = min(row.h_star_um for row in rows if row is not None and row.verdict == "ok")
    return Finding(f"smallest h* with verdict ok: {least:.3f} um", least < 1.0)


def _shear(query: Query) -> Finding:
    p_s, d, changes = query.scope.pressure(1.0), query.density, []
    for u in (sign * speed for sign in (1.0, -1.0) for speed in query.speeds):
        a, b = query.state(d, p_s, u), query.state(d, p_s, u, shear_traction=False)
        if a.plain and b.plain:
            changes.append(100.0 * (a.h_star / b.h_star - 1.0))
    if not changes:
        return Finding("no state with the verdict ok", None)
    (error,) = mesh_errors(query, d, [4])
    ends = min(changes), max(changes)
    text = f"with it h* changes by {numbers(ends, '+.2f')} % (down, up); h* is {error:+.2f} % off"
    known = isfinite(error)
    return Finding(f"{text} itself", max(map(abs, ends)) > 2.0 * abs(error) if known else None)


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
        known = [c for c in changes if isfinite(c)]
        if sign > 0:
            return Finding(
                text, known == sorted(known) and known[-1] > 1.0 if len(known) > 1 else None
            )
        return Finding(text, max(map(abs, known)) < 1.0 if known else None)

    return measure


def _piezo_pressure(query: Query) -> Finding:
    d, off = query.density, []
    for sign in (1.0, -1.0):
        query.row(d, 5.0, sign * 100.0)
        pair = (
            query.state(d, 5.0, sign * 100.0, pressure_viscosity=0.0),
            query.state(d, 5.0, sign * 100.0),
        )
        off.append(difference(*pair, margin=0.1) / query.row(d, 5.0, sign * 100.0).p_max_MPa)
    text = (
        f"largest difference in the mid contact {numbers([100 * x for x in off], '.2g')} % of p_max"
    )
    return Finding(text, max(off) < 0.01)


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
