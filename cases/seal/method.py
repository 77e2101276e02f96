"""The method for any seal: contact, from contact to film, falling speed; every state is reported.

What changes during a run is a `RunState`, what changes along a stroke a `StrokeState`, and the
records of the path driver; everything else is frozen.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import nan
from pathlib import Path

from softehl.cases.seal.coarser_films import CoarserFilms
from softehl.cases.seal.contact import along, approach_stage, assembly, contact_problem
from softehl.cases.seal.contact_route import ContactRoute
from softehl.cases.seal.contact_store import ContactStore
from softehl.cases.seal.dry import (
    dry_film,
    rising_stage,
    settle_stage,
    sliding_stages,
    wetting_stages,
)
from softehl.cases.seal.equations import SealSystem, build_system
from softehl.cases.seal.estimate import coarser_system, h_star_error
from softehl.cases.seal.failure import explained
from softehl.cases.seal.film import (
    FastFilm,
    film_offsets,
    first_film,
    release_stage,
    shear_stage,
    speed_stage,
    weight_stage,
)
from softehl.cases.seal.loads import FilmLoads, Stroke
from softehl.cases.seal.nearing import nearing_stage, without_rounding
from softehl.cases.seal.order import REFERENCE_ORDER, OrderPair, transferred
from softehl.cases.seal.overlap import overlap
from softehl.cases.seal.parameters import ORing
from softehl.cases.seal.path import Followed, PathDriver, PathSettings, Stage, StageFailed
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
from softehl.cases.seal.state import FilmState, Observer, Outcome
from softehl.cases.seal.thinning import thinned_film, thinning_stage
from softehl.cases.seal.verdict import ANY_RATIO, INLET_RATIO, Verdict, fewest_inlet_segments
from softehl.runtime.arrays import Array
from softehl.runtime.fem.design import Inputs
from softehl.runtime.solve.backends import choose
from softehl.runtime.solve.linear import Condenser, SingularMatrix
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Point, Status

OnSpeed = Callable[[FilmLoads, Point], None]
BuiltFilm = tuple[FilmLoads, Array]


@dataclass
class RunState:
    """What changes during a run: the states that were reached, and how strokes ended early."""

    states: list[FilmState] = field(default_factory=list)
    failures: list[tuple[Status, str]] = field(default_factory=list)


@dataclass
class StrokeState:
    """What changes along a stroke.

    verdict: on the films so far. slowest: the slowest film that was solved, and its unknowns.
    missing: requested speeds that were not reached yet. rates: of the inputs by each parameter.
    """

    verdict: Verdict
    missing: set[float]
    slowest: BuiltFilm | None = None
    rates: Mapping[str, Inputs] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class FilmPath:
    """The films of a system: built up from its contact state, then followed as the speed falls."""

    system: SealSystem
    settings: PathSettings
    driver: PathDriver

    def starts(self, stroke: Stroke, x: Array) -> Iterator[BuiltFilm]:
        """First films of a stroke, one after the other, and the contact states they begin at.

        x: the contact state of the section.
        """
        system, settings = self.system, self.settings
        for offset in film_offsets(system, settings, stroke, x):
            y: Followed = x
            if offset != settings.offset:
                linear = self.driver.newton.linear
                if self.quick and isinstance(linear, Condenser):
                    stage = nearing_stage(system, settings, offset, x, linear)
                else:
                    stage = approach_stage(system, settings, offset)
                    stage = replace(stage, corrector=along(system, self.driver.newton))
                y = self.driver.follow(stage, x)
            if not isinstance(y, StageFailed):
                y = without_rounding(system, y)
                yield first_film(system, replace(settings, offset=offset), stroke, y), y

    @property
    def quick(self) -> bool:
        """Whether modified Newton iterations are to be tried."""
        p, linear = self.system.parameters, self.driver.newton.linear
        held = p.rotation == "fixed" and not p.rubs
        return p.solver == "auto" and held and isinstance(linear, Condenser)

    def fast(self, film: FilmLoads, x: Array, on_speed: OnSpeed) -> StageFailed | None:
        """All film stages by modified Newton iterations; the one that ended early, if one did."""
        fast = self._modified(x)
        assert fast
        first = fast.weight(weight_stage(self.system, self.settings, film))
        return self._all(fast, first, film, x, on_speed)

    def thinned(self, film: FilmLoads, x: Array, on_speed: OnSpeed) -> StageFailed | None:
        """All films of a stroke, the first by squeezing out what is in contact at x; see `fast`."""
        fast = self._modified(x)
        assert fast
        first, y = thinning_stage(fast, film, x)
        if self.system.parameters.shear_traction:
            film = replace(film, shear=1.0)
        return self._all(fast, first, film, y, on_speed)

    def _all(
        self, fast: FastFilm, first: Stage, film: FilmLoads, x: Array, on_speed: OnSpeed
    ) -> StageFailed | None:
        """The first stage from x (n,), then shear, then falling speed."""
        system, settings, p = self.system, self.settings, self.system.parameters
        stages = [first]
        if p.shear_traction:
            stages.append(fast.shear(shear_stage(system, settings, film)))
        stages.append(fast.speed(speed_stage(system, settings, film, p.speeds, on_speed)))
        end = self.driver.follow_all(stages, x)
        return end if isinstance(end, StageFailed) else None

    def carried(
        self, stroke: Stroke, x: Array, known: CoarserFilms, on_speed: OnSpeed
    ) -> StageFailed | None:
        """The films that a coarser mesh has, as far as they lead from one to the next."""
        fast, speeds = self._modified(x), tuple(sorted(known.films, reverse=True))
        if not (fast and speeds):
            return None
        film = first_film(self.system, self.settings, stroke, x)
        _, gap = self.system.arc_film(x + known.built(speeds[0]))
        film = replace(film, speed=speeds[0], gap=gap)
        stage = speed_stage(self.system, self.settings, film, speeds, on_speed)
        try:
            stage, start = fast.carried(stage, known, x)
        except SingularMatrix:
            return None
        end = self.driver.follow(stage, start)
        return end if isinstance(end, StageFailed) else None

    def begun(self, stroke: Stroke, x: Array, on_speed: OnSpeed) -> tuple[FilmLoads, Array] | None:
        """The start to go on from by Newton's method, None if the films of a stroke are all solved.

        Other starts are tried where one does not lead to a film.
        """
        thick = thinned_film(self.system, self.settings, stroke, x) if self.quick else None
        if thick:
            failed = self.thinned(thick, x, on_speed)
            if failed is None:
                return None
            if "falling speed" in failed.stage.name:
                return first_film(self.system, self.settings, stroke, x), x
        first: BuiltFilm | None = None
        for film, y in self.starts(stroke, x):
            first = first or (film, y)
            if not self.quick:
                break
            failed = self.fast(film, y, on_speed)
            if failed is None:
                return None
            if "contact to film" not in failed.stage.name:
                return film, y
        return first or (first_film(self.system, self.settings, stroke, x), x)

    def films(self, stroke: Stroke, x: Array, on_speed: OnSpeed) -> StageFailed | None:
        """All films of a stroke from the settled contact state x; what went wrong, if anything."""
        if self.system.parameters.rough:
            return self.rise(stroke, x, on_speed)
        start = self.begun(stroke, x, on_speed)
        if start is None:
            return None
        return self.slower(self.build(*start), self.system.parameters.speeds, on_speed)

    def settled(self, x: Array) -> Followed:
        """The contact state x where the rod is as near as asperities let it; x itself if smooth."""
        if not self.system.parameters.rough:
            return x
        stage = settle_stage(self.system, self.settings, self.driver.newton)
        return self.driver.follow(stage, x)

    def rise(self, stroke: Stroke, x: Array, on_speed: OnSpeed) -> StageFailed | None:
        """Rough films: from asperities in contact at x to dry sliding, then to higher speeds."""
        system, p = self.system, self.system.parameters
        film = dry_film(system, stroke, x)
        y = self.driver.follow_all(wetting_stages(system, film, x), x)
        if not isinstance(y, StageFailed):
            fast = self._modified(y)
            y = self._sliding(film, y, fast)
        if isinstance(y, StageFailed):
            return y
        shear = 1.0 if p.shear_traction else 0.0
        moment = 0.0 if p.rotation == "free" else film.moment
        return self._faster(replace(film, shear=shear, moment=moment), y, on_speed, fast)

    def _modified(self, x: Array) -> FastFilm | None:
        """Modified Newton iterations of a stroke begun at x (n,), None where they do not serve."""
        linear = self.driver.newton.linear
        if not self.quick or not isinstance(linear, Condenser):
            return None
        return FastFilm.of(self.system, linear, x)

    def _sliding(self, film: FilmLoads, x: Array, fast: FastFilm | None) -> Followed:
        """The dry film x (n,) with its friction; by Newton's method where the fast way fails."""
        stages = sliding_stages(self.system, self.settings, film, x)
        if fast:
            y = self.driver.follow_all(map(fast.shear, stages), x)
            if not isinstance(y, StageFailed):
                return y
        return self.driver.follow_all(stages, x)

    def _faster(
        self, film: FilmLoads, x: Array, on_speed: OnSpeed, fast: FastFilm | None
    ) -> StageFailed | None:
        """Rising speeds by modified Newton iterations; by Newton's method where they fail."""
        system, p = self.system, self.system.parameters
        reached = [(film, x)]

        def keep(at: FilmLoads, point: Point) -> None:
            if at.speed > reached[0][0].speed or not reached[1:]:
                reached[1:] = [(at, point.solution.x)]
                on_speed(at, point)

        def stage(start: FilmLoads) -> Stage:
            speeds = tuple(u for u in p.speeds if u >= start.speed)
            return rising_stage(system, self.settings, start, speeds, keep)

        if fast:
            end = self.driver.follow(fast.rising(stage(film)), x)
            if not isinstance(end, StageFailed):
                return None
        film, x = reached[-1]
        reached[:] = [(film, x)]
        end = self.driver.follow(stage(film), x)
        return end if isinstance(end, StageFailed) else None

    def build(self, film: FilmLoads, x: Array) -> BuiltFilm | StageFailed:
        """By Newton's method from the contact state x to the film at its first speed."""
        system, settings, p = self.system, self.settings, self.system.parameters
        y = self.driver.follow(weight_stage(system, settings, film), x)
        if film.moment is None and p.rotation == "free" and not isinstance(y, StageFailed):
            y = self.driver.follow(release_stage(system, settings, film, y), y)
            film = replace(film, moment=0.0)
        if p.shear_traction and not isinstance(y, StageFailed):
            y = self.driver.follow(shear_stage(system, settings, film), y)
        return y if isinstance(y, StageFailed) else (film, y)

    def slower(
        self, built: BuiltFilm | StageFailed, speeds: tuple[float, ...], on_speed: OnSpeed
    ) -> StageFailed | None:
        """By Newton's method from a film to slower ones; what went wrong, if anything did."""
        if isinstance(built, StageFailed):
            return built
        film, x = built
        end = self.driver.follow(speed_stage(self.system, self.settings, film, speeds, on_speed), x)
        return end if isinstance(end, StageFailed) else None


