"""The steady film at a speed: from contact, from another speed, from another mesh.

Each step in time is solved by modified Newton iterations on the Schur complement of the section;
where these fail, by Newton's method for all unknowns, which holds on to the pressures of the
elements (`runtime.fem.lagged_pressure`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.loads import FilmLoads, Stroke
from softehl.cases.seal.solve.correctors import FilmCorrectors
from softehl.cases.seal.solve.inlet import POWER, InletScales
from softehl.cases.seal.solve.path import PathDriver
from softehl.cases.seal.solve.squeeze_film import (
    FIRST,
    SqueezeFilm,
    film_layer,
    film_loads,
    pressed_film,
)
from softehl.cases.seal.states.results import film_numbers
from softehl.cases.seal.states.state import StageRecord, place
from softehl.cases.seal.states.verdict import FilmNumbers
from softehl.runtime.arrays import Array
from softehl.runtime.fem.problem import Problem
from softehl.runtime.solve.homotopy import Continuation
from softehl.runtime.solve.newton import NonlinearProblem
from softehl.runtime.solve.pseudo_transient import Moment, PseudoTransient
from softehl.runtime.solve.solution import Branch, Point, Solution, Status
from softehl.runtime.solve.steps import StepRule

_LEAST = 0.06
"""Least step on the way from the film at another speed, of the larger power of U. Of the smaller
one films that do not go on cost as much again as all of their seal."""

_USUAL = 12
"""Iterations of a step that is not too long: modified ones, two for one of Newton's."""


