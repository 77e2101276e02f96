"""The reciprocating O-ring seal of section 5: build, follow the path, report every state."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import nan
from pathlib import Path

from softehl.cases.seal.contact import ContactRoute
from softehl.cases.seal.contact_store import ContactStore
from softehl.cases.seal.estimate import coarser_section, h_star_error
from softehl.cases.seal.fast import FastFilm
from softehl.cases.seal.order import REFERENCE_ORDER, OrderPair, transferred
from softehl.cases.seal.parameters import ORing
from softehl.cases.seal.path import (
    Film,
    PathSettings,
    Stroke,
    contact_problem,
    film_problem,
    release_stage,
    shear_stage,
    speed_stage,
    weight_stage,
)
from softehl.cases.seal.refinement import carried_contact
from softehl.cases.seal.results import (
    MICROMETRE,
    contact_pressure,
    contact_state,
    film_numbers,
    film_state,
)
from softehl.cases.seal.section import OringSection, build_section
from softehl.cases.seal.stage import Stage, Walker
from softehl.cases.seal.state import FilmState, Observer, Outcome, StageRecord
from softehl.cases.seal.stopped import Stopped
from softehl.cases.seal.verdict import Verdict, fewest_inlet_segments
from softehl.runtime.arrays import Array
from softehl.runtime.solve.backends import choose
from softehl.runtime.solve.linear import Condenser
from softehl.runtime.solve.newton import Newton
from softehl.runtime.solve.solution import Point, Status

OnSpeed = Callable[[Film, Point], None]


@dataclass
class _Run:
    """A run in progress: the only thing in this case that changes."""

    observer: Observer
    settings: PathSettings
    walker: Walker
    section: OringSection = field(init=False)
    records: list[StageRecord] = field(default_factory=list)
    states: list[FilmState] = field(default_factory=list)
    stopped: list[tuple[Status, str]] = field(default_factory=list)
    prefix: str = ""
    contacts: ContactStore = field(default_factory=ContactStore)
    coarser: tuple[_Run, Array] | None = None

    def beside(self, section: OringSection, prefix: str) -> _Run:
        """A run on another section, whose stages are recorded with ours under a prefix."""
        other = _Run(self.observer, self.settings, self.walker, records=self.records, prefix=prefix)
        other.section = section
        return other

    def walk(self, stage: Stage, x: Array) -> Array:
        """Unknowns at the end of a stage; raises Stopped if it is not reached."""
        stage = replace(stage, name=self.prefix + stage.name)
        branch, record = self.walker.walk(stage, x, self.observer)
        self.records.append(record)
        if not branch.converged:
            raise Stopped(stage, branch)
        return branch.last.x

    def contact(self, parameters: ORing) -> Array:
        """First stage, shared by both strokes; settles the mesh, that is the section."""
        route = ContactRoute(self.settings, self.walk, self.walker.newton, self.contacts)
        self.section, x = route.contact(parameters)
        p_s = parameters.sealed_pressure
        problem = contact_problem(self.section, self.settings, p_s)
        self.observer.contact_state(contact_state(self.section, problem, p_s, x))
        if parameters.error_estimate and parameters.mesh == "graded":
            with suppress(Stopped):
                self.coarser = self._coarser_run(x)
        return x

    def _coarser_run(self, x: Array) -> tuple[_Run, Array]:
        """The same on a coarser mesh, whose films are no results, and its contact state."""
        run = self.beside(coarser_section(self.section), "coarser mesh: ")
        start = carried_contact(self.section, run.section, self.settings, x, "contact")
        return run, run.walk(*start)

    def thicknesses(self, stroke: Stroke, x: Array) -> dict[float, float]:
        """h* (mm) at the requested speeds, as far as they are reached; nothing is reported."""
        found: dict[float, float] = {}

        def keep(film: Film, point: Point) -> None:
            if film.speed in speeds:
                problem = film_problem(self.section, self.settings, film)
                numbers = film_numbers(self.section, problem, film, point.solution.x)
                found[film.speed] = numbers.h_star

        film, speeds = self.first_film(stroke, x), self.section.parameters.speeds
        with suppress(Stopped):
            if self._fast_films(film, x, keep):
                return found
        with suppress(Stopped):
            film, x = self.build_film(film, x)
            self.walk(speed_stage(self.section, self.settings, film, speeds, keep), x)
        return found

    def stroke(self, stroke: Stroke, x: Array) -> None:
        """Second and third stage of one stroke, from the contact state x."""
        section, settings, p = self.section, self.settings, self.section.parameters
        reference = float(contact_pressure(section, p.sealed_pressure, x).max())
        fewest = fewest_inlet_segments(p.reynolds, p.pressure_order)
        coarser = self.coarser[0].thicknesses(stroke, self.coarser[1]) if self.coarser else {}
        judge = _Judge(self, Verdict(reference, fewest=fewest), coarser)
        film = self.first_film(stroke, x)
        with suppress(Stopped):
            if self._fast_films(film, x, judge):
                return
        try:
            start, state = judge.position or self.build_film(film, x)
            slower = [u for u in p.speeds if u < start.speed or judge.position is None]
            self.walk(speed_stage(section, settings, start, slower, judge), state)
        except Stopped as stop:
            stop.last = judge.verdict.last
            self.from_higher_order(film, x, judge)
            if judge.missing:
                raise

    def first_film(self, stroke: Stroke, x: Array) -> Film:
        """The film at its highest speed, under the rod forces of the contact state x."""
        p = self.section.parameters
        speed = max(self.settings.start_speed, *p.speeds)
        multipliers = x[self.section.layout.part("rod")].copy()
        shear = 1.0 if p.shear_traction else 0.0
        _, gap = self.section.arc_film(x)
        return Film(p.sealed_pressure, stroke, speed, multipliers, gap, shear=shear)

    def _fast_films(self, film: Film, x: Array, on_speed: OnSpeed) -> bool:
        """Second and third stage by modified Newton; False where it does not apply."""
        section, settings, p = self.section, self.settings, self.section.parameters
        linear = self.walker.newton.linear
        fit = p.solver == "auto" and p.rotation == "fixed"
        if not fit or not isinstance(linear, Condenser):
            return False
        fast = FastFilm.of(section, linear)
        x = self.walk(fast.weight(weight_stage(section, settings, film)), x)
        if p.shear_traction:
            x = self.walk(fast.shear(shear_stage(section, settings, film)), x)
        self.walk(fast.speed(speed_stage(section, settings, film, p.speeds, on_speed)), x)
        return True

    def build_film(self, film: Film, x: Array) -> tuple[Film, Array]:
        """Second stage by Newton's method: from the contact state x to the film."""
        section, settings, p = self.section, self.settings, self.section.parameters
        x = self.walk(weight_stage(section, settings, film), x)
        if p.rotation == "free":
            x = self.walk(release_stage(section, settings, film, x), x)
            film = replace(film, moment=0.0)
        if p.shear_traction:
            x = self.walk(shear_stage(section, settings, film), x)
        return film, x

    def from_higher_order(self, film: Film, contact: Array, judge: _Judge) -> None:
        """The speeds that a low pressure order did not reach by itself, as far as possible."""
        section, settings, missing = self.section, self.settings, judge.missing
        if section.parameters.pressure_order >= REFERENCE_ORDER:
            return
        pair = OrderPair.of(section)
        other = self.beside(pair.high, f"order {REFERENCE_ORDER}: ")
        found: dict[float, tuple[Film, Array]] = {}

        def keep(at: Film, point: Point) -> None:
            if at.speed in missing:
                found[at.speed] = (at, point.solution.x)

        with suppress(Stopped):
            x = transferred(contact, section, pair.high)
            film, x = other.build_film(other.first_film(film.stroke, x), x)
            other.walk(speed_stage(pair.high, settings, film, missing, keep), x)
        for at, x in found.values():
            with suppress(Stopped):
                x = pair.low_part(self.walk(pair.stage(settings, at), pair.start(x)))
                solution = self.walker.newton.solve(film_problem(section, settings, at), x)
                if solution.converged:
                    judge(at, Point(1.0, solution))


