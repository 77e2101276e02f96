"""Where the films of a stroke begin: with the rod nearer or farther off, with or without a groove.

Oil between two lobes decides how. What is squeezed out of a groove takes long to leave it, so that
a film over one is built by its weight first. On the instroke the rod draws the oil out of it, and
contact gives up the pressure there before there is a film.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from softehl.cases.seal.equations.loads import FilmLoads, Stroke
from softehl.cases.seal.solve.contact import along, emptying_stage
from softehl.cases.seal.solve.film import film_offsets, first_film
from softehl.cases.seal.solve.film_path import BuiltFilm, FilmPath, OnSpeed
from softehl.cases.seal.solve.nearing import rod_brought_near, without_rounding
from softehl.cases.seal.solve.path import Followed, StageFailed
from softehl.cases.seal.solve.rough_path import RoughPath
from softehl.cases.seal.solve.thinning import thinned_film
from softehl.runtime.arrays import Array

_ROUGHLY = 1e-3
"""Residual of states on the way to an empty groove."""


def emptied(path: FilmPath, x: Array) -> tuple[FilmPath, Array] | None:
    """From the contact state x with oil under pressure between two lobes to that without it.

    None where there is no such groove, or no such state.
    """
    system, p = path.system, path.system.parameters
    if p.lobes < 2 or p.sealed_pressure == 0.0 or p.rough or not system.groove:
        return None
    stage = emptying_stage(system, path.settings)
    rough = along(system, replace(path.driver.newton, tolerance=_ROUGHLY))
    y = path.driver.follow(replace(stage, corrector=rough), x)
    if not isinstance(y, StageFailed):
        y = path.driver.follow(replace(stage, start=stage.stop), y)
    if isinstance(y, StageFailed):
        return None
    return replace(path, system=replace(system, groove=0.0)), y


@dataclass(frozen=True, eq=False)
class StrokeStart:
    """Ways from the contact state x (n,) of a section to the first film of a stroke."""

    path: FilmPath
    stroke: Stroke
    x: Array

    def films(self, on_speed: OnSpeed) -> StageFailed | None:
        """All films of the stroke from the settled contact state; what went wrong, if anything."""
        path, p = self.path, self.path.system.parameters
        if p.rough:
            return RoughPath(path).risen(self.stroke, self.x, on_speed)
        start = self.begun(on_speed)
        if start is None or (path.quick and path.tolerance is not None):
            return None  # what is no result is not worth the slow way
        return path.slower(path.build(*start), p.speeds, on_speed)

    def begun(self, on_speed: OnSpeed) -> BuiltFilm | None:
        """The start to go on from by Newton's method, None if the films of a stroke are all solved.

        Other starts are tried where one does not lead to a film.
        """
        path, grooved = self.path, self.path.system.parameters.lobes > 1
        thick = None
        if path.quick and not grooved:
            thick = thinned_film(path.system, path.settings, self.stroke, self.x)
        if thick:
            failed = path.thinned(thick, self.x, on_speed)
            if failed is None:
                return None
            if "falling speed" in failed.stage.name or path.tolerance is not None:
                return self._here
            if "shear" in failed.stage.name and not path.laboriously:
                return self._here  # another mesh follows
        first: BuiltFilm | None = None
        ways = (path.fast, self._squeezed) if grooved else (self._near,)
        for way in ways:
            for film, y in self.starts():
                first = first or (film, y)
                if not path.quick:
                    return first
                failed = way(film, y, on_speed)
                if failed is None:
                    return None
                if _was_film(failed, grooved):
                    return film, y
        return first or self._here

    def starts(self) -> Iterator[BuiltFilm]:
        """First films, one after the other, and the contact states they begin at."""
        path, system, settings = self.path, self.path.system, self.path.settings
        newton, follow = path.driver.newton, path.driver.follow
        nearest = 0.0
        for offset in film_offsets(system, settings, self.stroke, self.x):
            if offset < nearest:
                continue
            y: Followed = self.x
            if offset != settings.offset:
                y = rod_brought_near(
                    system, settings, offset, self.x, newton, follow, quick=path.quick
                )
            if isinstance(y, StageFailed) and y.stage.start > y.stage.stop:
                nearest = max(nearest, y.stage.shown(y.reached))  # others end on the same way
            if not isinstance(y, StageFailed):
                y = without_rounding(system, y)
                yield first_film(system, replace(settings, offset=offset), self.stroke, y), y

    @property
    def _here(self) -> BuiltFilm:
        """The first film with the rod where contact holds it."""
        return first_film(self.path.system, self.path.settings, self.stroke, self.x), self.x

    def _near(self, film: FilmLoads, x: Array, on_speed: OnSpeed) -> StageFailed | None:
        """All films of a stroke from the contact state x with the rod near: squeezed out, or else
        by their weight; see `FilmPath.fast`.
        """
        if film.rod_offset != self.path.settings.offset:
            failed = self._squeezed(film, x, on_speed)
            if failed is None or "falling speed" in failed.stage.name:
                return failed
        return self.path.fast(film, x, on_speed)

    def _squeezed(self, film: FilmLoads, x: Array, on_speed: OnSpeed) -> StageFailed | None:
        """All films of a stroke from the contact state x with the rod near, squeezed out."""
        near = replace(self.path.settings, offset=film.rod_offset)
        thin = thinned_film(self.path.system, near, film.stroke, x)
        return self.path.thinned(thin, x, on_speed) if thin else self.path.fast(film, x, on_speed)


def _was_film(failed: StageFailed, grooved: bool) -> bool:
    """Whether there was a film before a stage failed, from which Newton's method may go on.

    grooved: where another start of the film is cheaper than that, as long as no speed was reached.
    """
    name = failed.stage.name
    return "falling speed" in name if grooved else "contact to film" not in name
