"""States of which no film is computed: h* by the theory of the inlet over the dry contact."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan
from typing import Any

import numpy as np

from softehl.cases.seal.equations.loads import Stroke
from softehl.cases.seal.equations.system import SealSystem
from softehl.cases.seal.gland.messages import HARDEST
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.surfaces import MICROMETRE, regime
from softehl.cases.seal.states.contacts import contact_pressure, contacts
from softehl.cases.seal.states.inlet_edges import APPLIES, Predictions, predicted
from softehl.cases.seal.states.run_plan import SIGNS
from softehl.cases.seal.states.section_view import section_view
from softehl.cases.seal.states.state import ESTIMATED, FilmState, Profile
from softehl.runtime.arrays import Array

ERRORS: dict[Stroke, float] = {"out": 3.0, "in": 5.0}
"""Error of an estimated h*, %: the theory was within 2 % of outstrokes at p_s / mu of 5.4 to 8
after MESH_ERROR, within 5 % of instrokes to which it applies."""

GROOVE = 3.0
"""Error, %, that several contacts add: the pressure of the groove between them is not known, and
from none to p_s it changed h* of two X-rings by 0.1 to 2.3 %."""

ORDER = 100.0
"""Error of h*, %, of instrokes above FILMS and where the theory does not apply: the order of
magnitude is right. At p_s / mu of 5.4 to 6.5 it was between -25 and +11 % off."""

MESH_ERROR = 0.02
"""Part of h* that the theory lacks at density 2, as K^2 is too large there; of second order."""

FILMS: dict[Stroke, float] = {"out": HARDEST, "in": 5.0}
"""Largest p_s / mu at which films are computed. At 5.4 an instroke was 9 % off with an estimate of
0.1 %; outstrokes at 6.5 and 7 agree with the theory."""

CONTACT = 4.0
"""p_s / mu of the dry contact of states above FILMS. From 3.8 to 11.4 K^2 of the sealed edge falls
by 1.3 %, h* rises by 0.5 %: the oil presses the section into its corner, and more of it changes
the pressure there by the same amount everywhere."""

POCKET = 0.64
"""The pocket of an instroke shrinks as exp(-0.64 p_s/mu), measured from 3.8 to 8.7, and K^2 grows
as its inverse."""


def contact_of(p: Seal) -> Seal:
    """The case whose dry contact serves: under less pressure if that is above all films."""
    ratio = p.load_ratio(p.sealed_pressure)
    if not p.estimable or ratio <= max(FILMS.values()):
        return p
    pressure = float(f"{CONTACT * p.sealed_pressure / ratio:.3g}")
    return p.model_copy(update={"sealed_pressure": pressure})


def computed(p: Seal, stroke: Stroke) -> bool:
    """True if films of a stroke are computed at the pressure of a case."""
    return not p.estimable or p.load_ratio(p.sealed_pressure) <= FILMS[stroke]


@dataclass(frozen=True)
class Estimated:
    """h* of a stroke by the theory, with its error.

    Attributes
    ----------
    h_star : float
        Film thickness h*, mm.
    over_pocket : float
        Length of the inlet over its pocket.
    error : float
        Largest error, %. Of several contacts at least what the least of them lets pass.
    inlet_rise : float
        Rise of the temperature in the inlet, K; 0 without heating.
    theory : Predictions
        What the theory says of each contact.
    """

    h_star: float
    over_pocket: float
    error: float
    inlet_rise: float
    theory: Predictions

    @classmethod
    def of(
        cls, p: Seal, system: SealSystem, x: Array, stroke: Stroke, speed: float
    ) -> Estimated | None:
        """The estimate of a case p over a dry contact x (n,); None where there is no theory.

        The contact may be that of `contact_of`: for the pressure that it lacks the pocket of an
        instroke shrinks by its law.
        """
        estimate = predicted(system, x, stroke, speed, p.sealed_pressure)
        if estimate is None:
            return None
        h_star, over_pocket = estimate.h_star, estimate.over_pocket
        lacking = p.load_ratio(p.sealed_pressure - system.parameters.sealed_pressure)
        if stroke == "in":
            h_star *= np.exp(-0.4 * POCKET * lacking)
            over_pocket *= np.exp(0.4 * POCKET * lacking)
        h_star *= 1.0 + MESH_ERROR * (2.0 / float(system.section.density)) ** 2
        is_computed = over_pocket <= APPLIES and (stroke == "out" or computed(p, stroke))
        known = is_computed and (p.round or estimate.first.applies)  # nor too curved an edge
        error = ERRORS[stroke] + GROOVE * (len(estimate.contacts) > 1)
        error = max(error, 100.0 * (1.0 - estimate.passing)) if known else ORDER
        rise = estimate.first.inlet_rise
        return cls(float(h_star), float(over_pocket), error, rise, estimate)


def estimated_state(
    p: Seal, system: SealSystem, x: Array, stroke: Stroke, speed: float
) -> FilmState | None:
    """The state of a case p by the theory, over a dry contact x (n,); None without a theory."""
    estimate = Estimated.of(p, system, x, stroke, speed)
    if estimate is None:
        return None
    lacking = p.sealed_pressure - system.parameters.sealed_pressure
    pressure = contact_pressure(system, system.parameters.sealed_pressure, x)
    pressure = np.where(pressure > 0.0, pressure + lacking, 0.0)
    rod_speed = SIGNS[stroke] * speed
    touching = contacts(system, x)
    z, gap = system.arc_film(x)
    flux = 0.5 * rod_speed * estimate.h_star
    sigma, unknown = p.surfaces.sigma, np.full(len(z), nan)
    ratio = estimate.h_star / sigma if sigma else nan
    return FilmState(
        sealed_pressure_MPa=p.sealed_pressure,
        rod_speed_mm_s=rod_speed,
        h_star_um=estimate.h_star / MICROMETRE,
        h_star_error_percent=estimate.error,
        h_star_theory_um=estimate.h_star / MICROMETRE,
        inlet_over_pocket=estimate.over_pocket,
        **theory_by_contact(estimate.theory),
        groove_start_mm=float(z[touching[0][-1]]) if len(touching) > 1 else nan,
        groove_end_mm=float(z[touching[-1][0]]) if len(touching) > 1 else nan,
        inlet_heating_K=estimate.inlet_rise if p.heating else nan,
        h_min_um=nan,
        p_max_MPa=float(pressure.max()),
        pressure_jump_max_MPa=0.0,
        rod_friction_N=nan,
        leak_rate_mm3_s=system.around * flux,
        contact_start_mm=float(z[touching[0][0]]),
        contact_end_mm=float(z[touching[-1][-1]]),
        newton_iterations=0,
        flux_variation=nan,
        moment_N_mm=system.moment(x),
        contact_p_max_MPa=float(pressure.max()),
        oscillation_index=nan,
        inlet_segments=nan,
        lambda_ratio=ratio,
        regime=regime(ratio) if sigma else "",
        density=int(system.section.density),
        verdict=ESTIMATED,
        advice=_advice(p, system, pressure, estimate),
        profile=Profile(
            x_mm=z,
            h_um=(gap - gap.min() + estimate.h_star) / MICROMETRE,
            p_MPa=pressure,
            tau_MPa=unknown,
            flux_mm2_s=np.full(len(z), flux),
            tau_rod_MPa=unknown,
        ),
        section=section_view(system, x, pressure),
    )


def theory_by_contact(theory: Predictions | None) -> dict[str, Any]:
    """Columns of the theory of each of several contacts; none of one."""
    if theory is None or len(theory.contacts) < 2:
        return {}
    sealed, air = theory.from_sealed_side[0], theory.from_sealed_side[-1]
    return {
        "h_star_theory_sealed_um": sealed.h_star / MICROMETRE,
        "h_star_theory_air_um": air.h_star / MICROMETRE,
    }


def _advice(p: Seal, system: SealSystem, pressure: Array, estimate: Estimated) -> str:
    """Words on an estimated state."""
    what = f"h* by the theory of the inlet, known to {estimate.error:.2g} %"
    if estimate.error >= ORDER:
        what = (
            "h* has the order of magnitude of a smooth film from a pocket of oil that is nearly "
            "closed: take it as boundary lubrication"
        )
    friction = "friction is not known"
    if p.rough and p.boundary_friction:
        load = float((pressure * system.rod_areas).sum())
        bound = p.boundary_friction * load
        friction = f"friction is not known, asperities add at most {bound:.3g} N"
    return f"no film was computed, {what}; {friction}"
