"""The state of a film: its record, its errors, how far it is to be trusted."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import nan

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.solve.adaptation import Adapted
from softehl.cases.seal.solve.films import Film
from softehl.cases.seal.states.contact_results import (
    contact_peaks,
    contact_pressure,
    overlap,
    unsealed,
)
from softehl.cases.seal.states.estimate import estimated_error, reservation
from softehl.cases.seal.states.results import film_state
from softehl.cases.seal.states.sensitivity_table import resolved
from softehl.cases.seal.states.state import FilmState
from softehl.cases.seal.states.verdict import (
    ANY_RATIO,
    INLET_RATIO,
    FilmNumbers,
    Verdict,
    fewest_inlet_segments,
)
from softehl.runtime.arrays import Array

UNFIT = "no mesh was found that shows the film; use a finer mesh (larger density)"
"""Reservation against a film whose mesh does not fit it."""

Slopes = Mapping[str, Mapping[str, float]]
Differentiate = Callable[[Film], Slopes | None]
"""Sensitivities of a film, None where it has none."""


def verdict_of_contact(system: SealSystem, x: Array) -> Verdict:
    """Verdict on the contact state x (n,), before its films."""
    p = system.parameters
    return Verdict(
        float(contact_pressure(system, p.sealed_pressure, x).max()),
        fewest=fewest_inlet_segments(p.reynolds, p.pressure_order, p.lobes),
        ratios=ANY_RATIO if p.mesh == "uniform" else INLET_RATIO,
        rough=p.rough,
        unsealed=unsealed(system, x),
        references=contact_peaks(system, p.sealed_pressure, x),
        overlap=overlap(system, x),
    )


@dataclass(frozen=True)
class Judge:
    """Makes states of films.

    contact: verdict on their dry contact. It is that of its own mesh: on the mesh of a film the
    sealed pressure may end at a node beside the contact, which no film depends on. differentiate:
    makes sensitivities, None where none are asked.
    """

    contact: Verdict
    differentiate: Differentiate | None = None

    def state(self, adapted: Adapted, faster: FilmNumbers | None) -> FilmState:
        """The state of a film; faster: of the same stroke at the next higher speed, if there is."""
        film, other, p = adapted.film, adapted.other, adapted.film.system.parameters
        numbers = film.numbers
        error, friction = errors(p.density, numbers, other)
        wanted = p.error_estimate and p.mesh == "graded"
        verdict = replace(self.contact, last=faster).after(numbers)
        verdict = replace(verdict, error=error if wanted else None)
        state = film_state(film.system, film.problem, film.loads, film.x, verdict, film.iterations)
        state = replace(
            state,
            h_star_error_percent=error,
            rod_friction_error_percent=friction,
            reservation=reservation(p, numbers, other) if adapted.fits else UNFIT,
        )
        if self.differentiate and resolved(state.settled) and not film.loads.entrance:
            state = replace(state, sensitivity=self.differentiate(film))
        return state.settled


def errors(density: int, film: FilmNumbers, other: FilmNumbers | None) -> tuple[float, float]:
    """Estimated errors of h* and of friction, %, from the film of the coarser mesh."""
    if other is None:
        return nan, nan
    return (
        estimated_error(density, film.h_star, other.h_star),
        estimated_error(density, film.friction, other.friction),
    )