@dataclass(frozen=True, eq=False)
class Film:
    """A steady film on a mesh, its unknowns x (n,).

    squeeze_film: how it was squeezed out. correctors: what solved it, for films near by.
    """

    squeeze_film: SqueezeFilm
    x: Array
    iterations: int
    correctors: FilmCorrectors

    @property
    def system(self) -> SealSystem:
        """The system whose film it is."""
        return self.squeeze_film.system

    @property
    def loads(self) -> FilmLoads:
        """The loads that it bears."""
        return self.squeeze_film.film

    @property
    def begun(self) -> tuple[SqueezeFilm, Moment]:
        """The moment from which it is squeezed out where it is not found at once."""
        return self.squeeze_film, Moment(self.x, FIRST, 1.0)

    @property
    def solution(self) -> Solution:
        """The film as a point of a path."""
        return Solution(self.x, Status.CONVERGED, "", (), 0, 0)

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

    begun: how it was squeezed out, and how far, where it took a step.
    """

    stroke: Stroke
    speed: float
    status: Status
    message: str
    begun: tuple[SqueezeFilm, Moment] | None = None


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
            words = "too few nodes touch the rod to show the edge of the contact"
            return NoFilm(stroke, speed, Status.DIVERGED, words)
        film = film_loads(self.system, stroke, speed, x)
        layer, moment = film_layer(self.system, x), self.system.moment(x)
        squeeze_film = SqueezeFilm(self.system, layer, film, scales, x, moment)
        pressed = pressed_film(self.system, x, film.sealed_pressure)
        correctors = FilmCorrectors.of(self.system, self.driver.newton)
        return self._followed(squeeze_film, Moment(pressed, squeeze_film.first), correctors)

    def from_neighbour(self, last: Sequence[Film], speed: float) -> Film | NoFilm:
        """The film at |U|, mm/s, along those at speeds between, from the last film on our mesh.

        last: films at other speeds, the latest last.
        """
        film, correctors = last[-1], last[-1].correctors
        squeeze_film, before = film.squeeze_film.at(speed), [film.x]
        known = [Point(f.loads.speed**POWER, f.solution) for f in last if f.system is film.system]
        start, stop = known[-1].parameter, speed**POWER

        def problem_at(t: float) -> NonlinearProblem:
            loads = replace(squeeze_film.film, speed=speed if t == stop else t ** (1.0 / POWER))
            problem = self.system.film_problem(loads).since(before[0])
            return correctors.layered(problem, squeeze_film.layer)

        with self._told(squeeze_film.film) as (told, costs):

            def tell(point: Point) -> None:
                before[0] = told(point.solution).x

            span, least = abs(stop - start), _LEAST * max(start, stop)
            rule = StepRule(span, min(least, span), target_iterations=_USUAL)
            path = Continuation(correctors.first, rule, name="U^0.6")
            previous = known[-2] if len(known) > 1 else None
            branch = path.follow(problem_at, start, stop, film.x, on_point=tell, previous=previous)
            costs.append(branch)
        if branch.converged and squeeze_film.change(film.x, branch.last.x) < inf:
            return self._entered(squeeze_film, correctors, branch.last)
        x = branch.last.x if branch.points else film.x
        return self._followed(squeeze_film, Moment(x, FIRST, 1.0), correctors)

    def from_film(self, carried: SqueezeFilm, start: Moment, pressures: Array) -> Film | NoFilm:
        """The steady film of another mesh, carried to ours: at once, else squeezed out from there.

        pressures: (Q,) of the elements.
        """
        correctors, x = FilmCorrectors.of(self.system, self.driver.newton), start.x
        with self._told(carried.film) as (told, costs):
            problem = self.system.film_problem(carried.film).since(x)
            layered = correctors.layered(problem, carried.layer)
            found = told(correctors.whole(pressures).solve(layered, x))
            costs.append(found)
        if found.converged and carried.change(x, found.x) < inf:
            return self._entered(carried, correctors, found)
        return self._followed(carried, start, correctors, pressures)

    def _followed(
        self,
        squeeze_film: SqueezeFilm,
        start: Moment,
        correctors: FilmCorrectors,
        pressures: Array | None = None,
    ) -> Film | NoFilm:
        film = squeeze_film.film
        steps = PseudoTransient(correctors.steps(pressures))
        with self._told(film) as (told, costs):
            branch, reached = steps.follow(squeeze_film, start, on_point=lambda p: told(p.solution))
            costs.append(branch)
            if not branch.converged:
                words = branch.message
                begun = None if reached is start else (squeeze_film, reached)
                return NoFilm(film.stroke, film.speed, branch.status, words, begun)
            problem = self.system.film_problem(film).since(reached.x)
            end = told(correctors.steady(problem, squeeze_film.layer, reached.x))
            costs.append(end)
        if not end.converged:
            words = f"steady film: {end.message}"
            return NoFilm(film.stroke, film.speed, end.status, words, (squeeze_film, reached))
        return self._entered(squeeze_film, correctors, end)

    def _entered(
        self, squeeze_film: SqueezeFilm, correctors: FilmCorrectors, found: Solution
    ) -> Film:
        """The film, with the pressure of the wedge before its arc where it lacks much of it.

        Without it where no such film is found.
        """
        film = Film(squeeze_film, found.x, found.iterations, correctors)
        if not film.numbers.enters:
            return film
        more = replace(squeeze_film, film=replace(film.loads, entrance=film.numbers.entrance))
        problem = self.system.film_problem(more.film).since(found.x)
        end = correctors.steady(problem, more.layer, found.x)
        return Film(more, end.x, end.iterations, correctors) if end.converged else film

    @contextmanager
    def _told(
        self, film: FilmLoads
    ) -> Iterator[tuple[Callable[[Solution], Solution], list[Branch | Solution]]]:
        """Tell the observer of solutions, and keep a record of them and of what is spent."""
        costs = list[Branch | Solution]()
        name, begin, found = f"film at {film.rod_speed:+g} mm/s", time.perf_counter(), []
        p_s, stroke = film.sealed_pressure, film.stroke
        self.driver.observer.stage(name, sealed_pressure=p_s, stroke=stroke, steps=None)

        def told(solution: Solution) -> Solution:
            found.append(solution.forget())
            self.driver.observer.step(
                label=name,
                parameter=float(len(found)),
                iterations=solution.iterations,
                residuals=solution.residual_norms,
                fraction=None,
            )
            return solution

        try:
            yield told, costs
        finally:
            self.driver.records.append(
                StageRecord(
                    name=name,
                    seconds=time.perf_counter() - begin,
                    factorisations=sum(cost.factorisations for cost in costs),
                    iterations=sum(cost.iterations for cost in costs),
                    residual_histories=tuple(s.residual_norms for s in found),
                    parameters=tuple(float(n) for n in range(1, len(found) + 1)),
                    where=place(p_s, stroke),
                    method="pseudo-transient continuation",
                )
            )
