"""The reciprocating O-ring seal of section 5: build, follow the path, report every state."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from cases.observer import FilmState, Observer, Outcome, StageRecord
from cases.oring_fast import FastFilm
from cases.oring_order import REFERENCE_ORDER, OrderPair, transferred
from cases.oring_parameters import ORing
from cases.oring_path import (
    Film,
    PathSettings,
    Stroke,
    contact_problem,
    film_problem,
    load_stage,
    release_stage,
    shear_stage,
    speed_stage,
    squeeze_stage,
    weight_stage,
)
from cases.oring_refinement import DENSITIES, finer, refined_contact
from cases.oring_results import contact_state, film_numbers, film_state
from cases.oring_section import OringSection, build_section
from cases.oring_verdict import FilmNumbers, Verdict, fewest_inlet_segments
from cases.stages import Stage, Walker
from runtime.continuation import Branch, Point
from runtime.linear import Condenser, choose
from runtime.newton import Newton
from runtime.solution import Status

Array = NDArray[np.float64]

FOLD = (
    "the path ends or turns back there, as it does when the film collapses on a mesh that is too "
    "coarse: use a finer mesh (larger density)"
)

CLOSED = 0.05
"""Least film thickness, in h*, below which a path ends because the film closes."""

CLOSING = (
    "the film closes: at a node it is only {:.2g} um thick there, and would be negative beyond; "
    "use a finer mesh (larger density) or a higher pressure_order"
)

ROLLING = (
    'with rotation = "free" hardly anything but the film turns or holds the section: use "fixed"'
)


class _Stopped(Exception):  # noqa: N818 (control flow inside this module)
    """A stage did not reach its end; carries its branch."""

    def __init__(self, stage: Stage, branch: Branch) -> None:
        super().__init__(stage.name)
        self.stage, self.branch = stage, branch
        self.last: FilmNumbers | None = None

    @property
    def message(self) -> str:
        """How far the stage came, in its own units, why no further, and what may help."""
        stage, branch = self.stage, self.branch
        goal = f"{stage.name} {stage.shown(stage.stop):.5g}"
        if not branch.points:
            return f"{goal} was not reached, not even the start: {branch.message}"
        reached = stage.shown(branch.points[-1].parameter)
        return f"{goal} was not reached, only {reached:.5g}"

    @property
    def advice(self) -> str:
        """Why a path ends on the way, and what may help."""
        if self.last is not None and self.last.h_min < CLOSED * self.last.h_star:
            return CLOSING.format(1e3 * self.last.h_min)
        return FOLD if self.branch.points else self.branch.status.advice

    def explain(self, where: str, rotation: str) -> tuple[Status, str]:
        """Status and message of a run that ends here."""
        advice = ROLLING if rotation == "free" else self.advice
        return self.branch.status, f"{where}: {self.message}; {advice}"


@dataclass
class _Run:
    """A run in progress: the only thing in this case that changes."""

    section: OringSection
    observer: Observer
    settings: PathSettings
    walker: Walker
    records: list[StageRecord] = field(default_factory=list)
    states: list[FilmState] = field(default_factory=list)
    stopped: list[tuple[Status, str]] = field(default_factory=list)
    prefix: str = ""

    def walk(self, stage: Stage, x: Array) -> Array:
        """Unknowns at the end of a stage; raises _Stopped if it is not reached."""
        stage = replace(stage, name=self.prefix + stage.name)
        branch, record = self.walker.walk(stage, x, self.observer)
        self.records.append(record)
        if not branch.converged:
            raise _Stopped(stage, branch)
        return branch.last.x

    def contact(self) -> Array:
        """First stage, shared by both strokes."""
        p_s = self.section.parameters.sealed_pressure
        x = self._contact_unknowns()
        problem = contact_problem(self.section, self.settings, p_s)
        self.observer.contact_state(contact_state(self.section, problem, p_s, x))
        return x

    def _contact_unknowns(self) -> Array:
        """By way of coarser meshes; on the mesh itself if that is asked for or the ways fail."""
        p = self.section.parameters
        coarser = [d for d in DENSITIES if d < p.density and p.solver == "auto"]
        for coarsest in coarser:
            with suppress(_Stopped):
                return self._refined(coarsest)
        return self._loaded(self.section)

    def _loaded(self, section: OringSection) -> Array:
        """Contact state of a section, from rest."""
        p_s = section.parameters.sealed_pressure
        x = self.walk(squeeze_stage(section, self.settings), section.at_rest())
        return self.walk(load_stage(section, self.settings, p_s), x) if p_s > 0.0 else x

    def _refined(self, coarsest: int) -> Array:
        """Contact state of the section from that of a coarser mesh, density by density."""
        p = self.section.parameters
        section = build_section(p.model_copy(update={"density": coarsest}))
        x = self._loaded(section)
        while section is not self.section:
            coarse, density = section, 2 * section.parameters.density
            last = density == p.density
            section = self.section if last else build_section(finer(coarse.parameters))
            x = self.walk(*refined_contact(coarse, section, self.settings, x))
        return x

    def stroke(self, stroke: Stroke, x: Array) -> None:
        """Second and third stage of one stroke, from the contact state x."""
        section, settings, p = self.section, self.settings, self.section.parameters
        reference = contact_state(
            section, contact_problem(section, settings, p.sealed_pressure), p.sealed_pressure, x
        ).p_max_MPa
        fewest = fewest_inlet_segments(p.reynolds, p.pressure_order)
        judge = _Judge(self, Verdict(reference, fewest=fewest))
        film = self.first_film(stroke, x)
        with suppress(_Stopped):
            if self._fast_films(film, x, judge):
                return
        try:
            start, state = judge.position or self.build_film(film, x)
            slower = [u for u in p.speeds if u < start.speed or judge.position is None]
            self.walk(speed_stage(section, settings, start, slower, judge), state)
        except _Stopped as stop:
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
        return Film(p.sealed_pressure, stroke, speed, multipliers, shear=shear)

    def _fast_films(self, film: Film, x: Array, judge: _Judge) -> bool:
        """Second and third stage by chord iterations; False where these do not apply."""
        section, settings, p = self.section, self.settings, self.section.parameters
        linear = self.walker.newton.linear
        fit = p.solver == "auto" and p.rotation == "fixed"
        if not fit or not isinstance(linear, Condenser):
            return False
        fast = FastFilm.of(section, linear)
        x = self.walk(fast.weight(weight_stage(section, settings, film)), x)
        if p.shear_traction:
            x = self.walk(fast.shear(shear_stage(section, settings, film)), x)
        self.walk(fast.speed(speed_stage(section, settings, film, p.speeds, judge)), x)
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
        prefix = f"order {REFERENCE_ORDER}: "
        other = _Run(pair.high, self.observer, settings, self.walker, self.records, prefix=prefix)
        found: dict[float, tuple[Film, Array]] = {}

        def keep(at: Film, point: Point) -> None:
            if at.speed in missing:
                found[at.speed] = (at, point.solution.x)

        with suppress(_Stopped):
            x = transferred(contact, section, pair.high)
            film, x = other.build_film(other.first_film(film.stroke, x), x)
            other.walk(speed_stage(pair.high, settings, film, missing, keep), x)
        for at, x in found.values():
            with suppress(_Stopped):
                x = pair.low_part(self.walk(pair.stage(settings, at), pair.start(x)))
                solution = self.walker.newton.solve(film_problem(section, settings, at), x)
                if solution.converged:
                    judge(at, Point(1.0, solution))


@dataclass
class _Judge:
    """Looks at every step of falling speed; a requested speed becomes a state."""

    run: _Run
    verdict: Verdict
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
        run.states.append(state)
        run.observer.film_state(state)


def run(
    parameters: ORing,
    observer: Observer,
    settings: PathSettings | None = None,
    walker: Walker | None = None,
) -> Outcome:
    """Solve the O-ring and report to the observer; failure is in the outcome's status."""
    section = build_section(parameters)
    walker = walker or Walker(Newton(max_iterations=10, linear=choose(parameters.linear)))
    progress = _Run(section, observer, settings or PathSettings(), walker)
    strokes: tuple[Stroke, ...] = ("out", "in")
    wanted = strokes if parameters.stroke == "both" else (parameters.stroke,)
    try:
        x = progress.contact()
    except _Stopped as stop:
        progress.stopped.append(stop.explain("contact", parameters.rotation))
        return _outcome(progress)
    for stroke in wanted:
        try:
            progress.stroke(stroke, x)
        except _Stopped as stop:
            progress.stopped.append(stop.explain(f"stroke {stroke}", parameters.rotation))
    return _outcome(progress)


def _outcome(progress: _Run) -> Outcome:
    section, stopped = progress.section, progress.stopped
    blocks = section.problem.assembler.blocks
    return Outcome(
        states=tuple(progress.states),
        status=stopped[0][0] if stopped else Status.CONVERGED,
        message="; ".join(message for _, message in stopped) or "all requested states converged",
        unknowns_total=section.layout.total,
        unknowns_pressure=section.layout.count("pressure"),
        kernel_signatures={b.kernel.name: b.kernel.signature for b in blocks},
        stages=tuple(progress.records),
        solvers={
            "solver": section.parameters.solver,
            "linear": progress.walker.newton.linear.name,
        },
    )