@dataclass(frozen=True, eq=False)
class SealRun:
    """A system whose contact state x is known, with what is reported of its films.

    coarser: the films of a coarser mesh, which are no results, and its contact state.
    """

    path: FilmPath
    x: Array
    observer: Observer
    state: RunState
    coarser: tuple[FilmPath, Array] | None = None

    @property
    def system(self) -> SealSystem:
        """The system that is solved."""
        return self.path.system

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
        progress = StrokeState(verdict, set(p.speeds))

        def on_speed(film: FilmLoads, point: Point) -> None:
            self._judge(progress, coarser, film, point)

        if p.rough:
            return path.rise(stroke, self.x, on_speed)
        if known:
            path.carried(stroke, self.x, known, on_speed)
        start = path.begun(stroke, self.x, on_speed) if progress.missing else None
        if start is None:
            return None
        built = progress.slowest or path.build(*start)
        left = p.speeds if progress.slowest is None else _below(p.speeds, progress.slowest[0].speed)
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
        progress.slowest = film, x
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
            state = replace(state, sensitivity=self._differentiated(progress, film, x))
        self.state.states.append(state)
        self.observer.film_state(state)

    def _differentiated(
        self, progress: StrokeState, film: FilmLoads, x: Array
    ) -> Mapping[str, Mapping[str, float]] | None:
        """Sensitivities of a film x (n,); none where its tangent has no usable factors."""
        progress.rates = rates_of(self.system, film, progress.rates)
        try:
            linear = self.path.driver.newton.linear
            return sensitivities(self.system, film, x, linear, progress.rates)
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


