"""The films of a contact state: built up from it, then followed as the speed falls or rises."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.loads import FilmLoads
from softehl.cases.seal.solve.contact import along, lies_in_corner
from softehl.cases.seal.solve.dry import settle_stage
from softehl.cases.seal.solve.film import (
    FastFilm,
    release_stage,
    shear_stage,
    speed_stage,
    weight_stage,
)
from softehl.cases.seal.solve.grading import film_thickness
from softehl.cases.seal.solve.path import (
    Followed,
    PathDriver,
    PathSettings,
    Stage,
    StageFailed,
    laborious,
)
from softehl.cases.seal.solve.pockets import fed, traps
from softehl.cases.seal.solve.pressure_newton import roughly
from softehl.cases.seal.solve.thinning import longer, settled, sooner, thinning_stage
from softehl.cases.seal.states.contacts import contact_edges
from softehl.cases.seal.states.results import film_numbers
from softehl.cases.seal.states.verdict import FilmNumbers
from softehl.runtime.arrays import Array
from softehl.runtime.solve.linear import Condenser
from softehl.runtime.solve.newton import Corrector
from softehl.runtime.solve.solution import Branch, Point, Status

_POCKET = 5.0
"""Of `film_thickness`, above which oil is trapped rather than part of a thick film."""

_LABORIOUS = 20
"""Iterations that a state on the way may need where the section lies in a corner."""

OnSpeed = Callable[[FilmLoads, Point], None]
BuiltFilm = tuple[FilmLoads, Array]


@dataclass(frozen=True, eq=False)
class FilmPath:
    """The films of a system: built up from its contact state, then followed as the speed falls.

    tolerance: of films by modified Newton iterations that are no results, None for that of results.
    laboriously: whether Newton's method is worth its time in a corner: not before another mesh.
    """

    system: SealSystem
    settings: PathSettings
    driver: PathDriver
    tolerance: float | None = None
    laboriously: bool = True

    @property
    def quick(self) -> bool:
        """Whether modified Newton iterations are to be tried."""
        p, linear = self.system.parameters, self.driver.newton.linear
        held = p.rotation == "fixed" and not p.rubs
        return p.solver == "auto" and held and isinstance(linear, Condenser)

    def fast(self, film: FilmLoads, x: Array, on_speed: OnSpeed) -> StageFailed | None:
        """All film stages by modified Newton iterations; the one that ended early, if one did."""
        fast = self.modified(x)
        assert fast
        first = fast.weight(weight_stage(self.system, self.settings, film))
        return self._falling(fast, film, self.driver.follow(first, x), on_speed, onward=True)

    def thinned(self, film: FilmLoads, x: Array, on_speed: OnSpeed) -> StageFailed | None:
        """All films of a stroke, the first by squeezing out what is in contact at x; see `fast`."""
        fast, first, y = self._squeezed(film, x)
        if isinstance(y, StageFailed):
            return y
        if self.system.parameters.shear_traction:
            film = replace(film, shear=1.0)
        failed = self._falling(fast, film, y, on_speed)
        ways = (self._longer, self._at_rest) if self._cornered and film.shear else (self._longer,)
        for steady in ways:
            if not _not_begun(failed, film):
                break
            z = steady(first, film, y)
            if not isinstance(z, StageFailed):
                y, fast = z, (self.modified(z) or fast) if self._cornered else fast
                failed = self._falling(fast, film, y, on_speed)
            elif not self._cornered:
                return z
        if failed is None or "shear" not in failed.stage.name:
            return failed
        return self._sheared_slower(fast, film, y, failed, on_speed)

    def _squeezed(self, film: FilmLoads, x: Array) -> tuple[FastFilm, Stage, Followed]:
        """The first film, squeezed out from the contact state x (n,); its stage, and what goes on
        from it.
        """
        fast = self.modified(x)
        assert fast
        first, start = thinning_stage(fast, film, x)
        thin = film_thickness(self.system.parameters, contact_edges(self.system, x), film.speed)
        y = self.driver.follow(first, start)
        if isinstance(y, StageFailed) and not y.branch.points:
            y = self.driver.follow(sooner(self.system, first, film, x), start)
        if isinstance(y, StageFailed) and self._cornered:
            z = self._onward(first, y, roughly(self.driver.newton, thin))
            y = next((late for late in (settled(z), settled(y)) if late is not None), z)
            if not isinstance(y, StageFailed):  # which the fast way has not seen
                fast = self.modified(y) or fast
                first, _ = thinning_stage(fast, film, x)
        if not isinstance(y, StageFailed) and self._traps(film, x, y, _POCKET * thin):
            y = StageFailed(first, Branch((), Status.DIVERGED, "oil is trapped"))
        return fast, first, y

    def _longer(self, first: Stage, film: FilmLoads, y: Array) -> Followed:
        """A film y (n,) that is not steady, squeezed out for longer."""
        return self.driver.follow(longer(first), y)

    def _at_rest(self, first: Stage, film: FilmLoads, y: Array) -> Followed:
        """The steady film without shear by Newton's method."""
        stage = shear_stage(self.system, self.settings, film)
        return self.driver.follow(laborious(replace(stage, stop=stage.start), self._rough(y)), y)

    def _sheared_slower(
        self, fast: FastFilm, film: FilmLoads, y: Array, failed: StageFailed, on_speed: OnSpeed
    ) -> StageFailed | None:
        """Films of a stroke whose first one, y (n,), does not bear its shear stress.

        Slower ones first; then Newton's method goes on where the shear stage failed.
        """
        found = list[float]()

        def tell(at: FilmLoads, point: Point) -> None:
            found.append(at.speed)
            on_speed(at, point)

        if lies_in_corner(self.system) and self._slower_first(film, y, tell) is None:
            return None
        if not self._cornered or (found and self.tolerance is not None):
            return failed
        sheared = self._onward(shear_stage(self.system, self.settings, film), failed)
        if isinstance(sheared, StageFailed):
            return sheared
        return self._fallen(self.modified(sheared) or fast, film, sheared, on_speed)

    def _slower_first(self, film: FilmLoads, y: Array, on_speed: OnSpeed) -> StageFailed | None:
        """Films from slower ones than the first, y (n,), on: they have less shear stress.

        What went wrong, None if all that is asked for was reached.
        """
        system, settings = self.system, self.settings
        failed: StageFailed | None = None
        for speed in below(system.parameters.speeds, film.speed):
            fast = self.modified(y)
            assert fast
            bare = speed_stage(system, settings, replace(film, shear=0.0), (speed,), _untold)
            slower = self.driver.follow(fast.slower(bare), y)
            if isinstance(slower, StageFailed):
                return slower
            film, y = replace(film, speed=speed), slower
            missed, failed = failed, self._falling(fast, film, y, on_speed)
            if failed is None or "shear" not in failed.stage.name:
                return failed or missed
        return failed

    def _traps(self, film: FilmLoads, x: Array, y: Array, apart: float) -> bool:
        """Whether the film y (n,) holds oil that is not on the way of its flux; see `fed`."""
        if not traps(self.system, x, y, apart):
            return False
        h_star = film_numbers(self.system, self.system.film_problem(film), film, y).h_star
        return not fed(self.system, film, x, y, apart, h_star)

    def _falling(
        self,
        fast: FastFilm,
        film: FilmLoads,
        y: Followed,
        on_speed: OnSpeed,
        *,
        onward: bool = False,
    ) -> StageFailed | None:
        """From the first film y (n,), if there is one, to shear, then to falling speed.

        onward: see `_sheared`.
        """
        if self.system.parameters.shear_traction and not isinstance(y, StageFailed):
            stage = shear_stage(self.system, self.settings, film)
            y = self._sheared(fast, stage, y, onward=onward)
        return self._fallen(fast, film, y, on_speed)

    def _fallen(
        self, fast: FastFilm, film: FilmLoads, y: Followed, on_speed: OnSpeed
    ) -> StageFailed | None:
        """From a film y (n,) with its shear stress, if there is one, to falling speed."""
        system, settings, p = self.system, self.settings, self.system.parameters
        if not isinstance(y, StageFailed):
            left = tuple(u for u in p.speeds if u <= film.speed)
            stage = speed_stage(system, settings, film, left, on_speed)
            sheared, y = y, self.driver.follow(fast.speed(stage), y)
            if isinstance(y, StageFailed) and self._cornered:
                if y.branch.points:
                    sheared, last = y.branch.last.x, abs(stage.shown(y.reached))
                    film, left = replace(film, speed=last), below(left, last)
                return self._slower_in_corner(film, sheared, left, on_speed)
        return y if isinstance(y, StageFailed) else None

    def _sheared(self, fast: FastFilm, stage: Stage, x: Array, *, onward: bool = False) -> Followed:
        """The shear stage from x (n,), at once if that leads there; by Newton's method from where
        the fast way ends.

        Where shear pulls corners of the section off the groove or into it the fast way stalls.
        onward: whether Newton's method goes on in a corner, where it takes long.
        """
        y = self.driver.follow(fast.shear(replace(stage, start=stage.stop)), x)
        if isinstance(y, StageFailed):
            y = self.driver.follow(fast.shear(stage), x)
        if not isinstance(y, StageFailed):
            return y
        if self._cornered:
            return self._onward(stage, y) if onward else y
        if y.branch.points and self.laboriously and self.tolerance is None:
            y = self.driver.follow(replace(stage, start=y.reached), y.branch.last.x)
        return y

    @property
    def _cornered(self) -> bool:
        """Whether its pressure holds a round section in the corner of rod and wall: Newton's method
        goes farther there from the last state than along a secant.
        """
        return self.quick and self.laboriously and lies_in_corner(self.system)

    def _rough(self, x: Array, share: float = 1.0) -> Corrector | None:
        """What solves films on the way of such a section, as thin as so much of the film x (n,)."""
        newton = replace(self.driver.newton, max_iterations=_LABORIOUS)
        thinnest = share * float(self.system.arc_film(x)[1].min())
        return along(self.system, roughly(newton, thinnest))

    def _onward(
        self, stage: Stage, failed: StageFailed, corrector: Corrector | None = None
    ) -> Followed:
        """From the last state of a failed stage, if there is one."""
        if not failed.branch.points:
            return failed
        x = failed.branch.last.x
        way = laborious(replace(stage, start=failed.reached), corrector or self._rough(x))
        return self.driver.follow(way, x)

    def onward(
        self, film: FilmLoads, x: Array, speeds: tuple[float, ...], on_speed: OnSpeed
    ) -> None:
        """From a film that is known, x (n,), to these slower ones, as far as they are reached."""
        if speeds and (fast := self.modified(x)):
            stage = speed_stage(self.system, self.settings, film, speeds, on_speed)
            self.driver.follow(fast.speed(stage), x)

    def entered(
        self, film: FilmLoads, x: Array, numbers: FilmNumbers
    ) -> tuple[FilmLoads, Array, FilmNumbers]:
        """The film x (n,) with the pressure of the wedge before its arc where it lacks much of it.

        numbers: what the film means. All as they are where no such film is found.
        """
        if not numbers.enters:
            return film, x, numbers
        more, fast = replace(film, entrance=numbers.entrance), self.modified(x)
        one = speed_stage(self.system, self.settings, more, (film.speed,), _untold)
        stage = replace(one, name="wedge before the arc")
        y = self.driver.follow(fast.speed(stage) if fast else stage, x)
        if isinstance(y, StageFailed):
            return film, x, numbers
        return more, y, film_numbers(self.system, self.system.film_problem(more), more, y)

    def settled(self, x: Array) -> Followed:
        """The contact state x where the rod is as near as asperities let it; x itself if smooth."""
        if not self.system.parameters.rough:
            return x
        stage = settle_stage(self.system, self.settings, self.driver.newton)
        return self.driver.follow(stage, x)

    def modified(self, x: Array) -> FastFilm | None:
        """Modified Newton iterations that begin at x (n,), None where they do not serve."""
        linear = self.driver.newton.linear
        if not self.quick or not isinstance(linear, Condenser):
            return None
        fast = FastFilm.of(self.system, linear, x)
        if self.tolerance is None:
            return fast
        return replace(fast, corrector=fast.corrector.with_tolerance(self.tolerance))

    def build(self, film: FilmLoads, x: Array) -> BuiltFilm | StageFailed:
        """By Newton's method from the contact state x to the film at its first speed."""
        system, settings, p = self.system, self.settings, self.system.parameters
        y = self.driver.follow(weight_stage(system, settings, film), x)
        if film.moment is None and p.rotation == "free" and not isinstance(y, StageFailed):
            y = self.driver.follow(release_stage(system, settings, film, y), y)
            film = replace(film, moment=0.0)
        if p.shear_traction and not isinstance(y, StageFailed):
            y = self.driver.follow(shear_stage(system, settings, film), y)
        return y if isinstance(y, StageFailed) else (film, y)

    def without_film(self, film: FilmLoads, _: Array) -> StageFailed:
        """What is said where there is no film, and another mesh had one: nothing more is tried."""
        return self._missed(film, self.system.parameters.speeds, "no film on this mesh")

    def faster_missed(self, film: FilmLoads, missing: set[float]) -> StageFailed:
        """What is said of speeds that were not reached although slower ones were."""
        speed = max(missing)
        failed = self._missed(replace(film, speed=speed), (speed,), "slower films are there")
        return replace(failed, stage=replace(failed.stage, name="speed"))

    def _missed(self, film: FilmLoads, speeds: tuple[float, ...], why: str) -> StageFailed:
        stage = speed_stage(self.system, self.settings, film, speeds, _untold)
        return StageFailed(stage, Branch((), Status.DIVERGED, why))

    def slower(
        self, built: BuiltFilm | StageFailed, speeds: tuple[float, ...], on_speed: OnSpeed
    ) -> StageFailed | None:
        """By Newton's method from a film to slower ones; what went wrong, if anything did."""
        if isinstance(built, StageFailed):
            return built
        film, x = built
        if self._cornered:
            return self._slower_in_corner(film, x, speeds, on_speed)
        end = self.driver.follow(speed_stage(self.system, self.settings, film, speeds, on_speed), x)
        return end if isinstance(end, StageFailed) else None

    def _slower_in_corner(
        self, film: FilmLoads, x: Array, speeds: tuple[float, ...], on_speed: OnSpeed
    ) -> StageFailed | None:
        """The same where the section lies in a corner; only the speeds are solved to the end."""
        system, settings, newton = self.system, self.settings, self.driver.newton
        for speed in speeds:
            way = speed_stage(system, settings, film, (speed,), _untold)
            thinner = (speed / film.speed) ** 0.6  # as h* is
            y = self.driver.follow(laborious(way, self._rough(x, thinner)), x)
            film = replace(film, speed=speed)
            if not isinstance(y, StageFailed):
                there = speed_stage(system, settings, film, (speed,), on_speed)
                y = self.driver.follow(laborious(there, along(system, newton)), y)
            if isinstance(y, StageFailed):
                return y
            x = y
        return None


def _not_begun(failed: StageFailed | None, film: FilmLoads) -> bool:
    """Whether what follows the first film failed at its start: it was not steady yet."""
    begins = "shear" if film.shear else "falling speed"
    return failed is not None and begins in failed.stage.name and not failed.branch.points


def _untold(film: FilmLoads, point: Point) -> None:
    """For a stage whose films are of no interest."""


def below(speeds: tuple[float, ...], speed: float) -> tuple[float, ...]:
    """The speeds that are slower than another one."""
    return tuple(u for u in speeds if u < speed)
