"""What a converged state of a seal means: h*, pressure, friction, leakage, limits, resolution."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from math import inf, nan, pi, radians, tan

import numpy as np

from softehl.cases.seal.catalogue import fill, squeeze, stretch
from softehl.cases.seal.contacts import CONTACT_FILM, contacts, groups
from softehl.cases.seal.equations import SealSystem
from softehl.cases.seal.loads import FilmLoads
from softehl.cases.seal.parameters import ORing
from softehl.cases.seal.section_view import film_pressure, section_view
from softehl.cases.seal.state import ContactState, FilmState, Profile
from softehl.cases.seal.surfaces import regime
from softehl.cases.seal.system import (
    AIR_WALL,
    BORE,
    FACET,
    FILM,
    ROD,
    SEALED_WALL,
    WALLS,
)
from softehl.cases.seal.verdict import ContactNumbers, FilmNumbers, Verdict
from softehl.runtime.arrays import Array
from softehl.runtime.fem.contact import tributary_areas
from softehl.runtime.fem.postprocess import (
    alternating_difference,
    element_means,
    first_below,
    interval_below,
    relative_spread,
    run_around,
)
from softehl.runtime.fem.problem import Problem
from softehl.runtime.fem.rules import trace_rule

MICROMETRE = 1e-3  # mm

EXIT_SLOPE = 40.0
"""Slope beyond which a film has ended, degrees: the corner of a flat, the heel of a cup."""

INLET = (10.0, 1.5)
"""Film thicknesses, in h*, between which the segments of the inlet are counted."""

_TORN = 1e-6  # void fraction of a film that has ruptured

MID_CONTACT = 0.1
"""Share of the contact that is left out at either end where oscillations are looked for."""


def film_numbers(system: SealSystem, problem: Problem, film: FilmLoads, x: Array) -> FilmNumbers:
    """Scalars of a converged film with the unknowns x.

    The flux is that at the largest pressure, of several contacts in that which the oil reaches
    first: the mean over the segment for continuous, the mean
    of (23) at the facets of the segment for discontinuous pressures, which (21) and (22) make
    constant. Its relative spread is taken over the neighbours on both sides up to where the film
    cavitates, eqs. (16) and (25).
    """
    at = problem.fields(FILM, x)
    z, h = system.arc_film(x)
    parts = film_parts(h)
    first = parts[0 if film.stroke == "out" else -1]
    peaks = [_top(at, part) for part in parts]
    top = peaks[0 if film.stroke == "out" else -1]
    inlet = {name: values[first] for name, values in at.items()}
    whole = run_around(at["p"].min(axis=1) >= 0.0, top)
    jump = 0.0
    if system.parameters.reynolds == "dg":
        facets = problem.fields(FACET, x)
        flux, jump = facets["flux"][:, 0], float(np.abs(facets["jump"]).max())
        around, whole = slice(max(top - 1, 0), top + 1), slice(max(whole.start - 1, 0), whole.stop)
    else:
        flux, around = element_means(at["flux"], at["dx"]), slice(top, top + 1)
    q = float(flux[around].mean())
    h_star = q / (0.5 * film.rod_speed)
    drag, friction = (
        float(2.0 * pi * system.rod_radius * (tau * at["dx"]).sum())
        for tau in (0.5 * (at["tau_rod"] + at["tau"]), at["tau_rod"])
    )
    return FilmNumbers(
        speed=film.speed,
        flux=q,
        h_star=h_star,
        h_min=float(h.min()),
        p_max=float(at["p"].max()),
        friction=friction,
        flux_variation=relative_spread(flux[whole]),
        jump=jump,
        oscillation=max(oscillation(*(v[_nodes(k)] for v in (z, h))) for k in parts),
        inlet_segments=inlet_segments(h if film.stroke == "out" else h[::-1], h_star),
        inlet_ratio=1.0 if system.parameters.rough else inlet_ratio(inlet, film, h_star),
        end_gap=end_gap(*((z, h) if film.stroke == "out" else (-z[::-1], h[::-1]))),
        lacking=0.0 if system.parameters.rough else lacking(inlet, film, z, h),
        **rough_numbers(system, at),
        contacts=_contacts(at, (z, h), parts, film) if len(parts) > 1 else (),
        drag=drag,
    )


def end_gap(z: Array, h: Array) -> float:
    """Film thickness at the exit of the arc, mm; inf where the surface is too steep for a film.

    z, h: (nodes,) towards the exit.
    """
    steep = h[-1] - h[-2] > tan(radians(EXIT_SLOPE)) * (z[-1] - z[-2])  # also straight up
    return inf if steep else float(h[-1])


def film_parts(h: Array) -> list[slice]:
    """The segments of each contact, from the sealed side on; together they are the whole film.

    h: (nodes,). Contacts are parted where the film between them is thickest.
    """
    found = groups(h, h < CONTACT_FILM)
    between = [(a[-1], b[0]) for a, b in pairwise(found)]
    cuts = [0, *(int(a + np.argmax(h[a : b + 1])) for a, b in between), len(h) - 1]
    return [slice(a, b) for a, b in pairwise(cuts)]


def _nodes(part: slice) -> slice:
    return slice(part.start, part.stop + 1)


def _top(at: Mapping[str, Array], part: slice) -> int:
    """The segment of the largest pressure of a part of the film."""
    return int(part.start + np.argmax(at["p"][part].max(axis=1)))


def _contacts(
    at: Mapping[str, Array], nodes: tuple[Array, Array], parts: Sequence[slice], film: FilmLoads
) -> tuple[ContactNumbers, ...]:
    """Each contact of a film that has several; nodes: z and h at them."""
    flux, found = element_means(at["flux"], at["dx"]), []
    for part in parts:
        z, h = (values[_nodes(part)] for values in nodes)
        start, end = interval_below(z, h, CONTACT_FILM)
        found.append(
            ContactNumbers(
                flux=float(flux[_top(at, part)]),
                p_max=float(at["p"][part].max()),
                h_min=float(h.min()),
                start=start,
                end=end,
                p_before=float(at["p"][part.start, 0]),
                inlet_ratio=filled_ratio({name: v[part] for name, v in at.items()}, film),
            )
        )
    return tuple(found)


def filled_ratio(at: Mapping[str, Array], film: FilmLoads) -> float:
    """`inlet_ratio` of a contact by its own flux; nan where the film ruptures within its inlet.

    at: fields of its part of the film, (segments, points) each. nan too where they do not say
    whether oil is missing.
    """
    void = at.get("v_out" if film.stroke == "out" else "v_in")
    if void is None:
        return nan
    top = int(np.argmax(at["p"].max(axis=1)))
    h_star = float(element_means(at["flux"], at["dx"])[top] / (0.5 * film.rod_speed))
    before = slice(None, top + 1) if film.stroke == "out" else slice(top, None)
    torn = at["h"][before][void[before] > _TORN]
    if len(torn) and float(torn.min()) < INLET[0] * h_star:
        return nan
    return inlet_ratio(at, film, h_star)


def rough_numbers(system: SealSystem, at: Mapping[str, Array]) -> dict[str, float]:
    """What asperities carry of load and friction, and how far they are apart: see FilmNumbers.

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


