"""The steady film at a speed: from contact, from another speed, from another mesh.

Each step in time is solved by modified Newton iterations on the Schur complement of the section;
where these fail, by Newton's method for all unknowns, which holds on to the pressures of the
elements (`runtime.fem.lagged_pressure`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.layers import film_layer
from softehl.cases.seal.equations.loads import FilmLoads, Stroke
from softehl.cases.seal.solve.film_correctors import FilmCorrectors
from softehl.cases.seal.solve.inlet import InletScales
from softehl.cases.seal.solve.path import PathDriver
from softehl.cases.seal.solve.squeeze_film import SqueezeFilm, film_loads, pressed_film
from softehl.cases.seal.states.results import film_numbers
from softehl.cases.seal.states.state import StageRecord, place
from softehl.cases.seal.states.verdict import FilmNumbers
from softehl.runtime.arrays import Array
from softehl.runtime.fem.problem import Problem
from softehl.runtime.solve.pseudo_transient import Moment, PseudoTransient
from softehl.runtime.solve.solution import Solution, Status

_NEIGHBOUR = 3e-3
"""First step from the film at another speed, of T. With 0.1 of it most instrokes began with a step
that failed, which costs as much as ten that do not."""


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
    def begun(self) -> tuple[SqueezeFilm, Array]:
        """The squeeze film that it came from, and its unknowns."""
        return self.squeeze_film, self.x

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

    begun: how it was squeezed out, and the state that was reached, where it took a step.
    """

    stroke: Stroke
    speed: float
    status: Status
    message: str
    begun: tuple[SqueezeFilm, Array] | None = None


@dataclass(frozen=True, eq=False)
class FilmSolver:
    """Films on the mesh of a system.

    driver: its Newton's method finishes what the modified iterations do not, and holds the linear
    solver; its records of the cost of each film grow.
    """

    system: SealSystem
    driver: PathDriver

    def on(self, system: SealSystem) -> FilmSolver:
        """This solver on the mesh of another system."""
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

    def from_neighbour(self, film: Film, speed: float) -> Film | NoFilm:
        """The film at |U|, mm/s, from one at another speed: at once, else squeezed out from it."""
        squeeze_film, correctors = film.squeeze_film.at(speed), film.correctors
        with self._told(squeeze_film.film) as told:
            problem = self.system.film_problem(squeeze_film.film).since(film.x)
            layered = correctors.layered(problem, squeeze_film.layer)
            found = told(correctors.first.solve(layered, film.x))
        if found.converged and squeeze_film.change(film.x, found.x) < inf:
            return self._entered(squeeze_film, correctors, found)
        return self._followed(squeeze_film, Moment(film.x, _NEIGHBOUR, 1.0), correctors)

    def from_film(self, carried: SqueezeFilm, x: Array, pressures: Array) -> Film | NoFilm:
        """The steady film of another mesh, carried to ours, x (n,), where it is found at once.

        pressures: (Q,) of the elements. With them one iteration for all unknowns brings the section
        near to equilibrium.
        """
        film, correctors = carried.film, FilmCorrectors.of(self.system, self.driver.newton)
        with self._told(film) as told:
            problem = self.system.film_problem(film).since(x)
            begun = correctors.whole.steady(problem, x, pressures, iterations=1)
            layered = correctors.layered(problem, carried.layer)
            found = told(correctors.first.solve(layered, begun.nearest))
        if found.converged and carried.change(x, found.x) < inf:
            return self._entered(carried, correctors, found)
        return NoFilm(film.stroke, film.speed, found.status, f"carried film: {found.message}")

    def _followed(
        self,
        squeeze_film: SqueezeFilm,
        start: Moment,
        correctors: FilmCorrectors,
    ) -> Film | NoFilm:
        film = squeeze_film.film
        steps = PseudoTransient(correctors.steps)
        with self._told(film) as told:
            branch, reached = steps.follow(squeeze_film, start, on_point=lambda p: told(p.solution))
            if not branch.converged:
                words = branch.message
                begun = None if reached is start else (squeeze_film, reached.x)
                return NoFilm(film.stroke, film.speed, branch.status, words, begun)
            problem = self.system.film_problem(film).since(reached.x)
            end = told(correctors.steady(problem, squeeze_film.layer, reached.x))
        if not end.converged:
            words = f"steady film: {end.message}"
            return NoFilm(film.stroke, film.speed, end.status, words, (squeeze_film, reached.x))
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
    def _told(self, film: FilmLoads) -> Iterator[Callable[[Solution], Solution]]:
        """Tell the observer of solutions, and keep a record of them."""
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
            yield told
        finally:
            self.driver.records.append(
                StageRecord(
                    name=name,
                    seconds=time.perf_counter() - begin,
                    factorisations=sum(s.factorisations for s in found),
                    iterations=sum(s.iterations for s in found),
                    residual_histories=tuple(s.residual_norms for s in found),
                    parameters=tuple(float(n) for n in range(1, len(found) + 1)),
                    where=place(p_s, stroke),
                    method="pseudo-transient continuation",
                )
            )