def _below(speeds: tuple[float, ...], speed: float) -> tuple[float, ...]:
    return tuple(u for u in speeds if u < speed)


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
    seal = _begun(FilmPath(found[0], settings, driver), found[1], observer, state)
    if isinstance(seal, StageFailed):
        state.failures.append(explained(seal, "contact", parameters))
        return _outcome(found[0], driver, state)
    strokes: tuple[Stroke, ...] = ("out", "in")
    for stroke in strokes if parameters.stroke == "both" else (parameters.stroke,):
        failed = seal.stroke(stroke)
        if failed is not None:
            state.failures.append(explained(failed, f"stroke {stroke}", parameters))
    return _outcome(seal.system, driver, state, contact_numbers(seal.system, seal.x))


def _begun(path: FilmPath, x: Array, observer: Observer, state: RunState) -> SealRun | StageFailed:
    """A run whose contact state x (n,) is settled, and with it the mesh; shared by both strokes."""
    system, settings, p = path.system, path.settings, path.system.parameters
    problem = contact_problem(system, settings, p.sealed_pressure)
    observer.contact_state(contact_state(system, problem, p.sealed_pressure, x))
    settled = path.settled(x)
    if isinstance(settled, StageFailed):
        return settled
    seal = SealRun(path, settled, observer, state)
    if not (p.error_estimate and p.mesh == "graded"):
        return seal
    coarser = FilmPath(coarser_system(system), settings, path.driver.named("coarser mesh: "))
    route = ContactRoute(settings, coarser.driver.follow, coarser.driver.newton)
    y = route.elsewhere(system, x, coarser.system)
    if not isinstance(y, StageFailed):
        y = coarser.settled(y)
    return seal if isinstance(y, StageFailed) else replace(seal, coarser=(coarser, y))


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
