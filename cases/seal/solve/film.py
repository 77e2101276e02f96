"""Film stages of the path: the film takes over from the contact, then the speed falls.

The film starts at high speed and without shear, where its equations are mild. At a fixed sealed
pressure the section moves by micrometres from state to state, so that a modified Newton method
serves: it factorises the section a few times for a whole curve and treats the film, the rod that
fades out below it and the sealed pressure on the arc exactly.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csc_array

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.layers import film_layer
from softehl.cases.seal.equations.loads import FilmLoads, Stroke
from softehl.cases.seal.gland.parameters import ORing
from softehl.cases.seal.solve.coarser_films import CoarserFilms
from softehl.cases.seal.solve.contact import held_moment, stalls
from softehl.cases.seal.solve.film_correctors import film_corrector
from softehl.cases.seal.solve.grading import film_thickness
from softehl.cases.seal.solve.path import PathSettings, Stage
from softehl.cases.seal.solve.squeezing import film_loads
from softehl.cases.seal.states.contacts import contact_edges
from softehl.runtime.arrays import Array
from softehl.runtime.fem.layered import Layer, Layered
from softehl.runtime.fem.problem import Problem
from softehl.runtime.fem.relaxed import Relaxed
from softehl.runtime.solve.linear import Condenser
from softehl.runtime.solve.schur import SchurCorrector
from softehl.runtime.solve.solution import Point
from softehl.runtime.solve.steps import StepRule

METHOD = "modified Newton on the Schur complement of the section"

_LOOSE = 1e-3  # between contact and film, whose states are not results
_FIRM = 1e-6  # of the state from which speeds fall: a section is condensed there that is at rest
_STALE = 0.1  # a condensation costs about three iterations, and many films follow each other
_WEIGHT_STEPS = StepRule(0.04, 0.005, growth=2.5, target_iterations=8)
_SHEAR_STEPS = StepRule(1.0, 0.005, target_iterations=8)
_FROM_SPEED_TO_SPEED = StepRule(1e3, 1e3)
_SPEED_STEPS = StepRule(math.log(2.0), 0.004, math.log(2.0) + 1e-9, target_iterations=30)


FILMS_OFF = (5.0, 2.5, 10.0)
"""Where a film is built up the rod is so many of `film_thickness` off, one after the other: a film
of p_s = 0 needs three h*, below which pressures rise without bound; others come sooner from one or
two, or from more."""

GROOVED_OFF = (2.5, 1.5, 5.0, 10.0)
"""The same of a section with a groove between two lobes: the farther the rod is off, the more oil
is left in the groove when the film is squeezed out, which takes long and may stay there."""


def film_offsets(
    system: SealSystem, settings: PathSettings, stroke: Stroke, x: Array
) -> tuple[float, ...]:
    """Where the rod may be (mm) when the film of a stroke is built up from the contact state x.

    Where it is, without edges, on the arc of the paper's scheme, and where the section rubs on its
    groove: its place depends on the way.
    """
    p, edges = system.parameters, contact_edges(system, x)
    if stays(p) or not edges:
        return (settings.offset,)
    h = film_thickness(p, [edges[0 if stroke == "out" else -1]], start_speed(system, settings))
    return tuple(films * h for films in (GROOVED_OFF if p.lobes > 1 else FILMS_OFF))


def start_speed(system: SealSystem, settings: PathSettings) -> float:
    """|U| (mm/s) at which shear stress begins to act, and from which it falls."""
    p = system.parameters
    least = settings.start_speed if stays(p) else settings.placed_start_speed
    return max(least, *p.speeds)


def stays(p: ORing) -> bool:
    """Whether the rod stays where the contact stage holds it."""
    return p.given_arc is not None or p.rubs


def film_on(system: SealSystem, stroke: Stroke, x: Array, speed: float) -> FilmLoads:
    """A film without shear on the contact state x, under its rod forces, held as this is."""
    film = film_loads(system, stroke, speed, x, rod_offset=0.0)
    return replace(film, shear=0.0, moment=held_moment(system.parameters))


def first_film(system: SealSystem, settings: PathSettings, stroke: Stroke, x: Array) -> FilmLoads:
    """The film at its highest speed, under the rod forces of the contact state x."""
    film = film_on(system, stroke, x, start_speed(system, settings))
    shear = 1.0 if system.parameters.shear_traction else 0.0
    return replace(film, shear=shear, rod_offset=settings.offset)


def weight_stage(system: SealSystem, settings: PathSettings, film: FilmLoads) -> Stage:
    """Second stage: the film takes over from the contact at film.speed, without shear."""
    return Stage(
        name="contact to film",
        problem_at=lambda w: system.film_problem(replace(film, weight=w, shear=0.0)),
        start=0.0,
        stop=1.0,
        steps=settings.weight_steps,
        sealed_pressure=film.sealed_pressure,
        stroke=film.stroke,
    )


def release_stage(system: SealSystem, settings: PathSettings, film: FilmLoads, x: Array) -> Stage:
    """Second stage, rotation = "free": the moment that held the section fades, without shear."""
    held = system.moment(x)
    return Stage(
        name="release",
        problem_at=lambda s: system.film_problem(replace(film, shear=0.0, moment=(1.0 - s) * held)),
        start=0.0,
        stop=1.0,
        steps=settings.release_steps,
        sealed_pressure=film.sealed_pressure,
        stroke=film.stroke,
    )


def shear_stage(system: SealSystem, settings: PathSettings, film: FilmLoads) -> Stage:
    """Second stage, continued: the shear stress of the film begins to act on the section."""
    return Stage(
        name="shear",
        problem_at=lambda s: system.film_problem(replace(film, shear=s)),
        start=0.0,
        stop=1.0,
        steps=settings.shear_steps,
        sealed_pressure=film.sealed_pressure,
        stroke=film.stroke,
    )


def speed_stage(
    system: SealSystem,
    settings: PathSettings,
    film: FilmLoads,
    speeds: Sequence[float],
    on_speed: Callable[[FilmLoads, Point], None],
) -> Stage:
    """Third stage: |U| falls from film.speed through `speeds` (none above it).

    The path parameter is log |U|, in which the film thickness is nearly straight. on_speed is
    told every step; the speeds it is given are exactly those that were asked for.
    """
    exact = {math.log(u): u for u in (*speeds, film.speed)}

    def at(parameter: float) -> FilmLoads:
        return replace(film, speed=exact.get(parameter, math.exp(parameter)))

    return Stage(
        name="falling speed",
        problem_at=lambda t: system.film_problem(at(t)),
        start=math.log(film.speed),
        stop=math.log(min(speeds)),
        steps=settings.speed_steps,
        sealed_pressure=film.sealed_pressure,
        stroke=film.stroke,
        waypoints=tuple(math.log(u) for u in speeds),
        on_point=lambda point: on_speed(at(point.parameter), point),
        shown=lambda t: at(t).rod_speed,
    )


@dataclass(frozen=True, eq=False)
class FastFilm:
    """Turns film stages into ones that a modified Newton method solves."""

    system: SealSystem
    layer: Layer
    corrector: SchurCorrector

    @classmethod
    def of(cls, system: SealSystem, linear: Condenser, x: Array) -> FastFilm:
        """For a stroke begun at x (n,); factors of the section are kept from stage to stage."""
        corrector = replace(film_corrector(system.parameters, linear), stalled=stalls(system))
        return cls(system, film_layer(system, x), corrector)

    def weight(self, stage: Stage) -> Stage:
        """The stage from contact to film, to a loose tolerance: its states are not results."""
        return self._stage(stage, self.corrector.with_tolerance(_LOOSE), _WEIGHT_STEPS)

    def thinning(
        self, stage: Stage, hold: csc_array[np.float64], x: Array, rate: Callable[[float], float]
    ) -> Stage:
        """The stage held near x (n,) by a linear term (n, n), times a rate by the parameter."""
        held = self._stage(stage, self.corrector.with_tolerance(_LOOSE), stage.steps)

        def problem_at(parameter: float) -> Layered:
            layered = held.problem_at(parameter)
            assert isinstance(layered, Layered)
            parts = layered.problem, layered.layer, layered.guards
            return Relaxed(*parts, hold=hold, state=x, rate=rate(parameter))

        return replace(held, problem_at=problem_at)

    def shear(self, stage: Stage) -> Stage:
        """The stage in which the shear stress begins to act, to a smaller tolerance."""
        return self._stage(stage, self.corrector.with_tolerance(_FIRM), _SHEAR_STEPS)

    def speed(self, stage: Stage) -> Stage:
        """The stage of falling speed, to the full tolerance."""
        return replace(self._stage(stage, self.corrector, _SPEED_STEPS), predictor="parabola")

    def slower(self, stage: Stage) -> Stage:
        """The same on the way to a slower film, to the tolerance of shear."""
        return replace(self.speed(stage), corrector=self.corrector.with_tolerance(_FIRM))

    def carried(
        self, stage: Stage, known: CoarserFilms, before: float | None, x: Array
    ) -> tuple[Stage, Array]:
        """The stage of falling speed with the changes that another mesh has seen, and its start.

        x: (n,) the film at the speed before, None: the contact state. The stage ends where these
        do not lead on.
        """

        def guess(here: Point, parameter: float) -> Array:
            return known.next(*(abs(stage.shown(t)) for t in (here.parameter, parameter)))

        start = x + known.change(before, abs(stage.shown(stage.start)))
        stage = replace(self.speed(stage), predictor=guess, steps=_FROM_SPEED_TO_SPEED)
        return stage, start

    def rising(self, stage: Stage) -> Stage:
        """The stage of rising speed of a rough film, to the full tolerance, with its own steps."""
        rising = self._stage(stage, self.eager, stage.steps)
        return replace(rising, predictor="parabola")

    @property
    def eager(self) -> SchurCorrector:
        """The corrector of rough films and of films in time, which condenses sooner."""
        return replace(self.corrector, stale=_STALE)

    def _stage(self, stage: Stage, corrector: SchurCorrector, steps: StepRule) -> Stage:
        guards = (self.system.film_guard(),)

        def problem_at(parameter: float) -> Layered:
            problem = stage.problem_at(parameter)
            assert isinstance(problem, Problem)
            return Layered(problem, self.layer, guards)

        return replace(
            stage, problem_at=problem_at, steps=steps, corrector=corrector, method=METHOD
        )
