"""The films of a stroke on one mesh: each is judged, and reported or held for a better one.

What changes along a stroke on a mesh is a `StrokeState`, what is left of it for other meshes a
`cases.seal.solve.wanted.Wanted`; everything else is frozen.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TypeAlias

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.loads import FilmLoads, Stroke
from softehl.cases.seal.sensitivity.sensitivity import rates_of, sensitivities
from softehl.cases.seal.solve.film_path import BuiltFilm, FilmPath, OnSpeed, below
from softehl.cases.seal.solve.film_transfer import (
    FilmTransfer,
    FoundFilms,
    film_on_coarser,
    film_on_finer,
    films_of,
)
from softehl.cases.seal.solve.judging import errors, verdict_of_contact
from softehl.cases.seal.solve.order import REFERENCE_ORDER, OrderPair, transferred
from softehl.cases.seal.solve.path import StageFailed
from softehl.cases.seal.solve.rough_path import RoughPath
from softehl.cases.seal.solve.stroke_start import StrokeStart, emptied
from softehl.cases.seal.solve.wanted import Found, Wanted
from softehl.cases.seal.states.estimate import (
    coarser_density,
    finer_density,
    reservation,
)
from softehl.cases.seal.states.results import film_numbers, film_state
from softehl.cases.seal.states.sensitivity_table import resolved
from softehl.cases.seal.states.state import COLLAPSED, UNDER_RESOLVED, FilmState
from softehl.cases.seal.states.verdict import (
    FilmNumbers,
    Verdict,
)
from softehl.runtime.arrays import Array
from softehl.runtime.fem.design import Inputs
from softehl.runtime.solve.linear import SingularMatrix
from softehl.runtime.solve.solution import Point

MESHES = 2
"""How many meshes may be made for the films of a stroke on a section that is not round, one after
the other, where they are not `ok` on the one before."""


@dataclass
class StrokeState:
    """What changes along a stroke on a mesh.

    first: the verdict before any film; verdict: on those so far. slowest: the slowest film that was
    solved, and its unknowns. missing: speeds that are wanted and were not reached yet. films: by
    |U|, unknowns (n,) of those that were. unsound: whether one is not resolved, or has collapsed.
    """

    first: Verdict
    verdict: Verdict
    missing: set[float]
    films: dict[float, Array] = field(default_factory=dict)
    slowest: BuiltFilm | None = None
    unsound: bool = False

    def again(self, left: Iterable[float]) -> None:
        """Nothing is known of these speeds: other films than those that were found are wanted."""
        self.verdict, self.missing, self.slowest, self.films = self.first, set(left), None, {}


@dataclass(frozen=True, eq=False)
class SealRun:
    """A system whose contact state x is known, with what is needed for its films.

    coarser: the films of a coarser mesh, which are no results, and its contact state. finer: of a
    finer one, where an estimate is worth its time, None where there is none. better: the run on a
    mesh that is made for a film, None where there is none. meshes: how many such meshes
    may follow. cornered: the same on a mesh for a stroke of what lies in a corner, None where there
    is none. empty: the same without pressure in the groove, for an instroke. rates: of the inputs
    of the film by each parameter, once they were asked for.
    """

    path: FilmPath
    x: Array
    coarser: OtherMesh | None = None
    finer: Callable[[], OtherMesh | None] | None = None
    better: Better | None = None
    meshes: int = 0
    cornered: Cornered | None = None
    empty: SealRun | None = None
    rates: dict[str, Inputs] = field(default_factory=dict)

    @property
    def system(self) -> SealSystem:
        """The system that is solved."""
        return self.path.system

    def on_meshes(self, stroke: Stroke, wanted: Wanted) -> tuple[StageFailed | None, SealRun]:
        """A stroke, and once more what is not `ok` on a mesh that is made for its film.

        With the run on the last of these meshes: it is also the better one for the other stroke.
        """
        if self.cornered:
            return self._in_corner(stroke, wanted, self.cornered), self
        seal = self._ready(stroke)
        failed = seal.either(stroke, wanted)
        while seal.better and seal.meshes and wanted.left and wanted.last:
            seal = (seal.better(seal, wanted.last) or replace(seal, meshes=0))._ready(stroke)
            failed = seal.either(stroke, wanted)
        wanted.close()
        return failed if wanted.left else None, replace(seal, meshes=self.meshes, empty=None)

    def _in_corner(self, stroke: Stroke, wanted: Wanted, cornered: Cornered) -> StageFailed | None:
        """A stroke; what is not `ok` once more on a mesh for what its shear stress moves."""
        wanted.compared = True
        failed = replace(self._hasty(), cornered=None).stroke(stroke, wanted)
        wanted.compare_with_finer()
        if wanted.left:
            other = cornered(self, stroke) or self
            failed = replace(other, cornered=None).stroke(stroke, wanted)
        wanted.close()
        return failed if wanted.left else None

    def _hasty(self) -> SealRun:
        """Without what Newton's method may do in a corner."""
        coarser = self.coarser and (replace(self.coarser[0], laboriously=False), self.coarser[1])
        return replace(self, path=replace(self.path, laboriously=False), coarser=coarser)

    def either(self, stroke: Stroke, wanted: Wanted) -> StageFailed | None:
        """A stroke: an instroke first without pressure in the groove between two lobes.

        The rod draws the oil out of it, or fills it as the film is squeezed out.
        """
        if self.empty:
            failed = replace(self.empty, meshes=self.meshes).stroke(stroke, wanted)
            if not wanted.left or wanted.last:
                return failed
        return self.stroke(stroke, wanted)

    def _ready(self, stroke: Stroke) -> SealRun:
        """With its empty groove, if the stroke needs one and it is not known from another mesh."""
        if stroke == "out" or self.empty:
            return self
        found = emptied(self.path, self.x)
        return self.emptied(*found) if found else self

    def emptied(self, path: FilmPath, x: Array) -> SealRun:
        """With the contact state x (n,) of an empty groove."""
        coarser = emptied(*self.coarser) if self.coarser else None
        return replace(self, empty=replace(self, path=path, x=x, coarser=coarser))

    def stroke(self, stroke: Stroke, wanted: Wanted) -> StageFailed | None:
        """Second and third stage of one stroke; why it ended early, if it did."""
        p, path = self.system.parameters, self.path
        known = films_of(*self.coarser, stroke, self.system) if self.coarser else None
        coarser = wanted.begin(known.numbers if known else {})
        verdict = verdict_of_contact(self.system, self.x)
        progress = StrokeState(verdict, verdict, set(wanted.left))

        def on_speed(film: FilmLoads, point: Point) -> None:
            self._judge(wanted, progress, coarser, film, point)

        if p.rough:
            return RoughPath(path).risen(stroke, self.x, on_speed)
        if known:
            FilmTransfer(path, stroke, self.x, known).in_turn(on_speed)
        if wanted.compared and progress.unsound:
            progress.again(wanted.left)  # what is carried may lead to another film than the path
        if progress.slowest and progress.missing:
            path.onward(*progress.slowest, below(p.speeds, progress.slowest[0].speed), on_speed)
        start = StrokeStart(path, stroke, self.x).begun(on_speed) if progress.missing else None
        if start is None or (self.meshes and progress.slowest):
            return None
        made_for_film = self.better and self.meshes < MESHES and progress.slowest is None
        if made_for_film or not path.laboriously:
            return path.without_film(*start)
        built = progress.slowest or path.build(*start)
        left = p.speeds if progress.slowest is None else below(p.speeds, progress.slowest[0].speed)
        failed = path.slower(built, left, on_speed)
        if failed is None:
            return path.faster_missed(start[0], progress.missing) if progress.missing else None
        last = progress.verdict.last
        self._from_higher_order(stroke, progress, on_speed)
        return replace(failed, last=last) if progress.missing else None

    def _judge(
        self,
        wanted: Wanted,
        progress: StrokeState,
        coarser: dict[float, FilmNumbers],
        film: FilmLoads,
        point: Point,
    ) -> None:
        """Look at a film of falling speed; one at a requested speed becomes a state.

        One that is faster than the slowest known belongs to another path, and is judged alone.
        """
        system, x = self.system, point.solution.x
        known = None if system.parameters.rough else progress.slowest
        slowest = known is None or film.speed < known[0].speed
        if not (slowest or film.speed in progress.missing):
            return
        last = film_numbers(system, system.film_problem(film), film, x)
        verdict = progress.verdict.after(last) if slowest else progress.first.after(last)
        if slowest:
            progress.slowest = wanted.last = film, x
            progress.verdict = verdict
        if film.speed in system.parameters.speeds:
            progress.films[film.speed] = x
        if film.speed not in progress.missing:
            return
        progress.missing.discard(film.speed)
        here = FoundFilms(system, self.x, dict(progress.films))
        progress.unsound |= verdict.word in (UNDER_RESOLVED, COLLAPSED)
        iterations = point.solution.iterations
        film, x, last = self.path.entered(film, x, last)
        p, problem = system.parameters, system.film_problem(film)
        if self.coarser and film.speed not in coarser:
            other = film_on_coarser(*self.coarser, film, here)
            coarser |= {film.speed: other} if other else {}
        wants_error = p.error_estimate and p.mesh == "graded"

        def judged(other: FilmNumbers | None, *, finer: bool = False) -> FilmState:
            at = finer_density(p.density) if finer else coarser_density(p.density)
            error, friction = errors(p.density, last, other, at)
            told = replace(verdict, last=last, error=error if wants_error else None)
            state = replace(
                film_state(system, problem, film, x, told, iterations),
                h_star_error_percent=error,
                rod_friction_error_percent=friction,
                reservation=reservation(p, last, other, at),
            )
            if p.sensitivity and resolved(state.settled) and not film.entrance:
                state = replace(state, sensitivity=self._differentiated(film, x))
            return state

        def of_finer() -> FilmNumbers | None:
            mesh = self.finer() if self.finer else None
            return film_on_finer(*mesh, film, here) if mesh else None

        found = Found(judged, of_finer)
        wanted.found(film.speed, found, final=self.better is None)

    def _differentiated(
        self, film: FilmLoads, x: Array
    ) -> Mapping[str, Mapping[str, float]] | None:
        """Sensitivities of a film x (n,); none where its tangent has no usable factors."""
        self.rates.update(rates_of(self.system, film, self.rates))
        try:
            linear = self.path.driver.newton.linear
            return sensitivities(self.system, film, x, linear, self.rates)
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

        start = next(StrokeStart(high, stroke, transferred(self.x, low, pair.high)).starts())
        high.slower(high.build(*start), missing, keep)
        for at, x in found.values():
            both = driver.follow(pair.stage(self.path.settings, at), pair.start(x))
            if isinstance(both, StageFailed):
                continue
            solution = driver.newton.solve(low.film_problem(at), pair.low_part(both))
            if solution.converged:
                on_speed(at, Point(1.0, solution))


OtherMesh: TypeAlias = tuple[FilmPath, Array]
"""Films of another mesh, and its contact state (n,)."""

Better: TypeAlias = Callable[[SealRun, BuiltFilm], SealRun | None]
Cornered: TypeAlias = Callable[[SealRun, Stroke], SealRun | None]
