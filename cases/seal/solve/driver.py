"""Driver of a seal: dry contact, then each film on a mesh that is made for it, with its verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import nan
from pathlib import Path

from softehl.cases.harness.observer import Observer, Outcome, StageRecord
from softehl.cases.seal.equations.loads import Stroke
from softehl.cases.seal.equations.system import SealSystem, build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.surfaces import MICROMETRE
from softehl.cases.seal.solve.adaptation import Adaptation, Adapted
from softehl.cases.seal.solve.contact_meshes import ContactMeshes, ContactStore
from softehl.cases.seal.solve.contact_solver import ContactSolver
from softehl.cases.seal.solve.contact_stages import assembly
from softehl.cases.seal.solve.failure_messages import explained, without_films
from softehl.cases.seal.solve.film_solver import Film, FilmSolver, NoFilm
from softehl.cases.seal.solve.load_stages import PathDriver, StageError
from softehl.cases.seal.states.contacts import (
    contact_numbers,
    contact_peaks,
    contact_pressure,
    contact_state,
    overlap,
    unsealed,
)
from softehl.cases.seal.states.estimate import Estimate, reservation
from softehl.cases.seal.states.estimated import (
    computed,
    contact_of,
    estimated_state,
    theory_by_contact,
)
from softehl.cases.seal.states.results import film_state
from softehl.cases.seal.states.run_plan import strokes_of
from softehl.cases.seal.states.sensitivity_table import differentiable
from softehl.cases.seal.states.state import ContactState, FilmState
from softehl.cases.seal.states.state_files import report_contact, report_film
from softehl.cases.seal.states.verdict import (
    FilmNumbers,
    Verdict,
    fewest_inlet_segments,
)
from softehl.runtime.arrays import Array
from softehl.runtime.solve.linear.direct import direct_solver
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Status

COMPARED = 5.0
"""Largest p_s / mu at which the estimate of the error alone makes a state `ok`: above, two meshes
may agree on a wrong film, and the theory of the inlet must agree with them."""

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
        judge_slopes=p.mesh != "uniform",
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
        film, estimate, p = adapted.film, adapted.estimate, adapted.film.system.parameters
        error = estimate.h_star if estimate else nan
        theory, difference = adapted.theory, adapted.off_theory
        reserved = _reservation(p, estimate, difference is not None) if adapted.fits else UNFIT
        verdict = replace(
            replace(self.contact, last=faster).after(film.numbers),
            error=error if p.error_estimate and p.mesh == "graded" else None,
            reservation=reserved,
            theory=difference,
        )
        friction_known = film.numbers.friction_known
        state = replace(
            film_state(
                film.system,
                film.problem,
                film.loads,
                x=film.x,
                verdict=verdict,
                iterations=film.solution.iterations,
            ),
            h_star_error_percent=error,
            rod_friction_error_percent=estimate.friction if estimate and friction_known else nan,
            h_star_theory_um=theory.h_star / MICROMETRE if theory else nan,
            inlet_over_pocket=theory.over_pocket if theory else nan,
            **theory_by_contact(theory),
        )
        if self.differentiate and differentiable(state):
            state = replace(state, sensitivity=self.differentiate(film))
        return state


def _reservation(p: Seal, estimate: Estimate | None, applies: bool) -> str:
    """Why a film with a small estimated error is not `ok`; applies: if the theory was asked."""
    ratio = p.load_ratio(p.sealed_pressure)
    if ratio > COMPARED and not applies:
        return (
            f"sealed pressure / shear modulus = {ratio:.2g} is above {COMPARED:g}, where two "
            "meshes may agree on a wrong film, and the theory of the inlet does not apply; use a "
            "harder rubber or a lower pressure"
        )
    return reservation(p, estimate)


@dataclass(frozen=True, eq=False)
class DryContact:
    """The contact state x (n,) of a case, where its films begin.

    solver: carries it to other meshes.
    """

    system: SealSystem
    x: Array
    solver: ContactSolver

    @classmethod
    def of(cls, p: Seal, observer: Observer, contacts: Path | None = None) -> DryContact:
        """The dry contact of a case; contacts: see `run`.  Raises StageError."""
        driver = PathDriver(observer, Newton(max_iterations=10, linear=direct_solver(p.linear)))
        solver = ContactSolver(driver)
        return cls(*ContactMeshes(solver, ContactStore(contacts)).contact(p), solver)

    @property
    def newton(self) -> Newton:
        """The method that finished it."""
        return self.solver.driver.newton

    @property
    def state(self) -> ContactState:
        """The state that is reported."""
        return contact_state(self.system, self.x)

    @property
    def films(self) -> FilmSolver:
        """Solves for films on its mesh."""
        return FilmSolver(self.system, self.solver.driver)

    def film(self, stroke: Stroke, speed: float) -> Film | NoFilm:
        """The film at |U|, mm/s, on the mesh of the contact."""
        return self.films.from_contact(stroke, speed, self.x)

    def adapted(
        self, stroke: Stroke, speed: float, last: Sequence[Adapted] = ()
    ) -> Adapted | NoFilm:
        """The film at |U|, mm/s, on a mesh that is made for it; last: films of the same stroke."""
        result = None
        if last:
            films = [adapted.film for adapted in last]
            result = self.films.on(films[-1].system).from_neighbour(films, speed)
        if not isinstance(result, Film):
            result = self.film(stroke, speed)
        return Adaptation(self.system.parameters, self.solver, self.films).adapted(result, last)


def run(
    parameters: Seal,
    observer: Observer,
    contacts: Path | None = None,
    differentiate: Differentiate | None = None,
) -> Outcome[FilmState]:
    """Solve a seal and report to the observer; failure is in the outcome's status.

    contacts: folder of contact states (`cases.seal.solve.contact_meshes`) to start from and add to.
    differentiate: makes the sensitivities of a film, where they are asked for.
    """
    try:
        contact = DryContact.of(contact_of(parameters), observer, contacts)
    except StageError as failed:  # the size of the problem alone is reported
        failures = [explained(failed, parameters)]
        return _outcome(build_system(parameters), failed.records, [], failures)
    report_contact(observer, contact.state)
    judge = Judge(verdict_of_contact(contact.system, contact.x), differentiate)
    states, failures = list[FilmState](), list[tuple[Status, str]]()
    for stroke in strokes_of(parameters):
        last, missed = list[Adapted](), list[NoFilm]()
        for speed in parameters.speeds:
            result = None
            if computed(parameters, stroke):
                result = contact.adapted(stroke, speed, last[-2:])
            if not isinstance(result, Adapted):
                state = estimated_state(parameters, contact.system, contact.x, stroke, speed)
                if state is not None:
                    states.append(state)
                    report_film(observer, state)
                if result is not None:  # a film was sought, and its failure is not lost
                    missed.append(result)
                continue
            states.append(judge.state(result, last[-1].film.numbers if last else None))
            report_film(observer, states[-1])
            last.append(result)
        if missed:
            failures.append(without_films(missed, parameters))
    numbers = contact_numbers(contact.system, contact.x)
    return _outcome(contact.system, contact.solver.driver.records, states, failures, numbers)


def _outcome(
    system: SealSystem,
    records: Sequence[StageRecord],
    states: list[FilmState],
    failures: list[tuple[Status, str]],
    numbers: Mapping[str, float] | None = None,
) -> Outcome[FilmState]:
    blocks, p = system.problem.assembler.blocks, system.parameters
    return Outcome(
        states=tuple(states),
        status=failures[0][0] if failures else Status.CONVERGED,
        message="; ".join(message for _, message in failures) or "all requested states converged",
        unknowns=system.counts,
        kernel_signatures={b.kernel.name: b.kernel.signature for b in blocks},
        stages=tuple(records),
        solvers={
            "solver": p.solver,
            "linear": direct_solver(p.linear).name,
            "assembly": assembly(p),
        },
        numbers=numbers or {},
    )