def lacking(at: Mapping[str, Array], film: FilmLoads, z: Array, h: Array) -> float:
    """Pressure that a film builds up before the arc begins, relative to that of its inlet.

    at: fields of the film; z, h: (nodes,) its nodes. Beyond its end the gap goes on as a wedge, in
    which (14) gives 6 eta U / (slope h) at most; the pressure of an inlet is that at its steepest
    rise, in excess of the pressure outside.
    """
    first, second = (0, 1) if film.stroke == "out" else (-1, -2)
    rise, width = h[first] - h[second], abs(z[first] - z[second])
    steepest = _steepest(at, film)
    if steepest is None or not rise > 0.0:
        return np.inf
    outside, eta = (at[name].ravel()[0 if film.stroke == "out" else -1] for name in ("p", "eta"))
    inlet = float(at["p"].ravel()[steepest] - outside)
    if not inlet > 0.0:
        return np.inf
    return float(6.0 * eta * film.speed * width / (rise * h[first]) / inlet)


def _steepest(at: Mapping[str, Array], film: FilmLoads) -> int | None:
    """Where in the inlet the pressure rises most steeply, None if it does not rise."""
    x, p, slope = at["x"].ravel(), at["p"].ravel(), _slope(at).ravel()
    top = x[np.argmax(p)]
    inlet = x < top if film.rod_speed > 0.0 else x > top
    rise = np.where(inlet, np.copysign(1.0, film.rod_speed) * slope, -np.inf)
    steepest = int(np.argmax(rise))
    return steepest if rise[steepest] > 0.0 else None


