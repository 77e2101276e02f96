"""A film in time: squeeze on the moving surface, by backward Euler or BDF2 with its own steps.

The rates are those of the content of the film, not of its thickness, and of the axial place of the
surface (docs/film-physics.md). Each step is solved like a steady film: the section is condensed as
seldom as possible.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import nan

import numpy as np

from softehl.cases.seal.cycle.motion import Motion, RodFilm
from softehl.cases.seal.cycle.strip import missing
from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.layers import film_layer
from softehl.cases.seal.equations.loads import FilmLoads
from softehl.cases.seal.equations.system import FILM, PRESSURE, SQUEEZE
from softehl.cases.seal.states.results import rough_numbers
from softehl.runtime.arrays import Array
from softehl.runtime.fem.layered import Layer, Layered
from softehl.runtime.fem.problem import Problem
from softehl.runtime.solve.differences import differences
from softehl.runtime.solve.homotopy import Trial, Way, followed
from softehl.runtime.solve.predictor import through
from softehl.runtime.solve.record import End, Record
from softehl.runtime.solve.schur import SchurCorrector
from softehl.runtime.solve.solution import Branch, Status
from softehl.runtime.solve.steps import StepRule

_ROUGH = 4.0  # tolerances: a larger error is refused
_FAILED, _REFUSED = 0.25, 0.5  # of a step: the next one, where it failed or its error is large

_TOUCHING = 0.05
"""Film thickness (um) below which any surfaces touch."""


@dataclass(frozen=True, eq=False)
class Instant:
    """A film at a time: unknowns x (n,), content of its segments (segments, m_p + 1), mm^2.

    held: in all of them. fluxes: (2,) at the sealed and the air end, + to the air side, mm^2/s.
    volumes: (2,) what has passed these ends, mm^2: by the same differences in time as the content,
    so that both balance to rounding.
    """

    t: float
    x: Array
    content: Array
    held: float
    fluxes: Array
    volumes: Array


@dataclass(frozen=True)
class Reading:
    """Numbers of a film at a time; fluxes at both ends of the arc, + to the air side, mm^2/s."""

    t_s: float
    place_mm: float
    rod_speed_mm_s: float
    sealed_pressure_MPa: float
    friction_N: float
    flux_sealed_mm2_s: float
    flux_air_mm2_s: float
    volume_sealed_mm2: float
    volume_air_mm2: float
    content_mm2: float
    h_min_um: float
    p_max_MPa: float
    asperity_load_percent: float
    iterations: int
    lambda_ratio: float = nan


@dataclass(frozen=True)
class TimeSteps:
    """Control of the steps: error of the film thickness, relative to it, that one may have.

    first, smallest, largest: in periods.
    """

    tolerance: float = 0.02
    first: float = 1e-3
    smallest: float = 1e-8
    largest: float = 0.02
    order: int = 2


@dataclass(frozen=True, eq=False, kw_only=True)
class _Step(Trial):
    """A step that may be accepted, with the problem and the loads at its end."""

    following: float
    problem: Problem
    film: FilmLoads


@dataclass(eq=False)
class March(Way):
    """A march in time; `behind` holds the last instants, newest first, and changes with steps.

    film: loads that do not change. returned: whether the instroke finds what the outstroke left.
    condensed_at: time of the problem whose body the corrector's tangent has condensed, s.
    """

    system: SealSystem
    motion: Motion
    film: FilmLoads
    corrector: SchurCorrector
    steps: TimeSteps = field(default_factory=TimeSteps)
    returned: bool = False
    rod: RodFilm = field(default_factory=lambda: RodFilm([], []))
    behind: list[Instant] = field(default_factory=list)
    dt: float = 0.0
    condensed_at: float = 0.0
    goal: float = 0.0
    told: Callable[[Instant, Reading], None] = lambda instant, reading: None
    _layer: Layer | None = None

    def begin(self, x: Array, t: float = 0.0) -> Reading:
        """From the steady film x (n,) at a time; its reading."""
        self.dt = self.steps.first * self.motion.period
        film = self._loads(t)
        problem = self.system.film_problem(film)
        first = Instant(t, x, *self._content(x), self._fluxes(problem, x), np.zeros(2))
        self.behind = [first]
        self._layer = film_layer(self.system, x)
        return self._reading(problem, film, first, 0)

    def until(self, goal: float, on_step: Callable[[Instant, Reading], None]) -> Branch:
        """March to a time; every step is told."""
        self.goal, self.told = goal, on_step
        smallest = self.steps.smallest * self.motion.period
        branch = followed(self, StepRule(max(self.dt, smallest), smallest), Record("t"))
        return branch if branch.converged else replace(branch, message=self._stuck())

    def left(self, reading: Reading) -> float | None:
        """Film (mm) that an outstroke leaves on the rod, None at instroke."""
        U = reading.rod_speed_mm_s
        return 2.0 * reading.flux_air_mm2_s / max(U, 1e-3 * self._fastest) if U > 0.0 else None

    def condense(self, t: float, state: Array) -> None:
        """Condense the section at a state (n,) as the problem of a time has it."""
        assert self._layer is not None
        body = Layered(self.system.film_problem(self._loads(t)), self._layer)
        self.corrector.tangent.renew(self.corrector.linear, body, state)
        self.condensed_at = t

    # --- inside -----------------------------------------------------------------------------------

    def start(self) -> Trial:
        """See `Way`."""
        return Trial.known(self.behind[0].t, self.behind[0].x, self.dt)

    def attempt(self, step: float) -> Trial:
        """Solve for the film a step later, or where the speed has a corner, or at the goal."""
        now = self.behind[0].t
        corner = self.motion.speed.next_corner(now) if self.motion.corners else self.goal
        dt = min(step, self.steps.largest * self.motion.period)
        left = min(corner, self.goal) - now
        dt = left if dt >= left * (1.0 - 1e-9) else min(dt, 0.5 * left)
        guess, film = self._predicted(dt), self._loads(now + dt)
        problem, layer = self._problem(film, dt)
        tangent = self.corrector.tangent.state
        layered = Layered(problem, layer, (self.system.film_guard(),))
        solution = self.corrector.solve(layered, guess)
        if self.corrector.tangent.state is not tangent:
            self.condensed_at = now + dt
        if not solution.converged:
            return Trial(now + dt, solution, dt, _FAILED * dt)
        error = self._error(solution.x, guess)
        if error > _ROUGH:
            words = f"its error is {error:.2g} tolerances"
            refused = replace(solution, status=Status.REFUSED, message=words)
            return Trial(now + dt, refused, dt, _REFUSED * dt)
        power = 1.0 / 3.0 if len(self.behind) > 1 else 0.5
        following = dt * float(np.clip(0.8 * max(error, 1e-4) ** -power, 0.3, 1.8))
        return _Step(now + dt, solution, dt, following=following, problem=problem, film=film)

    def accept(self, trial: Trial) -> None:
        """See `Way`."""
        if not isinstance(trial, _Step):
            return  # the start
        instant = self._instant(trial.problem, trial.solution.x, trial.taken)
        reading = self._reading(trial.problem, trial.film, instant, trial.solution.iterations)
        self.behind, self.dt = [instant, *self.behind[:2]], trial.following
        left = self.left(reading)
        if left is not None:
            self.rod.leave(reading.place_mm, left)
        self.told(instant, reading)

    def end(self) -> End | None:
        """See `Way`."""
        now = self.behind[0].t
        going = now < self.goal * (1.0 - 1e-12)
        return None if going else (Status.CONVERGED, f"reached t = {now:.9g}")

    def _stuck(self) -> str:
        """From when on there is no step, and what may help."""
        now = self.behind[0].t
        speed = self.motion.speed.at(now)
        return f"no step from t = {now:.6g} s on, U = {speed:.4g} mm/s: {self._advice()}"

    def _advice(self) -> str:
        """Advice where a step was not found."""
        least = 1e3 * float(self.system.arc_film(self.behind[0].x)[1].min())
        if not self.system.parameters.rough and least < _TOUCHING:
            return (
                f"the film is {least:.2g} um thin there, where real surfaces touch; give a "
                "roughness (0.2 to 0.4 um is usual), or time_order = 1"
            )
        return "try time_order = 1, a smaller time_tolerance, roughness or a finer mesh (density)"

    @property
    def _fastest(self) -> float:
        return self.motion.speed.largest

    def _loads(self, t: float) -> FilmLoads:
        U, p_s = self.motion.speed.at(t), self.motion.pressure.at(t)
        film = replace(
            self.film,
            stroke="out" if U >= 0.0 else "in",
            speed=abs(U),
            sealed_pressure=p_s,
            slip=0.01 * self._fastest,
            least_speed=0.02 * self._fastest,
        )
        supply = self.rod.found(self.motion.place(t)) if self.returned and U < 0.0 else None
        if supply is None:
            return film
        _, h = self.system.arc_film(self.behind[0].x)
        order = self.system.parameters.pressure_order
        return replace(film, inflow=(0.0, missing(supply, float(h[-1]), float(h[-2]), order)))

    def _problem(self, film: FilmLoads, dt: float) -> tuple[Problem, Layer]:
        """The film at the end of a step, and its layer, both with what was before."""
        weights = self._weights(dt)
        known = self.behind[: len(weights) - 1]
        problem = self.system.film_problem(replace(film, rate=float(weights[0])))
        problem = problem.with_parameters(**self.system.squeeze_values(float(weights[0])))
        pairs = list(zip(weights[1:], known, strict=True))
        content = sum(w * i.content for w, i in pairs)
        arc = self.system.mesh.arc_segments
        moved = sum(w * self.system.displacements(i.x)[arc, 0] for w, i in pairs)
        layer = self._layer
        assert layer is not None, "begin() comes first"
        assemblers = [
            a.with_data(FILM, data=np.ascontiguousarray(moved)).with_data(
                SQUEEZE, point_data=np.ascontiguousarray(content)[:, :, None]
            )
            for a in (problem.assembler, layer.assembler)
        ]
        return replace(problem, assembler=assemblers[0]), replace(layer, assembler=assemblers[1])

    def _weights(self, dt: float) -> Array:
        steps = [dt]
        if self.steps.order > 1 and len(self.behind) > 1:
            steps.append(self.behind[0].t - self.behind[1].t)
        return differences(steps)

    def _predicted(self, dt: float) -> Array:
        """Polynomial through the last instants, at the end of the step."""
        times, states = [i.t for i in self.behind], [i.x for i in self.behind]
        return through(times, states, times[0] + dt)

    def _error(self, x: Array, guess: Array) -> float:
        """Prediction and result differ by so many tolerances in the film thickness."""
        if len(self.behind) < 2:
            return 1.0
        (_, h), (_, foreseen) = self.system.arc_film(x), self.system.arc_film(guess)
        size = np.abs(h) + max(self.system.parameters.surfaces.sigma, 1e-5)
        inside = h < max(50.0 * float(np.abs(h).min()), 2e-3)
        return float((np.abs(h - foreseen) / size)[inside].max() / self.steps.tolerance)

    def _instant(self, problem: Problem, x: Array, dt: float) -> Instant:
        weights = self._weights(dt)
        fluxes, known = self._fluxes(problem, x), self.behind[: len(weights) - 1]
        before = sum(w * i.volumes for w, i in zip(weights[1:], known, strict=True))
        volumes = (fluxes - before) / weights[0]
        return Instant(self.behind[0].t + dt, x, *self._content(x), fluxes, volumes)

    def _fluxes(self, problem: Problem, x: Array) -> Array:
        """See Instant; what the equations of the prescribed end pressures lack."""
        residual = problem.assembler.residual(x, problem.parameters)
        rows = residual[self.system.layout.part(PRESSURE)]
        return np.array([-rows[0], rows[-1]])

    def _content(self, x: Array) -> tuple[Array, float]:
        """See Instant: of the segments, and in all."""
        problem = self.system.problem.with_parameters(**self.system.squeeze_values(0.0))
        at = problem.fields(SQUEEZE, x)
        return at["content"], float((at["dx"] * at["h_T"] * (1.0 - at["v"])).sum())

    def _reading(
        self, problem: Problem, film: FilmLoads, instant: Instant, iterations: int
    ) -> Reading:
        system, x = self.system, instant.x
        at = problem.fields(FILM, x)
        rough = rough_numbers(system, at)
        return Reading(
            t_s=instant.t,
            place_mm=self.motion.place(instant.t),
            rod_speed_mm_s=film.rod_speed,
            sealed_pressure_MPa=film.sealed_pressure,
            friction_N=float(system.around * (at["tau_rod"] * at["dx"]).sum()),
            flux_sealed_mm2_s=float(instant.fluxes[0]),
            flux_air_mm2_s=float(instant.fluxes[1]),
            volume_sealed_mm2=float(instant.volumes[0]),
            volume_air_mm2=float(instant.volumes[1]),
            content_mm2=instant.held,
            h_min_um=1e3 * float(system.arc_film(x)[1].min()),
            p_max_MPa=float(at["p"].max()),
            asperity_load_percent=100.0 * rough.get("asperity_load", 0.0),
            iterations=iterations,
            lambda_ratio=rough.get("lambda_ratio", nan),
        )
