"""The method for any seal: contact, from contact to film, falling speed; every state is reported.

What changes during a run is a `RunState`, what changes along a stroke a `StrokeState`, and the
records of the path driver; everything else is frozen.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from math import nan
from pathlib import Path
from typing import TypeAlias

from softehl.cases.harness.row import OK
from softehl.cases.seal.coarser_films import CoarserFilms
from softehl.cases.seal.contact import assembly, contact_problem
from softehl.cases.seal.contact_route import ContactRoute
from softehl.cases.seal.contact_store import ContactStore
from softehl.cases.seal.equations import SealSystem, build_system
from softehl.cases.seal.estimate import ESTIMATED, coarser_system, h_star_error
from softehl.cases.seal.failure import explained
from softehl.cases.seal.film_edges import film_edges
from softehl.cases.seal.film_path import BuiltFilm, FilmPath, OnSpeed, below
from softehl.cases.seal.loads import FilmLoads, Stroke
from softehl.cases.seal.order import REFERENCE_ORDER, OrderPair, transferred
from softehl.cases.seal.overlap import overlap
from softehl.cases.seal.parameters import ORing
from softehl.cases.seal.path import PathDriver, PathSettings, StageFailed
from softehl.cases.seal.results import (
    contact_numbers,
    contact_peaks,
    contact_pressure,
    contact_state,
    film_numbers,
    film_state,
    unsealed,
)
from softehl.cases.seal.sensitivity import rates_of, sensitivities
from softehl.cases.seal.sensitivity_table import resolved
from softehl.cases.seal.state import FilmState, Observer, Outcome, doubt
from softehl.cases.seal.verdict import ANY_RATIO, INLET_RATIO, Verdict, fewest_inlet_segments
from softehl.runtime.arrays import Array
from softehl.runtime.fem.design import Inputs
from softehl.runtime.solve.backends import choose
from softehl.runtime.solve.linear import SingularMatrix
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Point, Status

MESHES = 2
"""How many meshes may be made for the films of a stroke on a section that is not round, one after
the other, where they are not `ok` on the one before."""


@dataclass
class RunState:
    """What changes during a run: the states that were reached, and how strokes ended early.

    rates: of the inputs of the film by each parameter, once they were asked for. held: states of a
    stroke that another mesh may better. last: the slowest film of a stroke on a mesh.
    """

    states: list[FilmState] = field(default_factory=list)
    failures: list[tuple[Status, str]] = field(default_factory=list)
    rates: Mapping[str, Inputs] = field(default_factory=dict)
    held: list[FilmState] = field(default_factory=list)
    last: BuiltFilm | None = None

    def begin(self) -> None:
        """Another stroke begins, or the same on another mesh."""
        self.held, self.last = [], None

    def on_another_mesh(self) -> RunState:
        """What a mesh begins with of which nothing is known but what was reached on others."""
        return RunState(self.states, self.failures)


@dataclass
class StrokeState:
    """What changes along a stroke.

    verdict: on the films so far. slowest: the slowest film that was solved, and its unknowns.
    missing: requested speeds that were not reached yet.
    """

    verdict: Verdict
    missing: set[float]
    slowest: BuiltFilm | None = None


@dataclass(frozen=True, eq=False)
class SealRun:
    """A system whose contact state x is known, with what is reported of its films.

    coarser: the films of a coarser mesh, which are no results, and its contact state. better: the
    same on a mesh that is made for the last film, None where there is none. meshes: how many such
    meshes may follow. speeds: |U| to be reported, mm/s. rivals: states of other meshes that are not
    `ok`; the best is reported where none is.
    """

    path: FilmPath
    x: Array
    observer: Observer
    state: RunState
    coarser: tuple[FilmPath, Array] | None = None
    better: Better | None = None
    meshes: int = 0
    speeds: tuple[float, ...] = ()
    rivals: tuple[FilmState, ...] = ()

    @property
    def system(self) -> SealSystem:
        """The system that is solved."""
        return self.path.system

    def on_meshes(self, stroke: Stroke) -> tuple[StageFailed | None, SealRun]:
        """A stroke, and once more what is not `ok` on a mesh that is made for its film.

        With the run on the last of these meshes: it is also the better one for the other stroke.
        """
        self.state.begin()
        failed = self.stroke(stroke)
        left, held = self._left(stroke), (*self.rivals, *self.state.held)
        if not (self.better and self.meshes and left and self.state.last):
            for u in left:
                some = [state for state in held if abs(state.rod_speed_mm_s) == u]
                if some:
                    self._report(min(some, key=doubt))
            return failed if self._left(stroke) else None, self
        other = self.better(self, left) or replace(self, meshes=0, speeds=left)
        failed, last = replace(other, rivals=held).on_meshes(stroke)
        return failed, replace(last, meshes=self.meshes, speeds=self.speeds, rivals=())

    def _left(self, stroke: Stroke) -> tuple[float, ...]:
        """Speeds of a stroke that are not reported yet."""
        sign = 1.0 if stroke == "out" else -1.0
        done = {sign * state.rod_speed_mm_s for state in self.state.states}
        return tuple(u for u in self.speeds if u not in done)

    def _report(self, state: FilmState) -> None:
        self.state.states.append(state)
        self.observer.film_state(state)

    def stroke(self, stroke: Stroke) -> StageFailed | None:
        """Second and third stage of one stroke; why it ended early, if it did."""
        p, path = self.system.parameters, self.path
        reference = float(contact_pressure(self.system, p.sealed_pressure, self.x).max())
        references = contact_peaks(self.system, p.sealed_pressure, self.x)
        fewest = fewest_inlet_segments(p.reynolds, p.pressure_order)
        ratios = ANY_RATIO if p.mesh == "uniform" else INLET_RATIO
        known = _known(*self.coarser, stroke, self.system) if self.coarser else None
        coarser = known.thicknesses if known else {}
        verdict = Verdict(reference, fewest=fewest, ratios=ratios, rough=p.rough)
        verdict = replace(
            verdict,
            unsealed=unsealed(self.system, self.x),
            references=references,
            overlap=overlap(self.system, self.x),
        )
        progress = StrokeState(verdict, set(self.speeds))

        def on_speed(film: FilmLoads, point: Point) -> None:
            self._judge(progress, coarser, film, point)

        if p.rough:
            return path.rise(stroke, self.x, on_speed)
        if known:
            path.carried(stroke, self.x, known, on_speed)
        if progress.slowest and progress.missing:
            path.onward(*progress.slowest, on_speed)
        start = path.begun(stroke, self.x, on_speed) if progress.missing else None
        if start is None or (self.meshes and progress.slowest):
            return None
        if self.better and self.meshes < MESHES and progress.slowest is None:
            return path.without_film(*start)
        built = progress.slowest or path.build(*start)
        left = p.speeds if progress.slowest is None else below(p.speeds, progress.slowest[0].speed)
        failed = path.slower(built, left, on_speed)
        if failed is None:
            return None
        last = progress.verdict.last
        self._from_higher_order(stroke, progress, on_speed)
        return replace(failed, last=last) if progress.missing else None

    def _judge(
        self, progress: StrokeState, coarser: Mapping[float, float], film: FilmLoads, point: Point
    ) -> None:
        """Look at a film of falling speed; one at a requested speed becomes a state."""
        system, x = self.system, point.solution.x
        falling = not system.parameters.rough
        if falling and progress.slowest and not film.speed < progress.slowest[0].speed:
            return  # a slower film is known already
        progress.slowest = self.state.last = film, x
        problem = system.film_problem(film)
        progress.verdict = progress.verdict.after(film_numbers(system, problem, film, x))
        if film.speed not in progress.missing:
            return
        progress.missing.discard(film.speed)
        iterations = point.solution.iterations
        p, last = system.parameters, progress.verdict.last
        assert last is not None
        error = h_star_error(p.density, last.h_star, coarser.get(film.speed, nan))
        wanted = error if p.error_estimate and p.mesh == "graded" else None
        verdict = replace(progress.verdict, error=wanted)
        state = film_state(system, problem, film, x, verdict, iterations)
        state = replace(state, h_star_error_percent=error)
        if p.sensitivity and resolved(state):
            state = replace(state, sensitivity=self._differentiated(film, x))
        if self.better and state.verdict != OK:
            self.state.held.append(state)
        else:
            self._report(state)

    def _differentiated(
        self, film: FilmLoads, x: Array
    ) -> Mapping[str, Mapping[str, float]] | None:
        """Sensitivities of a film x (n,); none where its tangent has no usable factors."""
        self.state.rates = rates_of(self.system, film, self.state.rates)
        try:
            linear = self.path.driver.newton.linear
            return sensitivities(self.system, film, x, linear, self.state.rates)
        except SingularMatrix:
            return None

    def _from_higher_order(self, stroke: Stroke, progress: StrokeState, on_speed: OnSpeed) -> None:
        """The speeds that a low pressure order did not reach by itself, as far as possible."""
        low, driver = self.system, self.path.driver
        if low.parameters.pressure_order >= REFERENCE_ORDER or low.parameters.rubs:
            return
        pair, missing = OrderPair.of(low), tuple(sorted(progress.missing, reverse=True))
        high = FilmPath(pair.high, self.path.settings, driver.named(f"order {REFERENCE_ORDER}: "))
        found: dict[float, BuiltFilm] = {}

        def keep(at: FilmLoads, point: Point) -> None:
            if at.speed in missing:
                found[at.speed] = at, point.solution.x

        start = next(high.starts(stroke, transferred(self.x, low, pair.high)))
        high.slower(high.build(*start), missing, keep)
        for at, x in found.values():
            both = driver.follow(pair.stage(self.path.settings, at), pair.start(x))
            if isinstance(both, StageFailed):
                continue
            solution = driver.newton.solve(low.film_problem(at), pair.low_part(both))
            if solution.converged:
                on_speed(at, Point(1.0, solution))


Better: TypeAlias = Callable[[SealRun, tuple[float, ...]], SealRun | None]


def _known(path: FilmPath, x: Array, stroke: Stroke, finer: SealSystem) -> CoarserFilms:
    """The films at the requested speeds, as far as they are reached; nothing is reported."""
    known, speeds = CoarserFilms(path.system, finer, x), path.system.parameters.speeds

    def keep(film: FilmLoads, point: Point) -> None:
        if film.speed in speeds:
            problem, y = path.system.film_problem(film), point.solution.x
            known.films[film.speed] = y
            known.thicknesses[film.speed] = film_numbers(path.system, problem, film, y).h_star

    path.films(stroke, x, keep)
    return known


def run(
    parameters: ORing,
    observer: Observer,
    settings: PathSettings | None = None,
    newton: Newton | None = None,
    contacts: Path | None = None,
) -> Outcome:
    """Solve a seal and report to the observer; failure is in the outcome's status.

    contacts: folder of contact states (`cases.seal.contact_store`) to start from and to add to.
    """
    newton = newton or Newton(max_iterations=10, linear=choose(parameters.linear))
    driver, settings = PathDriver(observer, newton), settings or PathSettings()
    state = RunState()
    route = ContactRoute(settings, driver.follow, driver.newton, ContactStore(contacts))
    found = route.contact(parameters)
    if isinstance(found, StageFailed):
        state.failures.append(explained(found, "contact", parameters))
        return _outcome(build_system(parameters), driver, state)  # its size alone is reported
    problem = contact_problem(found[0], settings, parameters.sealed_pressure)
    observer.contact_state(contact_state(found[0], problem, parameters.sealed_pressure, found[1]))
    seal = _begun(FilmPath(found[0], settings, driver), found[1], state, route)
    if isinstance(seal, StageFailed):
        state.failures.append(explained(seal, "contact", parameters))
        return _outcome(found[0], driver, state)
    strokes: tuple[Stroke, ...] = ("out", "in")
    for stroke in strokes if parameters.stroke == "both" else (parameters.stroke,):
        failed, seal = seal.on_meshes(stroke)
        if failed is not None:
            state.failures.append(explained(failed, f"stroke {stroke}", parameters))
    return _outcome(seal.system, driver, state, contact_numbers(seal.system, seal.x))


def _begun(path: FilmPath, x: Array, state: RunState, route: ContactRoute) -> SealRun | StageFailed:
    """A run whose contact state x (n,) is settled, and with it the mesh; shared by both strokes."""
    system, settings, p = path.system, path.settings, path.system.parameters
    settled = path.settled(x)
    if isinstance(settled, StageFailed):
        return settled
    seal = SealRun(path, settled, path.driver.observer, state, speeds=p.speeds)
    if system.section.layout.flat and p.mesh == "graded" and not (p.rough or p.rubs):
        seal = replace(
            seal, better=lambda worse, left: _for_film(worse, left, route), meshes=MESHES
        )
    if not (p.error_estimate and p.mesh == "graded"):
        return seal
    driver = path.driver.named("coarser mesh: ")
    coarser = FilmPath(coarser_system(system), settings, driver, ESTIMATED)
    route = replace(route, follow=coarser.driver.follow, contacts=ContactStore())
    y = route.elsewhere(system, x, coarser.system)
    if not isinstance(y, StageFailed):
        y = coarser.settled(y)
    return seal if isinstance(y, StageFailed) else replace(seal, coarser=(coarser, y))


def _for_film(seal: SealRun, speeds: tuple[float, ...], route: ContactRoute) -> SealRun | None:
    """A run on a mesh that is made for the last film of another one; None where none is found."""
    assert seal.state.last
    system, (film, y) = seal.system, seal.state.last
    h_star = film_numbers(system, system.film_problem(film), film, y).h_star
    found = route.for_film((system, seal.x), film_edges(system, y, h_star))
    if isinstance(found, StageFailed):
        return None
    path, state = replace(seal.path, system=found[0]), seal.state.on_another_mesh()
    other = _begun(path, found[1], state, route)
    if isinstance(other, StageFailed):
        return None
    return replace(other, meshes=seal.meshes - 1, speeds=speeds)


def _outcome(
    system: SealSystem,
    driver: PathDriver,
    state: RunState,
    numbers: Mapping[str, float] | None = None,
) -> Outcome:
    blocks, failures = system.problem.assembler.blocks, state.failures
    return Outcome(
        states=tuple(state.states),
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
