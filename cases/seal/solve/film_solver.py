"""Film solver: the steady film at a speed, from contact, another speed or another mesh.

The film is squeezed out (`solve.squeeze_film`) in steps that are solved by `solve.correctors`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import exp, inf, log

from softehl.cases.seal.equations.film_heat import changed_film
from softehl.cases.seal.equations.loads import FilmLoads, Stroke
from softehl.cases.seal.equations.system import SealSystem
from softehl.cases.seal.solve.correctors import HARD, FilmCorrectors
from softehl.cases.seal.solve.inlet import POWER, InletScales
from softehl.cases.seal.solve.load_stages import LoadStageLog, PathDriver
from softehl.cases.seal.solve.squeeze_film import (
    FIRST,
    SqueezeFilm,
    film_layer,
    film_loads,
    pressed_film,
)
from softehl.cases.seal.states.results import film_numbers
from softehl.cases.seal.states.verdict import FilmNumbers
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.solve.continuation import Continuation, StepRule
from softehl.runtime.solve.newton import NonlinearProblem
from softehl.runtime.solve.pseudo_transient import PseudoTransient, TransientState
from softehl.runtime.solve.solution import Point, Solution, Status

_LEAST = 0.06
"""Least step on the way from the film at another speed, of the larger power of U. Of the smaller
one films that do not go on cost as much again as all of their seal."""

WARM = 1e-4
"""Relative change of h* by its heat that is not solved for."""

_WARMINGS, _STEP = 12, 0.3
"""Solutions with another viscosity at most, and its largest change in one of them, of ln eta."""


PATIENCE, SHORTER = (6, 40), 0.5
"""Failed steps, in a row and in all, and change of a step, above HARD."""


@dataclass(frozen=True, eq=False)
class Film:
    """A steady film on a mesh.

    squeeze_film: how it was squeezed out. correctors: what solved it, for films near by.
    """

    squeeze_film: SqueezeFilm
    solution: Solution
    correctors: FilmCorrectors

    @property
    def x(self) -> Array:
        """Its unknowns (n,)."""
        return self.solution.x

    @property
    def system(self) -> SealSystem:
        """The system whose film it is."""
        return self.squeeze_film.system

    @property
    def loads(self) -> FilmLoads:
        """The loads that it bears."""
        return self.squeeze_film.film

    @property
    def start_state(self) -> tuple[SqueezeFilm, TransientState]:
        """The moment from which it is squeezed out where it is not found at once."""
        return self.squeeze_film, TransientState(self.x, FIRST, 1.0)

    @cached_property
    def problem(self) -> Problem:
        """The equations that it fulfils."""
        return self.system.film_problem(self.loads).since(self.x)

    @cached_property
    def numbers(self) -> FilmNumbers:
        """Its scalars."""
        return film_numbers(self.system, self.problem, self.loads, self.x)


@dataclass(frozen=True, eq=False)
class NoFilm:
    """Why there is no film at a speed.

    start_state: how it was squeezed out, and how far, where it took a step.
    """

    stroke: Stroke
    speed: float
    status: Status
    message: str
    start_state: tuple[SqueezeFilm, TransientState] | None = None


@dataclass(frozen=True, eq=False)
class FilmSolver:
    """Films on the mesh of a system.

    driver: its Newton's method finishes what the modified iterations do not, and holds the linear
    solver; its records of the cost of each film grow.
    """

    system: SealSystem
    driver: PathDriver

    def on(self, system: SealSystem) -> FilmSolver:
        """The solver on the mesh of another system."""
        return replace(self, system=system)

    def from_contact(self, stroke: Stroke, speed: float, x: Array) -> Film | NoFilm:
        """The film at |U|, mm/s, squeezed out from the contact state x (n,)."""
        scales = InletScales.of(self.system, stroke, speed, x)
        if scales is None:
            message = "too few nodes touch the rod to show the edge of the contact"
            return NoFilm(stroke, speed, Status.DIVERGED, message)
        film = film_loads(self.system, stroke, speed, x)
        layer, moment = film_layer(self.system, x), self.system.moment(x)
        squeeze_film = SqueezeFilm(self.system, layer, film, scales, x, moment)
        pressed = pressed_film(self.system, x, film.sealed_pressure)
        correctors = FilmCorrectors.of(self.system, self.driver.newton)
        return self._followed(squeeze_film, TransientState(pressed, squeeze_film.first), correctors)

    def from_neighbour(self, last: Sequence[Film], speed: float) -> Film | NoFilm:
        """The film at |U|, mm/s, along those at speeds between, from the last film on our mesh.

        last: films at other speeds, the latest last.
        """
        film, correctors = last[-1], last[-1].correctors
        squeeze_film, last_film = film.squeeze_film.at(speed), [film.x]
        points = [Point(f.loads.speed**POWER, f.solution) for f in last if f.system is film.system]
        start, stop = points[-1].parameter, speed**POWER
        log = self._log(squeeze_film)

        def problem_at(t: float) -> NonlinearProblem:
            now = speed if t == stop else t ** (1.0 / POWER)
            loads = replace(squeeze_film.film, speed=now)
            return replace(squeeze_film, film=loads).steady(last_film[0])

        def tell(point: Point) -> None:
            log.step(point.solution)
            last_film[0] = point.solution.x

        span, minimum = abs(stop - start), _LEAST * max(start, stop)
        usual = 2 * StepRule.target_iterations  # modified ones, two for one of Newton's
        rule = StepRule(span, min(minimum, span), target_iterations=usual)
        path = Continuation(correctors.first, rule, name="U^0.6")
        previous = points[-2] if len(points) > 1 else None
        branch = path.follow(problem_at, start, stop, film.x, on_point=tell, previous=previous)
        log.end(branch)
        x = branch.last.x if branch.points else film.x
        return self._reached(squeeze_film, branch.end, TransientState(x, FIRST, 1.0), correctors)

    def from_film(
        self, carried: SqueezeFilm, start: TransientState, pressures: Array
    ) -> Film | NoFilm:
        """The steady film of another mesh, carried to ours: at once, else squeezed out from there.

        pressures: (Q,) of the elements.
        """
        correctors = FilmCorrectors.of(self.system, self.driver.newton)
        log = self._log(carried)
        result = correctors.monolithic(pressures).solve(carried.steady(start.x), start.x)
        log.step(result)
        log.end(result)
        return self._reached(carried, result, start, correctors, pressures)

    def _reached(
        self,
        squeeze_film: SqueezeFilm,
        result: Solution,
        start: TransientState,
        correctors: FilmCorrectors,
        pressures: Array | None = None,
    ) -> Film | NoFilm:
        """The film that was found, if there is one and it is admissible; else see `_followed`."""
        if result.converged and squeeze_film.change(start.x, result.x) < inf:
            return self._entered(squeeze_film, correctors, result)
        return self._followed(squeeze_film, start, correctors, pressures)

    def _followed(
        self,
        squeeze_film: SqueezeFilm,
        start: TransientState,
        correctors: FilmCorrectors,
        pressures: Array | None = None,
    ) -> Film | NoFilm:
        """The film squeezed out from a moment; pressures: as of `from_film`."""
        film, log = squeeze_film.film, self._log(squeeze_film)
        steps = PseudoTransient(correctors.steps(pressures))
        p = self.system.parameters
        if p.load_ratio(p.sealed_pressure) > HARD:
            steps = replace(steps, failures=PATIENCE, target_change=SHORTER)
        branch, reached = steps.follow(
            squeeze_film,
            start,
            on_point=lambda point: log.step(point.solution),
            finish=lambda x: correctors.steady().solve(squeeze_film.steady(x), x),
        )
        log.end(branch)
        if branch.converged:
            return self._entered(squeeze_film, correctors, branch.last)
        start_state = None if reached is start else (squeeze_film, reached)
        return NoFilm(film.stroke, film.speed, branch.status, branch.message, start_state)

    def _entered(
        self, squeeze_film: SqueezeFilm, correctors: FilmCorrectors, result: Solution
    ) -> Film | NoFilm:
        """The film, with the pressure of the wedge before its arc where it lacks much of it.

        Without it where no such film is found. Then it is warmed by its friction.
        """
        film = Film(squeeze_film, result, correctors)
        if not film.numbers.enters:
            return self._warmed(film)
        more = replace(squeeze_film, film=replace(film.loads, entrance=film.numbers.entrance))
        end = correctors.steady().solve(more.steady(film.x), film.x)
        return self._warmed(Film(more, end, correctors) if end.converged else film)

    def _warmed(self, film: Film) -> Film | NoFilm:
        """The film with the viscosity of its warm inlet, solved until h* does not change."""
        before: tuple[float, float] | None = None
        for _ in range(_WARMINGS):
            heat, used = film.numbers.heat, film.loads.viscosity_ratio
            if heat is None or changed_film(heat.viscosity_ratio, used) < WARM:
                return film
            at, change = log(used), log(heat.viscosity_ratio / used)
            slope = 0.0 if before is None else (change - before[1]) / (at - before[0]) + 1.0
            before = at, change
            step = change / (1.0 - min(slope, 0.0))
            ratio = exp(at + min(max(step, -_STEP), _STEP))
            loads = replace(film.loads, viscosity_ratio=ratio)
            warm = replace(film.squeeze_film, film=loads)
            end = film.correctors.steady().solve(warm.steady(film.x), film.x)
            if not end.converged:
                break
            film = Film(warm, end, film.correctors)
        message = "the film that its friction warms was not found; leave heating out"
        return NoFilm(film.loads.stroke, film.loads.speed, Status.MAX_ITERATIONS, message)

    def _log(self, squeeze_film: SqueezeFilm) -> LoadStageLog:
        """A stage on the way to a film."""
        film, method = squeeze_film.film, "pseudo-transient continuation"
        name = f"film at {film.rod_speed:+g} mm/s"
        return LoadStageLog(self.driver, name, film.sealed_pressure, film.stroke, method)
