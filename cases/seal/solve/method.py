"""The method for any seal: contact, from there to films, falling speed; each state is reported."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from functools import cache, partial
from pathlib import Path

from softehl.cases.seal.equations.equations import SealSystem, build_system
from softehl.cases.seal.equations.loads import Stroke
from softehl.cases.seal.gland.parameters import ORing
from softehl.cases.seal.solve.contact import assembly, contact_problem, lies_in_corner
from softehl.cases.seal.solve.contact_route import ContactRoute
from softehl.cases.seal.solve.contact_store import ContactStore
from softehl.cases.seal.solve.failure import explained
from softehl.cases.seal.solve.film_path import BuiltFilm, FilmPath
from softehl.cases.seal.solve.path import PathDriver, PathSettings, StageFailed
from softehl.cases.seal.solve.strokes import MESHES, OtherMesh, SealRun
from softehl.cases.seal.solve.wanted import Wanted
from softehl.cases.seal.states.contact_results import contact_numbers, contact_state
from softehl.cases.seal.states.estimate import (
    ESTIMATED,
    coarser_density,
    finer_density,
    system_at,
)
from softehl.cases.seal.states.film_edges import film_edges
from softehl.cases.seal.states.results import film_numbers
from softehl.cases.seal.states.state import FilmState, Observer, Outcome
from softehl.runtime.arrays import Array
from softehl.runtime.mesh.mesh import MeshError
from softehl.runtime.solve.backends import choose
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Status


def run(
    parameters: ORing,
    observer: Observer,
    settings: PathSettings | None = None,
    newton: Newton | None = None,
    contacts: Path | None = None,
) -> Outcome:
    """Solve a seal and report to the observer; failure is in the outcome's status.

    contacts: folder of contact states (`cases.seal.solve.contact_store`) to start from and add to.
    """
    newton = newton or Newton(max_iterations=10, linear=choose(parameters.linear))
    driver, settings = PathDriver(observer, newton), settings or PathSettings()
    states, failures = list[FilmState](), list[tuple[Status, str]]()
    route = ContactRoute(settings, driver.follow, driver.newton, ContactStore(contacts))
    found = route.contact(parameters)
    if isinstance(found, StageFailed):
        failures.append(explained(found, "contact", parameters))
        return _outcome(
            build_system(parameters), driver, states, failures
        )  # its size alone is reported
    problem = contact_problem(found[0], settings, parameters.sealed_pressure)
    observer.contact_state(contact_state(found[0], problem, parameters.sealed_pressure, found[1]))
    seal = _begun(FilmPath(found[0], settings, driver), found[1], route)
    if isinstance(seal, StageFailed):
        failures.append(explained(seal, "contact", parameters))
        return _outcome(found[0], driver, states, failures)

    def report(state: FilmState) -> None:
        states.append(state.settled)
        observer.film_state(states[-1])

    strokes: tuple[Stroke, ...] = ("out", "in")
    for stroke in strokes if parameters.stroke == "both" else (parameters.stroke,):
        wanted = Wanted(report, parameters.speeds, observer.film_draft)
        failed, seal = seal.on_meshes(stroke, wanted)
        if failed is not None:
            failures.append(explained(failed, f"{stroke}stroke", parameters))
    numbers = contact_numbers(seal.system, seal.x)
    return _outcome(seal.system, driver, states, failures, numbers)


def _begun(path: FilmPath, x: Array, route: ContactRoute) -> SealRun | StageFailed:
    """A run whose contact state x (n,) is settled, and with it the mesh; shared by both strokes."""
    system, p = path.system, path.system.parameters
    settled = path.settled(x)
    if isinstance(settled, StageFailed):
        return settled
    seal = SealRun(path, settled)
    if system.section.layout.flat and p.mesh == "graded" and not (p.rough or p.rubs):
        seal = replace(
            seal, better=lambda worse, last: _for_film(worse, last, route), meshes=MESHES
        )
    graded = p.mesh == "graded" and p.given_arc is None
    if lies_in_corner(system) and graded and not (p.rough or p.rubs):
        seal = replace(seal, cornered=lambda worse, stroke: _for_stroke(worse, stroke, route))
    if not (p.error_estimate and p.mesh == "graded"):
        return seal
    if seal.cornered:
        seal = replace(seal, finer=cache(partial(_finer_mesh, path, x, route)))
    return replace(seal, coarser=_coarser_mesh(path, x, route))


def _coarser_mesh(path: FilmPath, x: Array, route: ContactRoute) -> OtherMesh | None:
    """For estimates of errors; None where there is none, or no contact state on it."""
    density = coarser_density(path.system.parameters.density)
    return _contact_on(density, path.driver.named("coarser mesh: "), (path, x), route)


def _finer_mesh(path: FilmPath, x: Array, route: ContactRoute) -> OtherMesh | None:
    """For estimates of errors, too; contact on it is not worth a path from rest."""
    density = finer_density(path.system.parameters.density)
    driver = path.driver.named("finer mesh: ")
    return _contact_on(density, driver, (path, x), route, from_rest=False)


def _contact_on(
    density: Fraction,
    driver: PathDriver,
    before: OtherMesh,
    route: ContactRoute,
    *,
    from_rest: bool = True,
) -> OtherMesh | None:
    """A mesh of another density, in contact; see `ContactRoute.elsewhere`."""
    path, x = before
    try:
        system = system_at(path.system, density)
    except MeshError:
        return None  # too coarse for the corners of a section
    other = FilmPath(system, path.settings, driver, ESTIMATED)
    aside = replace(route, follow=driver.follow, contacts=ContactStore())
    y = aside.elsewhere(path.system, x, system, from_rest=from_rest)
    if not isinstance(y, StageFailed):
        y = other.settled(y)
    return None if isinstance(y, StageFailed) else (other, y)


def _for_stroke(seal: SealRun, stroke: Stroke, route: ContactRoute) -> SealRun | None:
    """A run on a mesh for a stroke; None where the one in use is as good or none is found."""
    found = route.for_stroke(stroke, (seal.system, seal.x))
    if found is None:
        return None
    other = _begun(replace(seal.path, system=found[0]), found[1], route)
    return None if isinstance(other, StageFailed) else other


def _for_film(seal: SealRun, last: BuiltFilm, route: ContactRoute) -> SealRun | None:
    """A run on a mesh that is made for the last film of another one; None where none is found."""
    system, (film, y) = seal.system, last
    h_star = film_numbers(system, system.film_problem(film), film, y).h_star
    try:
        found = route.for_film((system, seal.x), film_edges(system, y, h_star))
    except MeshError:
        return None  # what the mesh in use has reached is worth more
    if isinstance(found, StageFailed):
        return None
    other = _begun(replace(seal.path, system=found[0]), found[1], route)
    if isinstance(other, StageFailed):
        return None
    other = replace(other, meshes=seal.meshes - 1)
    if seal.empty:
        emptied = route.emptied((seal.empty.system, seal.empty.x), found[0])
        if not isinstance(emptied, StageFailed):
            other = other.emptied(replace(other.path, system=emptied[0]), emptied[1])
    return other


def _outcome(
    system: SealSystem,
    driver: PathDriver,
    states: list[FilmState],
    failures: list[tuple[Status, str]],
    numbers: Mapping[str, float] | None = None,
) -> Outcome:
    blocks = system.problem.assembler.blocks
    return Outcome(
        states=tuple(states),
        status=failures[0][0] if failures else Status.CONVERGED,
        message="; ".join(message for _, message in failures) or "all requested states converged",
        unknowns=system.counts,
        kernel_signatures={b.kernel.name: b.kernel.signature for b in blocks},
        stages=tuple(driver.records),
        solvers={
            **{"solver": system.parameters.solver, "linear": driver.newton.linear.name},
            "assembly": assembly(system.parameters),
        },
        numbers=numbers or {},
    )
