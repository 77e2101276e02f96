"""Films of a stroke on one mesh from those of another one, coarser or finer.

Films of a coarser mesh are quick starts, and those of both say how wrong ours are. A finer mesh has
what a coarser one has not, and takes longer; it is asked last.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.loads import FilmLoads, Stroke
from softehl.cases.seal.solve.coarser_films import CoarserFilms
from softehl.cases.seal.solve.contact import lies_in_corner
from softehl.cases.seal.solve.film import first_film, speed_stage
from softehl.cases.seal.solve.film_path import FilmPath, OnSpeed
from softehl.cases.seal.solve.path import StageFailed
from softehl.cases.seal.solve.stroke_start import StrokeStart
from softehl.cases.seal.states.results import film_numbers
from softehl.cases.seal.states.verdict import FilmNumbers
from softehl.runtime.arrays import Array
from softehl.runtime.solve.solution import Point


@dataclass(frozen=True, eq=False)
class FilmTransfer:
    """Films of another mesh, on their way to that of a path.

    x: contact state (n,) of the path's mesh. known: the films of the other one.
    """

    path: FilmPath
    stroke: Stroke
    x: Array
    known: CoarserFilms

    def in_turn(self, on_speed: OnSpeed) -> StageFailed | None:
        """All films, as far as they lead from one to the next.

        By modified Newton iterations, and where these fail with pressures of the section that lag;
        patiently if there is no film yet from which the speed may fall.
        """
        path = self.path
        left = tuple(sorted(self.known.films, reverse=True))
        reached: list[tuple[float | None, Array]] = [(None, self.x)]

        def keep(at: FilmLoads, point: Point) -> None:
            reached.append((at.speed, point.solution.x))
            on_speed(at, point)

        film = self._film(left[0]) if path.quick and left else None
        while film and left and (fast := path.modified(reached[-1][1])):
            here = replace(film, speed=left[0])
            stage = speed_stage(path.system, path.settings, here, left, keep)
            path.driver.follow(*fast.carried(stage, self.known, *reached[-1]))
            left = tuple(u for u in left if reached[-1][0] is None or u < reached[-1][0])
            if left:
                slower = replace(film, speed=left[0])
                failed = self._lagged(slower, reached[-1], keep)
                if failed and reached[-1][0] is None and lies_in_corner(path.system):
                    failed = self._lagged(slower, reached[-1], keep, patiently=True)
                if failed:
                    return failed
                left = left[1:]
        return None

    def at_once(self, speed: float, on_speed: OnSpeed, *, patiently: bool = False) -> None:
        """The film at a speed from the contact state, if it is found; see `CoarserFilms.lagged`."""
        self._lagged(self._film(speed), (None, self.x), on_speed, patiently=patiently)

    def by_faster(self, speed: float, on_speed: OnSpeed) -> None:
        """The film at a speed by way of the next faster one that is known, if it is found."""
        faster = [u for u in self.known.films if u > speed]
        found = list[tuple[FilmLoads, Array]]()

        def keep(at: FilmLoads, point: Point) -> None:
            found.append((at, point.solution.x))

        for patiently in (False, True):
            if faster and not found:
                self.at_once(min(faster), keep, patiently=patiently)
        if found:
            self.path.onward(*found[0], (speed,), on_speed)

    def _film(self, speed: float) -> FilmLoads:
        """Loads of the film at a speed."""
        path = self.path
        _, gap = path.system.arc_film(self.x + self.known.built(speed))
        first = first_film(path.system, path.settings, self.stroke, self.x)
        return replace(first, speed=speed, gap=gap)

    def _lagged(
        self,
        film: FilmLoads,
        before: tuple[float | None, Array],
        on_speed: OnSpeed,
        *,
        patiently: bool = False,
    ) -> StageFailed | None:
        """A film from that at the speed before, None: from contact; see `CoarserFilms.lagged`."""
        path = self.path
        stage = speed_stage(path.system, path.settings, film, (film.speed,), on_speed)
        newton = path.driver.newton
        end = path.driver.follow(*self.known.lagged(stage, newton, *before, patiently=patiently))
        return end if isinstance(end, StageFailed) else None


@dataclass(frozen=True, eq=False)
class FoundFilms:
    """Films of a stroke that were found on a mesh, by |U| in mm/s; contact: unknowns (n,)."""

    system: SealSystem
    contact: Array
    films: dict[float, Array]

    def on(self, path: FilmPath, x: Array, stroke: Stroke) -> FilmTransfer:
        """On their way to the mesh of a path; x: (n,) in contact there."""
        known = CoarserFilms(self.system, path.system, self.contact, self.films)
        return FilmTransfer(path, stroke, x, known)


def films_of(path: FilmPath, x: Array, stroke: Stroke, finer: SealSystem) -> CoarserFilms:
    """The films at the requested speeds, as far as they are reached; nothing is reported."""
    known, speeds = CoarserFilms(path.system, finer, x), path.system.parameters.speeds

    def keep(film: FilmLoads, point: Point) -> None:
        if film.speed in speeds:
            known.films[film.speed] = point.solution.x
            known.numbers[film.speed] = _numbers(path, film, point.solution.x)

    StrokeStart(path, stroke, x).films(keep)
    return known


def film_on_coarser(
    path: FilmPath, x: Array, film: FilmLoads, found: FoundFilms
) -> FilmNumbers | None:
    """Of a film that no path led to on a coarser mesh; None where there is none.

    path, x: of the coarser mesh, (n,) in contact. Faster films are no help there: what follows from
    them on a mesh that is too coarse is another film.
    """
    to = found.on(path, x, film.stroke)
    return _first(path, film, (to.at_once, partial(to.at_once, patiently=True)))


def film_on_finer(
    path: FilmPath, x: Array, film: FilmLoads, found: FoundFilms
) -> FilmNumbers | None:
    """Of a film on a finer mesh; None where it is not found.

    path, x: of the finer mesh, (n,) in contact.
    """
    to = found.on(path, x, film.stroke)
    ways = (to.at_once, to.by_faster, partial(to.at_once, patiently=True))
    return _first(path, film, ways)


def _first(
    path: FilmPath, film: FilmLoads, ways: Sequence[Callable[[float, OnSpeed], None]]
) -> FilmNumbers | None:
    """What a film means that the first of these ways finds that does; nothing is reported."""
    found = list[FilmNumbers]()

    def keep(at: FilmLoads, point: Point) -> None:
        if at.speed == film.speed:
            found.append(_numbers(path, at, point.solution.x))

    if path.quick and not path.system.parameters.rough:
        for way in ways:
            way(film.speed, keep)
            if found:
                return found[0]
    return None


def _numbers(path: FilmPath, film: FilmLoads, x: Array) -> FilmNumbers:
    """What a film x (n,) means."""
    bare = replace(film, entrance=0.0)
    numbers = film_numbers(path.system, path.system.film_problem(bare), bare, x)
    return path.entered(bare, x, numbers)[2]
