"""The films between rough surfaces: dry sliding, borne by asperities, then rising speeds."""

from __future__ import annotations

from dataclasses import dataclass, replace

from softehl.cases.seal.equations.loads import FilmLoads, Stroke
from softehl.cases.seal.solve.dry import dry_film, rising_stage, sliding_stages, wetting_stages
from softehl.cases.seal.solve.film import FastFilm
from softehl.cases.seal.solve.film_path import FilmPath, OnSpeed
from softehl.cases.seal.solve.path import Followed, Stage, StageFailed
from softehl.runtime.arrays import Array
from softehl.runtime.solve.solution import Point


@dataclass(frozen=True, eq=False)
class RoughPath:
    """The films of a system whose surfaces are rough, by what solves its stages."""

    path: FilmPath

    def risen(self, stroke: Stroke, x: Array, on_speed: OnSpeed) -> StageFailed | None:
        """From asperities in contact at x (n,) to dry sliding, then to higher speeds."""
        system, p = self.path.system, self.path.system.parameters
        film = dry_film(system, stroke, x)
        y = self.path.driver.follow_all(wetting_stages(system, film, x), x)
        if not isinstance(y, StageFailed):
            fast = self.path.modified(y)
            y = self._sliding(film, y, fast)
        if isinstance(y, StageFailed):
            return y
        shear = 1.0 if p.shear_traction else 0.0
        moment = 0.0 if p.rotation == "free" else film.moment
        return self._faster(replace(film, shear=shear, moment=moment), y, on_speed, fast)

    def _sliding(self, film: FilmLoads, x: Array, fast: FastFilm | None) -> Followed:
        """The dry film x (n,) with its friction; by Newton's method where the fast way fails."""
        stages = sliding_stages(self.path.system, self.path.settings, film, x)
        if fast:
            y = self.path.driver.follow_all(map(fast.shear, stages), x)
            if not isinstance(y, StageFailed):
                return y
        return self.path.driver.follow_all(stages, x)

    def _faster(
        self, film: FilmLoads, x: Array, on_speed: OnSpeed, fast: FastFilm | None
    ) -> StageFailed | None:
        """Rising speeds by modified Newton iterations; by Newton's method where they fail."""
        system, p = self.path.system, self.path.system.parameters
        reached = [(film, x)]

        def keep(at: FilmLoads, point: Point) -> None:
            if at.speed > reached[0][0].speed or not reached[1:]:
                reached[1:] = [(at, point.solution.x)]
                on_speed(at, point)

        def stage(start: FilmLoads) -> Stage:
            speeds = tuple(u for u in p.speeds if u >= start.speed)
            return rising_stage(system, self.path.settings, start, speeds, keep)

        if fast:
            end = self.path.driver.follow(fast.rising(stage(film)), x)
            if not isinstance(end, StageFailed):
                return None
        film, x = reached[-1]
        reached[:] = [(film, x)]
        end = self.path.driver.follow(stage(film), x)
        return end if isinstance(end, StageFailed) else None