def _slope(at: Mapping[str, Array]) -> Array:
    """p' at the points, MPa/mm; of an oil that thins that of a Newtonian one of the same flux."""
    return at["driving"] if "driving" in at else (at["tau_rod"] - at["tau"]) / at["h"]


def inlet_ratio(at: Mapping[str, Array], film: FilmLoads, h_star: float) -> float:
    """h* over sqrt(8 eta |U| / (9 p')), p' the steepest rise of the pressure in the inlet.

    at: fields of the film, (segments, points) each. By (14) p' = 6 eta U (h - h*) / h^3, which is
    largest at h = 3/2 h*: the ratio is 1 for a film that fulfils (14), on a mesh that shows it.
    """
    steepest = _steepest(at, film)
    if steepest is None:
        return np.nan
    eta = at["eta"].ravel()[steepest]
    rise = abs(_slope(at).ravel()[steepest])
    return float(h_star / np.sqrt(8.0 * eta * film.speed / (9.0 * rise)))


def oscillation(x: Array, h: Array) -> float:
    """Oscillation index of the nodal film thickness h (nodes,) at x (nodes,), dimensionless.

    The largest alternating second difference over the mid contact relative to the median of h
    there: D_i = h_(i-1) - 2 h_i + h_(i+1), and a pair of neighbours of opposite sign counts with
    the smaller of |D_i|, |D_(i+1)|. A zigzag of amplitude a about h has the index 4 a / h, a
    smooth film next to none. The mid contact is the middle four fifths of where h < 20 um.
    """
    start, end = interval_below(x, h, CONTACT_FILM)
    margin = MID_CONTACT * (end - start)
    inside = h[(x >= start + margin) & (x <= end - margin)]
    return alternating_difference(inside) / float(np.median(inside)) if len(inside) else 0.0


def inlet_segments(h: Array, h_star: float) -> float:
    """Length of the inlet in segments; h (nodes,) from the inlet on.

    From where h, coming from outside, first falls below ten times h* to where it first falls below
    one and a half times h*: there the pressure rises that makes the film.
    """
    outer, inner = (first_below(h, level * h_star) for level in INLET)
    return inner - outer


def contact_state(
    system: SealSystem, problem: Problem, sealed_pressure: float, x: Array
) -> ContactState:
    """The frictionless contact state with the unknowns x."""
    mesh = system.mesh
    deformed = system.deformed(x)
    arc = deformed[mesh.arc_nodes]
    pressure = contact_pressure(system, sealed_pressure, x)
    touching = np.flatnonzero(system.rod_multipliers(x) < 0.0)
    ends = arc[touching[[0, -1]], 0] if len(touching) else np.full(2, np.nan)
    return ContactState(
        sealed_pressure=sealed_pressure,
        p_max_MPa=float(pressure.max()),
        contact_start_mm=float(ends[0]),
        contact_end_mm=float(ends[1]),
        x_mm=arc[:, 0].copy(),
        p_MPa=pressure,
        section=section_view(system, problem, x, pressure),
    )


def contact_pressure(system: SealSystem, sealed_pressure: float, x: Array) -> Array:
    """True pressure (arc nodes,): multipliers per current area, plus p_s where it acts, MPa."""
    mesh = system.mesh
    current = tributary_areas(system.deformed(x), mesh.arc_segments, mesh.arc_nodes)
    multipliers = np.minimum(system.rod_multipliers(x), 0.0)
    pressure = -multipliers * system.rod_areas / current
    pressure[: system.dam] += sealed_pressure
    pressure[system.dam] += 0.5 * sealed_pressure  # the pressure ends at this node
    return np.asarray(pressure)


def unsealed(system: SealSystem, x: Array) -> str:
    """Where the sealed pressure ends outside the contact of the state x; empty if nowhere."""
    if system.parameters.sealed_pressure == 0.0:
        return ""
    if not system.pressing(ROD, x)[system.dam] > 0.0:
        return "at the lowest point of the section"
    crown = system.section.chains[WALLS[BORE]][0] == system.section.pressed_ends[1]
    return "" if (system.pressing(BORE, x)[crown] > 0.0).all() else "at its crown"