@dataclass
class _Judge:
    """Looks at every step of falling speed; a requested speed becomes a state.

    coarser: h* (mm) at a speed on the coarser mesh, where it is known.
    """

    run: _Run
    verdict: Verdict
    coarser: Mapping[float, float] = field(default_factory=dict)
    reached: list[float] = field(default_factory=list)
    position: tuple[Film, Array] | None = None

    @property
    def missing(self) -> tuple[float, ...]:
        """Requested speeds that were not reached, falling."""
        speeds = self.run.section.parameters.speeds
        return tuple(sorted(set(speeds) - set(self.reached), reverse=True))

    def __call__(self, film: Film, point: Point) -> None:
        run, x = self.run, point.solution.x
        if self.position is not None and not film.speed < self.position[0].speed:
            return  # where another way of solving sets in
        self.position = film, x
        problem = film_problem(run.section, run.settings, film)
        self.verdict = self.verdict.after(film_numbers(run.section, problem, film, x))
        if film.speed not in run.section.parameters.speeds:
            return
        self.reached.append(film.speed)
        iterations = point.solution.iterations
        state = film_state(run.section, problem, film, x, self.verdict, iterations)
        density, coarser = state.density, self.coarser.get(film.speed, nan)
        error = h_star_error(density, state.h_star_um, coarser / MICROMETRE)
        state = replace(state, h_star_error_percent=error)
        run.states.append(state)
        run.observer.film_state(state)


def run(
    parameters: ORing,
    observer: Observer,
    settings: PathSettings | None = None,
    walker: Walker | None = None,
    contacts: Path | None = None,
) -> Outcome:
    """Solve the O-ring and report to the observer; failure is in the outcome's status.

    contacts: folder of contact states (`cases.seal.contact_store`) to start from and to add to.
    """
    walker = walker or Walker(Newton(max_iterations=10, linear=choose(parameters.linear)))
    progress = _Run(observer, settings or PathSettings(), walker, contacts=ContactStore(contacts))
    strokes: tuple[Stroke, ...] = ("out", "in")
    wanted = strokes if parameters.stroke == "both" else (parameters.stroke,)
    try:
        x = progress.contact(parameters)
    except Stopped as stop:
        progress.stopped.append(stop.explain("contact", parameters.rotation))
        progress.section = build_section(parameters)  # for its size: none was settled
        return _outcome(progress)
    for stroke in wanted:
        try:
            progress.stroke(stroke, x)
        except Stopped as stop:
            progress.stopped.append(stop.explain(f"stroke {stroke}", parameters.rotation))
    return _outcome(progress)


def _outcome(progress: _Run) -> Outcome:
    section, stopped = progress.section, progress.stopped
    blocks = section.problem.assembler.blocks
    return Outcome(
        states=tuple(progress.states),
        status=stopped[0][0] if stopped else Status.CONVERGED,
        message="; ".join(message for _, message in stopped) or "all requested states converged",
        unknowns={"total": section.layout.total, "pressure": section.layout.count("pressure")},
        kernel_signatures={b.kernel.name: b.kernel.signature for b in blocks},
        stages=tuple(progress.records),
        solvers={
            "solver": section.parameters.solver,
            "linear": progress.walker.newton.linear.name,
        },
    )
