"""Results of a converged film of a seal: h*, pressure, friction, leakage, limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from math import copysign, nan
from typing import Any

import numpy as np

from softehl.cases.seal.equations.definition import FACET, FILM
from softehl.cases.seal.equations.loads import FilmLoads, Stroke
from softehl.cases.seal.equations.system import SealSystem
from softehl.cases.seal.gland.surfaces import MICROMETRE, regime
from softehl.cases.seal.states.contacts import CONTACT_FILM, contact_film, contact_level, groups
from softehl.cases.seal.states.heat import FilmHeat, film_heat
from softehl.cases.seal.states.mesh_indicators import (
    INLET,
    THIN,
    built_up,
    end_gap,
    inlet_ratio,
    inlet_segments,
    lacking,
    oscillation,
    wedge,
    wedge_friction,
)
from softehl.cases.seal.states.section_view import film_pressure, section_view
from softehl.cases.seal.states.state import FilmState, Profile
from softehl.cases.seal.states.verdict import (
    LARGEST_ERROR,
    ContactNumbers,
    FilmNumbers,
    Verdict,
)
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.postprocessing import (
    element_means,
    interval_below,
    relative_spread,
    run_around,
)
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.discretisation.quadrature import trace_rule

_TORN = 1e-6
"""Void fraction of a film that has ruptured; 1e-9 and 1e-3 give three seals the same ratios."""


def film_numbers(system: SealSystem, problem: Problem, film: FilmLoads, x: Array) -> FilmNumbers:
    """Scalars of a converged film with the unknowns x.

    The flux is that at the largest pressure; of several contacts in the one that `metering` finds.
    """
    at = problem.fields(FILM, x)
    z, h = system.arc_film(x)
    level = contact_film(h, system.parameters.lobes)
    parts = film_parts(h, level)
    first = metering(at, parts, film.stroke)
    top, inlet = _top(at, first), {name: values[first] for name, values in at.items()}
    q, variation, jump = _flux(system, problem, at, x, top)
    h_star = q / (0.5 * film.rod_speed)
    within = min(level, THIN * h_star) if h_star > 0.0 else level
    heat = None
    if system.parameters.heating:
        out = film.stroke == "out"
        drawn = slice(first.start, top + 1) if out else slice(top, first.stop)
        heat = film_heat(system, at, film, drawn, h_star)
        at = heat.warmed(at)
    drag, friction = (
        float(system.around * (tau * at["dx"]).sum())
        for tau in (0.5 * (at["tau_rod"] + at["tau"]), at["tau_rod"])
    )
    flow = float(film.along(at["eta"].ravel())[0]) * film.speed
    distance, gap = wedge(system, film.stroke, x)
    entrance = built_up(distance, gap, flow=flow, h_star=h_star)
    sliding, rubbed = wedge_friction(system, distance, gap, flow=flow, h_star=h_star)
    distance, gap = wedge(system, "in" if film.stroke == "out" else "out", x)
    # no pressure is built up there
    beyond, _ = wedge_friction(system, distance, gap, flow=flow, h_star=h_star)
    if film.entrance:
        drag += copysign(sliding, film.rod_speed)
        friction += copysign(rubbed, film.rod_speed)
    else:
        beyond += abs(rubbed)
    return FilmNumbers(
        speed=film.speed,
        flux=q,
        h_star=h_star,
        h_min=float(h.min()),
        p_max=float(at["p"].max()),
        friction=friction,
        flux_variation=variation,
        jump=jump,
        oscillation=max(oscillation(z[_nodes(k)], h[_nodes(k)], within) for k in parts),
        inlet_segments=inlet_segments(film.along(h[_nodes(first)]), h_star),
        inlet_ratio=1.0 if system.parameters.rough else inlet_ratio(inlet, film, h_star),
        end_gap=end_gap(film.along(copysign(1.0, film.rod_speed) * z), film.along(h)),
        entrance=entrance,
        lacking=0.0 if system.parameters.rough else lacking(inlet, film, entrance),
        **rough_numbers(system, at),
        contacts=_contacts(at, (z, h), parts, film, level) if len(parts) > 1 else (),
        fluxes=() if system.parameters.conserving else parted_fluxes(at),
        drag=drag,
        beyond=beyond / abs(friction),
        heat=heat,
    )


def _flux(
    system: SealSystem, problem: Problem, at: Mapping[str, Array], x: Array, top: int
) -> tuple[float, float, float]:
    """Flux at a segment, its relative spread, and the largest jump of the pressure at a facet.

    Of continuous pressures the flux is the mean over the segment. Of discontinuous ones it is that
    of (23) at its facets, which (21) and (22) make constant. The spread is taken over the
    neighbours on both sides up to where the film cavitates, eqs. (16) and (25).
    """
    around, full_film = slice(top, top + 1), run_around(at["p"].min(axis=1) >= 0.0, top)
    flux, jump = element_means(at["flux"], at["dx"]), 0.0
    if system.parameters.reynolds == "dg":
        facets = problem.fields(FACET, x)
        flux, jump = facets["flux"][:, 0], float(np.abs(facets["jump"]).max())
        around, full_film = (slice(max(k.start - 1, 0), k.stop) for k in (around, full_film))
    return float(flux[around].mean()), relative_spread(flux[full_film]), jump


def parted_fluxes(at: Mapping[str, Array]) -> tuple[float, ...]:
    """Flux of each part of a film that is whole, between places where it cavitates.

    at: fields of the film, (segments, points) each. A penalty lets oil in or out where the pressure
    is below zero. Parts with less than `LARGEST_ERROR` per cent of both load and friction are left
    out, as behind the exit: their oil changes neither by more. None of a film with one part.
    """
    full_film = np.flatnonzero(at["p"].min(axis=1) >= 0.0)
    parts = [
        part
        for part in np.split(full_film, np.flatnonzero(np.diff(full_film) > 1) + 1)
        if len(part)
    ]
    fractions = [np.abs(at[name] * at["dx"]).sum(axis=1) for name in ("p", "tau_rod")]
    minimum = 0.01 * LARGEST_ERROR
    selected = [part for part in parts if any(v[part].sum() > minimum * v.sum() for v in fractions)]
    if len(selected) < 2:
        return ()
    flux = element_means(at["flux"], at["dx"])
    return tuple(float(flux[part[int(at["p"][part].max(axis=1).argmax())]]) for part in selected)


def film_parts(h: Array, level: float = CONTACT_FILM) -> list[slice]:
    """The segments of each contact, from the sealed side on; together they are the whole film.

    h: (nodes,). level: of `contact_film`. Contacts are parted where the film between them is
    thickest.
    """
    contacts = groups(h, h < level, level)
    between = [(a[-1], b[0]) for a, b in pairwise(contacts)]
    cuts = [0, *(int(a + np.argmax(h[a : b + 1])) for a, b in between), len(h) - 1]
    return [slice(a, b) for a, b in pairwise(cuts)]


def _nodes(part: slice) -> slice:
    return slice(part.start, part.stop + 1)


def metering(at: Mapping[str, Array], parts: Sequence[slice], stroke: Stroke) -> slice:
    """The part of the film that meters the flux: of the first contact with a peak of its own.

    at: fields of the film; parts: of `film_parts`. Over a lobe that the oil lifts pressure rises
    all the way into the groove behind it.
    """
    for part in parts if stroke == "out" else reversed(parts):
        if not _lifted(at, part, stroke):
            return part
    return parts[0 if stroke == "out" else -1]


def _lifted(at: Mapping[str, Array], part: slice, stroke: Stroke) -> bool:
    """True if pressure rises all the way through a part of the film, where the oil goes."""
    last: int = part.stop - 1 if stroke == "out" else part.start
    return _top(at, part) == last


def _top(at: Mapping[str, Array], part: slice) -> int:
    """The segment of the largest pressure of a part of the film."""
    return int(part.start + np.argmax(at["p"][part].max(axis=1)))


def _contacts(
    at: Mapping[str, Array],
    nodes: tuple[Array, Array],
    parts: Sequence[slice],
    film: FilmLoads,
    level: float,
) -> tuple[ContactNumbers, ...]:
    """Each contact of a film that has several; nodes: z and h at them, level: of `contact_film`."""
    flux, numbers = element_means(at["flux"], at["dx"]), []
    for part in parts:
        z, h = (values[_nodes(part)] for values in nodes)
        start, end = interval_below(z, h, level)
        numbers.append(
            ContactNumbers(
                flux=float(flux[_top(at, part)]),
                p_max=float(at["p"][part].max()),
                h_min=float(h.min()),
                start=start,
                end=end,
                p_before=float(at["p"][part.start, 0]),
                inlet_ratio=filled_ratio({name: v[part] for name, v in at.items()}, film),
                lifted=_lifted(at, part, film.stroke),
            )
        )
    return tuple(numbers)


def filled_ratio(at: Mapping[str, Array], film: FilmLoads) -> float:
    """`inlet_ratio` of a contact by its own flux; nan where the film ruptures within its inlet.

    at: fields of its part of the film, (segments, points) each. nan too where they do not say
    whether oil is missing, and over a lobe that is lifted.
    """
    segments = slice(0, len(at["p"]))
    void = at.get("v_out" if film.stroke == "out" else "v_in")
    if void is None or _lifted(at, segments, film.stroke):
        return nan
    top = _top(at, segments)
    h_star = float(element_means(at["flux"], at["dx"])[top] / (0.5 * film.rod_speed))
    upstream = slice(None, top + 1) if film.stroke == "out" else slice(top, None)
    torn = at["h"][upstream][void[upstream] > _TORN]
    if len(torn) and float(torn.min()) < INLET[0] * h_star:
        return nan
    return inlet_ratio(at, film, h_star)


def rough_numbers(system: SealSystem, at: Mapping[str, Array]) -> dict[str, float]:
    """Share of asperities in load and friction, and the mean gap: see FilmNumbers.

    at: fields of the film. Nothing is known between smooth surfaces.
    """
    sigma = system.parameters.surfaces.sigma
    if not sigma:
        return {}
    dx, gap = at["dx"], float(at["h_T"].min())
    load, drag = ((at[name] * dx).sum() for name in ("p", "tau_rod"))
    asperities, boundary = ((at[name] * dx).sum() for name in ("p_a", "tau_a"))
    return {
        "mean_gap": gap,
        "lambda_ratio": gap / sigma,
        "asperity_load": float(asperities / (load + asperities)),
        "boundary_friction": float(boundary / drag),
    }


def film_state(
    system: SealSystem,
    problem: Problem,
    film: FilmLoads,
    x: Array,
    verdict: Verdict,
    iterations: int,
) -> FilmState:
    """The record of a converged film whose numbers are the last of `verdict`."""
    assert verdict.last is not None
    numbers, (z, h) = verdict.last, system.arc_film(x)
    limits = interval_below(z, h, contact_level(h))
    return FilmState(
        sealed_pressure_MPa=film.sealed_pressure,
        rod_speed_mm_s=film.rod_speed,
        h_star_um=numbers.h_star / MICROMETRE,
        density=int(system.section.density),
        h_min_um=numbers.h_min / MICROMETRE,
        p_max_MPa=numbers.p_max,
        pressure_jump_max_MPa=numbers.jump,
        rod_friction_N=numbers.friction,
        leak_rate_mm3_s=system.around * numbers.flux,
        contact_start_mm=limits[0],
        contact_end_mm=limits[1],
        newton_iterations=iterations,
        flux_variation=numbers.flux_variation,
        moment_N_mm=system.moment(x),
        contact_p_max_MPa=verdict.reference,
        oscillation_index=numbers.oscillation,
        inlet_segments=numbers.inlet_segments,
        inlet_ratio=numbers.inlet_ratio,
        mean_gap_um=numbers.mean_gap / MICROMETRE,
        lambda_ratio=numbers.lambda_ratio,
        regime=regime(numbers.lambda_ratio) if system.parameters.rough else "",
        asperity_load_percent=100.0 * numbers.asperity_load,
        boundary_friction_percent=100.0 * numbers.boundary_friction,
        flux_mismatch_percent=numbers.mismatch if numbers.fluxes or numbers.contacts else nan,
        **_groove(numbers),
        entrance_pressure_MPa=film.entrance,
        verdict=verdict.word,
        advice=verdict.advice,
        **_heat(numbers),
        profile=_profile(system, problem, x, numbers.heat),
        section=section_view(system, x, film_pressure(system, x)),
    )


def _groove(numbers: FilmNumbers) -> dict[str, Any]:
    """Columns of the groove between two contacts; none of one contact."""
    if not numbers.contacts:
        return {}
    sealed, air = numbers.contacts[0], numbers.contacts[-1]
    return {
        "groove_start_mm": sealed.end,
        "groove_end_mm": air.start,
        "groove_pressure_MPa": air.p_before,
        "h_min_sealed_um": sealed.h_min / MICROMETRE,
        "h_min_air_um": air.h_min / MICROMETRE,
    }


def _heat(numbers: FilmNumbers) -> dict[str, Any]:
    """Columns of the heat of a film; none without heating."""
    heat = numbers.heat
    if heat is None:
        return {}
    return {
        "inlet_heating_K": heat.inlet,
        "film_heating_K": heat.peak,
        "heat_to_rod_W": heat.to_rod,
        "heat_to_seal_W": heat.to_seal,
        "heat_in_oil_W": heat.carried,
    }


def _profile(system: SealSystem, problem: Problem, x: Array, heat: FilmHeat | None) -> Profile:
    """Fields at the quadrature points of the film, from the sealed to the air side.

    Discontinuous pressures are also shown at both ends of each segment: a facet has two rows.
    """
    block, p = problem.assembler.block(FILM), system.parameters
    if p.reynolds == "dg":
        traces = trace_rule(p.pressure_order, p.quadrature, p.quadrature_points)
        block = replace(block, rule=traces)
    values = block.fields(x, problem.parameters[FILM])
    if heat is not None:
        values = heat.warmed(values)
    at = {name: value.ravel() for name, value in values.items()}
    return Profile(
        x_mm=at["x"],
        h_um=at["h"] / MICROMETRE,
        p_MPa=at["p"],
        tau_MPa=at["tau"],
        flux_mm2_s=at["flux"],
        tau_rod_MPa=at["tau_rod"],
    )
