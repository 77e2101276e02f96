"""What a converged O-ring state means: h*, pressure, friction, leakage, limits, verdict."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi

import numpy as np
from numpy.typing import NDArray

from cases.observer import COLLAPSED, OK, ContactState, FilmState, Profile, Section
from cases.oring_path import Film
from cases.oring_section import OringSection
from runtime.contact import tributary_areas
from runtime.postprocess import (
    element_means,
    interval_below,
    local_exponent,
    nodal_average,
    relative_spread,
    run_around,
)
from runtime.problem import Problem

Array = NDArray[np.float64]

CONTACT_FILM = 0.02
"""Film thickness that counts as contact, mm."""

MICROMETRE = 1e-3  # mm

EXCESS_PRESSURE = 0.1
"""Largest credible excess of the film's maximum pressure over the contact's, relative."""

LARGEST_EXPONENT = 0.85
"""Largest credible d log h* / d log U: theory and fine meshes give 0.55 to 0.65."""

FINER_MESH = "the film collapsed on this mesh; use a finer mesh (larger density)"


@dataclass(frozen=True)
class FilmNumbers:
    """Scalars of a film: mm, MPa, N, s; flux per circumference in mm^2/s, signed like U."""

    speed: float
    flux: float
    h_star: float
    h_min: float
    p_max: float
    friction: float
    flux_variation: float


def film_numbers(section: OringSection, problem: Problem, film: Film, x: Array) -> FilmNumbers:
    """Scalars of a converged film with the unknowns x.

    The flux is the mean over the element of the largest pressure; its relative spread is taken
    over the neighbours on both sides up to where the film cavitates, eqs. (16) and (25).
    """
    at = problem.fields("film", x)
    flux = element_means(at["flux"], at["dx"])
    top = int(np.argmax(at["p"].max(axis=1)))
    whole = run_around(at["p"].min(axis=1) >= 0.0, top)
    h = section.deformed(x)[section.mesh.arc_nodes, 1] - section.rod_radius
    return FilmNumbers(
        speed=film.speed,
        flux=float(flux[top]),
        h_star=float(flux[top] / (0.5 * film.rod_speed)),
        h_min=float(h.min()),
        p_max=float(at["p"].max()),
        friction=float(2.0 * pi * section.rod_radius * (at["tau_rod"] * at["dx"]).sum()),
        flux_variation=relative_spread(flux[whole]),
    )


@dataclass(frozen=True)
class Verdict:
    """Whether the films met so far on a path of falling speed can be believed.

    reference: maximum contact pressure without film, MPa. last: the latest film. collapsed: what
    gave a spurious collapsed film away, if anything did: a pressure well above the contact's, a
    friction that rises while the speed falls, or a thickness that falls too fast. A path that
    has once collapsed does not recover.
    """

    reference: float
    last: FilmNumbers | None = None
    collapsed: str = ""

    def after(self, film: FilmNumbers) -> Verdict:
        """The verdict that includes one more film; `collapsed` says what gave it away."""
        reason = self.collapsed or self._suspicion(film)
        return Verdict(self.reference, film, reason)

    @property
    def word(self) -> str:
        """OK or COLLAPSED."""
        return COLLAPSED if self.collapsed else OK

    @property
    def advice(self) -> str:
        """What to do, empty for OK."""
        return f"{FINER_MESH}: {self.collapsed}" if self.collapsed else ""

    def _suspicion(self, film: FilmNumbers) -> str:
        excess = film.p_max - self.reference
        if excess > EXCESS_PRESSURE * self.reference:
            return f"the maximum pressure is {excess:.2f} MPa above that of frictionless contact"
        if self.last is None or not film.speed < self.last.speed:
            return ""
        if abs(film.friction) > abs(self.last.friction):
            return "the friction on the rod rises while the speed falls"
        if film.h_star <= 0.0 or self._exponent(film) > LARGEST_EXPONENT:
            return "its thickness falls too fast with the speed"
        return ""

    def _exponent(self, film: FilmNumbers) -> float:
        if self.last is None or self.last.h_star <= 0.0:
            return inf
        return local_exponent(self.last.speed, self.last.h_star, film.speed, film.h_star)


def contact_state(
    section: OringSection, problem: Problem, sealed_pressure: float, x: Array
) -> ContactState:
    """The frictionless contact state with the unknowns x."""
    mesh = section.mesh
    deformed = section.deformed(x)
    arc = deformed[mesh.arc_nodes]
    pressure = contact_pressure(section, sealed_pressure, x)
    touching = np.flatnonzero(x[section.layout.part("rod")] < 0.0)
    ends = arc[touching[[0, -1]], 0] if len(touching) else np.full(2, np.nan)
    return ContactState(
        sealed_pressure=sealed_pressure,
        p_max_MPa=float(pressure.max()),
        contact_start_mm=float(ends[0]),
        contact_end_mm=float(ends[1]),
        x_mm=arc[:, 0].copy(),
        p_MPa=pressure,
        section=section_view(section, problem, x),
    )


def contact_pressure(section: OringSection, sealed_pressure: float, x: Array) -> Array:
    """True pressure (arc nodes,): multipliers per current area, plus p_s where it acts, MPa."""
    mesh = section.mesh
    current = tributary_areas(section.deformed(x), mesh.arc_segments, mesh.arc_nodes)
    multipliers = np.minimum(x[section.layout.part("rod")], 0.0)
    pressure = -multipliers * section.rod_areas / current
    pressure[: section.lowest] += sealed_pressure
    pressure[section.lowest] += 0.5 * sealed_pressure  # the pressure ends at this node
    return np.asarray(pressure)


def film_state(
    section: OringSection,
    problem: Problem,
    film: Film,
    x: Array,
    verdict: Verdict,
    iterations: int,
) -> FilmState:
    """The record of a converged film whose numbers are the last of `verdict`."""
    numbers = verdict.last or film_numbers(section, problem, film, x)
    arc = section.deformed(x)[section.mesh.arc_nodes]
    limits = interval_below(arc[:, 0], arc[:, 1] - section.rod_radius, CONTACT_FILM)
    return FilmState(
        sealed_pressure=film.sealed_pressure,
        rod_speed=film.rod_speed,
        h_star_um=numbers.h_star / MICROMETRE,
        h_min_um=numbers.h_min / MICROMETRE,
        p_max_MPa=numbers.p_max,
        pressure_jump_max_MPa=0.0,
        rod_friction_N=numbers.friction,
        leak_rate_mm3_s=2.0 * pi * section.rod_radius * numbers.flux,
        contact_start_mm=limits[0],
        contact_end_mm=limits[1],
        newton_iterations=iterations,
        flux_variation=numbers.flux_variation,
        moment_N_mm=float(x[section.layout.part("rotation")][0]),
        contact_p_max_MPa=verdict.reference,
        verdict=verdict.word,
        advice=verdict.advice,
        profile=_profile(problem, x),
        section=section_view(section, problem, x),
    )


def section_view(section: OringSection, problem: Problem, x: Array) -> Section:
    """The deformed section with nodal Cauchy stresses (MPa) and displacements (mm)."""
    mesh = section.mesh
    stresses = problem.fields("solid", x)
    nodal = nodal_average(
        mesh.quads,
        {name: value for name, value in stresses.items() if name not in ("z", "r")},
        len(mesh.points),
    )
    displacement = x[section.layout.part("displacement")].reshape(-1, 2).copy()
    return Section(
        points=section.deformed(x),
        cells=mesh.quads,
        point_data={"displacement": displacement, **nodal},
    )


def _profile(problem: Problem, x: Array) -> Profile:
    """Fields at the quadrature points of the film, from the sealed to the air side."""
    at = {name: value.ravel() for name, value in problem.fields("film", x).items()}
    return Profile(
        x_mm=at["x"],
        h_um=at["h"] / MICROMETRE,
        p_MPa=at["p"],
        tau_MPa=at["tau"],
        flux_mm2_s=at["flux"],
    )