def contact_peaks(system: SealSystem, sealed_pressure: float, x: Array) -> tuple[float, ...]:
    """The largest pressure of each contact of the state x, from the sealed side on, MPa."""
    pressure = contact_pressure(system, sealed_pressure, x)
    return tuple(float(pressure[nodes].max()) for nodes in contacts(system, x))


def fit_percent(p: ORing) -> dict[str, float]:
    """How the free ring fits its gland."""
    depth = 0.5 * (p.housing_diameter - p.rod_diameter)
    return {
        "stretch_percent": stretch(p.inner_diameter, p.rod_diameter),
        "squeeze_percent": squeeze(p.section_diameter, depth),
        "fill_percent": fill(p.free_ring, p.rod_diameter, p.housing_diameter, p.groove_width),
    }


def contact_numbers(system: SealSystem, x: Array) -> dict[str, float]:
    """Fit of the ring in its gland; axial forces on it in the contact state x, + to the air side.

    The sealed pressure acts on what lies between its two ends; forces of the walls are in excess of
    it. Their sum with that of the hold is zero in equilibrium.
    """
    p, section = system.parameters, system.section
    bottom, crown = system.deformed(x)[list(section.pressed_ends), 1]
    forces = {
        "air_wall_N": -system.reaction(AIR_WALL, x),
        "sealed_wall_N": system.reaction(SEALED_WALL, x),
        "hold_N": system.axial_force(x),
        "housing_friction_N": system.housing_friction(x),
        "sealed_pressure_N": p.sealed_pressure * pi * float(crown**2 - bottom**2),
    }
    return {
        **fit_percent(p),
        **forces,
        "axial_sum_N": sum(forces.values()),
        **mean_motion(system, x),
    }


def mean_motion(system: SealSystem, x: Array) -> dict[str, float]:
    """Mean rotation of the section, from z towards r, and mean axial displacement."""
    residuals = {}
    for name in ("rotation", "hold"):
        block, given = system.problem.assembler.block(name), system.problem.parameters[name]
        residuals[name] = float(block.residual(x, given)[:, -1].sum())
    return {
        "mean_rotation_degrees": float(np.degrees(residuals["rotation"])),
        "mean_place_mm": residuals["hold"],
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
    numbers = verdict.last or film_numbers(system, problem, film, x)
    limits = interval_below(*system.arc_film(x), CONTACT_FILM)
    state = FilmState(
        sealed_pressure_MPa=film.sealed_pressure,
        rod_speed_mm_s=film.rod_speed,
        h_star_um=numbers.h_star / MICROMETRE,
        density=system.parameters.density,
        h_min_um=numbers.h_min / MICROMETRE,
        p_max_MPa=numbers.p_max,
        pressure_jump_max_MPa=numbers.jump,
        rod_friction_N=numbers.friction,
        leak_rate_mm3_s=2.0 * pi * system.rod_radius * numbers.flux,
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
        verdict=verdict.word,
        advice=verdict.advice,
        profile=_profile(system, problem, x),
        section=section_view(system, problem, x, film_pressure(system, x)),
    )
    return _with_groove(state, numbers) if len(numbers.contacts) > 1 else state


def _with_groove(state: FilmState, numbers: FilmNumbers) -> FilmState:
    """The record with what is between two contacts, and how they differ."""
    sealed, air = numbers.contacts[0], numbers.contacts[-1]
    return replace(
        state,
        groove_start_mm=sealed.end,
        groove_end_mm=air.start,
        groove_pressure_MPa=air.p_before,
        h_min_sealed_um=sealed.h_min / MICROMETRE,
        h_min_air_um=air.h_min / MICROMETRE,
        flux_mismatch_percent=numbers.mismatch,
    )


def _profile(system: SealSystem, problem: Problem, x: Array) -> Profile:
    """Fields at the quadrature points of the film, from the sealed to the air side.

    Discontinuous pressures are also shown at both ends of each segment: a facet has two rows.
    """
    block, p = problem.assembler.block(FILM), system.parameters
    if p.reynolds == "dg":
        traces = trace_rule(p.pressure_order, p.quadrature, p.quadrature_points)
        block = replace(block, rule=traces)
    values = block.fields(x, problem.parameters[FILM])
    at = {name: value.ravel() for name, value in values.items()}
    return Profile(
        x_mm=at["x"],
        h_um=at["h"] / MICROMETRE,
        p_MPa=at["p"],
        tau_MPa=at["tau"],
        flux_mm2_s=at["flux"],
    )
