"""The method for any seal: dry contact, then each film on a mesh that is made for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from softehl.cases.seal.equations.equations import SealSystem, build_system
from softehl.cases.seal.equations.loads import Stroke
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.solve.adaptation import Adaptation, Adapted
from softehl.cases.seal.solve.contact import assembly, contact_problem
from softehl.cases.seal.solve.contact_meshes import ContactMeshes
from softehl.cases.seal.solve.contact_solver import ContactSolver
from softehl.cases.seal.solve.contact_store import ContactStore
from softehl.cases.seal.solve.failure import explained, without_films
from softehl.cases.seal.solve.films import Film, FilmSolver, NoFilm
from softehl.cases.seal.solve.judging import Differentiate, Judge, verdict_of_contact
from softehl.cases.seal.solve.path import PathDriver, StageError
from softehl.cases.seal.states.contact_results import contact_numbers, contact_state
from softehl.cases.seal.states.plan import strokes_of
from softehl.cases.seal.states.state import (
    ContactState,
    FilmState,
    Observer,
    Outcome,
    StageRecord,
)
from softehl.runtime.arrays import Array
from softehl.runtime.solve.backends import choose
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Status


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
        driver = PathDriver(observer, Newton(max_iterations=10, linear=choose(p.linear)))
        solver = ContactSolver(driver)
        try:
            return cls(*ContactMeshes(solver, ContactStore(contacts)).contact(p), solver)
        except StageError as failed:
            failed.records = tuple(driver.records)
            raise

    @property
    def parameters(self) -> Seal:
        """The case."""
        return self.system.parameters

    @property
    def newton(self) -> Newton:
        """The method that finished it."""
        return self.solver.driver.newton

    @property
    def records(self) -> list[StageRecord]:
        """Cost of all that is solved; it grows."""
        return self.solver.driver.records

    @property
    def state(self) -> ContactState:
        """The state that is reported."""
        p_s = self.parameters.sealed_pressure
        return contact_state(self.system, contact_problem(self.system, p_s), p_s, self.x)

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
        found = None
        if last:
            near = [adapted.film for adapted in last]
            found = self.films.on(near[-1].system).from_neighbour(near, speed)
        if not isinstance(found, Film):
            found = self.film(stroke, speed)
        return Adaptation(self.parameters, self.solver, self.films).adapted(found, last)


def run(
    parameters: Seal,
    observer: Observer,
    contacts: Path | None = None,
    differentiate: Differentiate | None = None,
) -> Outcome:
    """Solve a seal and report to the observer; failure is in the outcome's status.

    contacts: folder of contact states (`cases.seal.solve.contact_store`) to start from and add to.
    differentiate: makes the sensitivities of a film, where they are asked for.
    """
    try:
        contact = DryContact.of(parameters, observer, contacts)
    except StageError as failed:  # the size of the problem alone is reported
        failures = [explained(failed, "contact", parameters)]
        return _outcome(build_system(parameters), failed.records, [], failures)
    observer.contact_state(contact.state)
    judge = Judge(verdict_of_contact(contact.system, contact.x), differentiate)
    states, failures = list[FilmState](), list[tuple[Status, str]]()
    for stroke in strokes_of(parameters):
        last, missed = list[Adapted](), list[NoFilm]()
        for speed in parameters.speeds:
            found = contact.adapted(stroke, speed, last[-2:])
            if isinstance(found, NoFilm):
                missed.append(found)
                continue
            states.append(judge.state(found, last[-1].film.numbers if last else None))
            observer.film_state(states[-1])
            last.append(found)
        if missed:
            failures.append(without_films(missed, parameters))
    numbers = contact_numbers(contact.system, contact.x)
    return _outcome(contact.system, contact.records, states, failures, numbers)


def _outcome(
    system: SealSystem,
    records: tuple[StageRecord, ...] | list[StageRecord],
    states: list[FilmState],
    failures: list[tuple[Status, str]],
    numbers: Mapping[str, float] | None = None,
) -> Outcome:
    blocks, p = system.problem.assembler.blocks, system.parameters
    return Outcome(
        states=tuple(states),
        status=failures[0][0] if failures else Status.CONVERGED,
        message="; ".join(message for _, message in failures) or "all requested states converged",
        unknowns=system.counts,
        kernel_signatures={b.kernel.name: b.kernel.signature for b in blocks},
        stages=tuple(records),
        solvers={
            **{"solver": p.solver, "linear": choose(p.linear).name},
            "assembly": assembly(p),
        },
        numbers=numbers or {},
    )
