"""A film in time: squeeze on the moving surface, by backward Euler or BDF2 with its own steps.

The rates are those of the content of the film, not of its thickness, and of the axial place of the
surface (docs/film-physics.md). Each step is solved like a steady film: the section is condensed as
seldom as possible. A march is written into tables at the end of a cycle or within it, and restarted
from them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from math import nan

import numpy as np

from softehl.cases.seal.correctors.layer_split import Layer, Layered
from softehl.cases.seal.correctors.schur_corrector import SchurCorrector
from softehl.cases.seal.cycle.motion import RodFilm, RodMotion, missing
from softehl.cases.seal.equations.definition import FILM, PRESSURE, SQUEEZE
from softehl.cases.seal.equations.loads import FilmLoads
from softehl.cases.seal.equations.system import SealSystem
from softehl.cases.seal.states.results import rough_numbers
from softehl.runtime.analyses.time_integrators import FirstOrderIntegrator
from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.solve.continuation import (
    End,
    PathLog,
    StepAttempt,
    Stepper,
    StepRule,
    follow_path,
    next_parameter,
    polynomial_value,
)
from softehl.runtime.solve.solution import Branch, Status


@dataclass(frozen=True, eq=False)
class Instant:
    """A film at a time: unknowns x (n,), content of its segments (segments, m_p + 1), mm^2.

    volume: in all of them. fluxes: (2,) at the sealed and the air end, + to the air side, mm^2/s.
    volumes: (2,) what has passed these ends, mm^2: by the same differences in time as the content,
    so that both balance to rounding.
    """

    t: float
    x: Array
    content: Array
    volume: float
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


@dataclass(frozen=True, eq=False, kw_only=True)
class _Step(StepAttempt):
    """A step that may be accepted, with the problem and the loads at its end."""

    next_step: float
    problem: Problem
    film: FilmLoads


@dataclass(eq=False)
class March(Stepper):
    """A march in time; `history` holds the last instants, newest first, and changes with steps.

    film: loads that do not change. tolerance: error of the film thickness, relative to it, that a
    step aims at. integrator: backward Euler or BDF2. returned: whether the instroke finds what
    the outstroke left. layer: of the film, near its first state. condensed_at: time of the problem
    whose body the corrector's tangent has condensed, s.
    """

    system: SealSystem
    motion: RodMotion
    film: FilmLoads
    corrector: SchurCorrector
    layer: Layer
    tolerance: float
    integrator: FirstOrderIntegrator
    returned: bool
    rod: RodFilm = field(default_factory=lambda: RodFilm([], []))
    history: list[Instant] = field(default_factory=list)
    dt: float = 0.0
    condensed_at: float = 0.0
    goal: float = 0.0
    on_step: Callable[[Instant, Reading], None] = lambda instant, reading: None

    def initialise(self, x: Array) -> Reading:
        """From the steady film x (n,) at t = 0; its reading."""
        self.dt = 1e-3 * self.motion.period
        film = self._loads(0.0)
        problem = self.system.film_problem(film)
        first = Instant(0.0, x, *self._content(x), self._fluxes(problem, x), np.zeros(2))
        self.history = [first]
        return self._reading(problem, film, first, 0)

    def until(self, goal: float, on_step: Callable[[Instant, Reading], None]) -> Branch:
        """March to a time; every step is told."""
        self.goal, self.on_step = goal, on_step
        smallest = 1e-8 * self.motion.period
        return follow_path(self, StepRule(max(self.dt, smallest), smallest), PathLog("t"))

    def left(self, reading: Reading) -> float | None:
        """Film (mm) that an outstroke leaves on the rod, None at instroke."""
        U = reading.rod_speed_mm_s
        return 2.0 * reading.flux_air_mm2_s / U if U > 0.0 else None

    def deposit(self, reading: Reading) -> None:
        """Put what an outstroke leaves on the rod."""
        left = self.left(reading)
        if left is not None:
            self.rod.leave(reading.place_mm, left)

    def condense(self, t: float, state: Array) -> None:
        """Condense the section at a state (n,) as the problem of a time has it."""
        body = Layered(self.system.film_problem(self._loads(t)), self.layer)
        self.corrector.tangent.renew(self.corrector.linear, body, state)
        self.condensed_at = t

    # --- inside -----------------------------------------------------------------------------------

    def start(self) -> StepAttempt:
        """See `Stepper`."""
        return StepAttempt.solved(self.history[0].t, self.history[0].x, self.dt)

    def attempt(self, step: float) -> StepAttempt:
        """Solve for the film a step later, or where the speed has a corner, or at the goal.

        Steps are at most 0.02 of a period: longer ones changed the work of a cycle by one per cent.
        One with an error of three tolerances is refused, as behind a corner; to refuse errors above
        one costs a tenth more steps.
        """
        now = self.history[0].t
        corner = self.motion.speed.next_corner(now) if self.motion.corners else self.goal
        longest = min(step, 0.02 * self.motion.period)
        t = next_parameter(now, min(corner, self.goal), longest)
        guess = polynomial_value([i.t for i in self.history], [i.x for i in self.history], t)
        dt, film = t - now, self._loads(t)
        problem, layer = self._problem(film, dt)
        tangent = self.corrector.tangent.state
        layered = Layered(problem, layer, (self.system.film_guard(),))
        solution = self.corrector.solve(layered, guess)
        if self.corrector.tangent.state is not tangent:
            self.condensed_at = t
        if not solution.converged:
            return StepAttempt(t, solution, dt)
        error = self._error(solution.x, guess)
        power = 1.0 / 3.0 if len(self.history) > 1 else 0.5
        following = 0.8 * dt / max(error**power, 0.45)
        if error > 3.0:
            message = f"its error is {error:.2g} tolerances"
            solution = replace(solution, status=Status.REFUSED, message=message)
        return _Step(t, solution, dt, next_step=following, problem=problem, film=film)

    def accept(self, attempt: StepAttempt) -> None:
        """See `Stepper`."""
        if not isinstance(attempt, _Step):
            return  # the start
        instant = self._instant(attempt.problem, attempt.solution.x, attempt.step_length)
        reading = self._reading(attempt.problem, attempt.film, instant, attempt.solution.iterations)
        self.history, self.dt = [instant, *self.history[:2]], attempt.next_step
        self.deposit(reading)
        self.on_step(instant, reading)

    def end(self) -> End | None:
        """See `Stepper`."""
        now = self.history[0].t
        going = now < self.goal * (1.0 - 1e-12)
        return None if going else (Status.CONVERGED, f"reached t = {now:.9g}")

    @property
    def stuck(self) -> str:
        """From when on there is no step, and what may help."""
        now = self.history[0]
        thinnest = 1e3 * float(self.system.arc_film(now.x)[1].min())
        advice = "try time_order = 1, a smaller time_tolerance, roughness or a finer mesh (density)"
        if not self.system.parameters.rough and thinnest < 0.05:
            advice = (
                f"the film is {thinnest:.2g} um thin there, where real surfaces touch; give a "
                "roughness (0.2 to 0.4 um is usual), or time_order = 1"
            )
        speed = self.motion.speed.at(now.t)
        return f"no step from t = {now.t:.6g} s on, U = {speed:.4g} mm/s: {advice}"

    def _loads(self, t: float) -> FilmLoads:
        U, p_s = self.motion.speed.at(t), self.motion.pressure.at(t)
        film = replace(
            self.film,
            stroke="out" if U >= 0.0 else "in",
            speed=abs(U),
            sealed_pressure=p_s,
            slip=0.01 * self.motion.speed.largest,
        )
        supply = (
            self.rod.thickness_at(self.motion.position(t)) if self.returned and U < 0.0 else None
        )
        if supply is None:
            return film
        _, h = self.system.arc_film(self.history[0].x)
        order = self.system.parameters.pressure_order
        return replace(film, inflow=(0.0, missing(supply, float(h[-1]), float(h[-2]), order)))

    def _problem(self, film: FilmLoads, dt: float) -> tuple[Problem, Layer]:
        """The film at the end of a step, and its layer, both with what was before."""
        rate, past = self._differences(dt)
        problem = self.system.film_problem(replace(film, rate=rate))
        problem = problem.with_parameters(**self.system.squeeze_values(rate))
        content = sum(w * i.content for w, i in past)
        arc = self.system.mesh.arc_segments
        moved = sum(w * self.system.displacements(i.x)[arc, 0] for w, i in past)
        assemblers = [
            a.with_data(FILM, data=np.ascontiguousarray(moved)).with_data(
                SQUEEZE, point_data=np.ascontiguousarray(content)[:, :, None]
            )
            for a in (problem.assembler, self.layer.assembler)
        ]
        layer = replace(self.layer, assembler=assemblers[1])
        return replace(problem, assembler=assemblers[0]), layer

    def _differences(self, dt: float) -> tuple[float, list[tuple[float, Instant]]]:
        """Weights of d/dt at the end of a step: its own, those of the instants before."""
        last = self.history[: self.integrator.order]
        steps = [dt, *(newer.t - older.t for newer, older in pairwise(last))]
        rate, *weights = self.integrator.weights(steps).tolist()
        return rate, list(zip(weights, self.history, strict=False))

    def _error(self, x: Array, guess: Array) -> float:
        """Prediction and result differ by so many tolerances in the film thickness."""
        if len(self.history) < 2:
            return 1.0
        (_, h), (_, foreseen) = self.system.arc_film(x), self.system.arc_film(guess)
        size = np.abs(h) + self.system.parameters.surfaces.sigma
        return float((np.abs(h - foreseen) / size).max() / self.tolerance)

    def _instant(self, problem: Problem, x: Array, dt: float) -> Instant:
        (rate, past), fluxes = self._differences(dt), self._fluxes(problem, x)
        volumes = (fluxes - sum(w * i.volumes for w, i in past)) / rate
        return Instant(self.history[0].t + dt, x, *self._content(x), fluxes, volumes)

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
            place_mm=self.motion.position(instant.t),
            rod_speed_mm_s=film.rod_speed,
            sealed_pressure_MPa=film.sealed_pressure,
            friction_N=float(system.around * (at["tau_rod"] * at["dx"]).sum()),
            flux_sealed_mm2_s=float(instant.fluxes[0]),
            flux_air_mm2_s=float(instant.fluxes[1]),
            volume_sealed_mm2=float(instant.volumes[0]),
            volume_air_mm2=float(instant.volumes[1]),
            content_mm2=instant.volume,
            h_min_um=1e3 * float(system.arc_film(x)[1].min()),
            p_max_MPa=float(at["p"].max()),
            asperity_load_percent=100.0 * rough.get("asperity_load", 0.0),
            iterations=iterations,
            lambda_ratio=rough.get("lambda_ratio", nan),
        )


STEP = "next_step_s"
"""Column of the step that comes next, the same in every line."""

Tables = Mapping[str, Mapping[str, Array]]
"""Name of a table -> column -> values (n,)."""


def packed(march: March) -> dict[str, Array]:
    """Start of the next step: a column for each of the last instants, newest first.

    A column holds the time, what the film holds, fluxes and volumes at both ends, the content of
    the segments and the unknowns, (n,) in all.
    """
    columns = {
        f"instant_{k}": np.concatenate(
            [[i.t, i.volume], i.fluxes, i.volumes, i.content.ravel(), i.x]
        )
        for k, i in enumerate(march.history)
    }
    return {**columns, STEP: np.full(len(columns["instant_0"]), march.dt)}


def unpacked(march: March, table: Mapping[str, Array]) -> None:
    """Put a march where `packed` took it; it has begun.  ValueError for another mesh."""
    content = march.history[0].content
    length = 6 + content.size + len(march.history[0].x)
    if len(table[STEP]) != length:
        raise ValueError(f"a state of {len(table[STEP])} numbers does not fit {length}")
    bounds = 2, 4, 6, 6 + content.size
    history = []
    for name in sorted(name for name in table if name != STEP):
        (t, volume), fluxes, volumes, filled, x = np.split(table[name], bounds)
        filled = filled.reshape(content.shape)
        history.append(Instant(float(t), x, filled, float(volume), fluxes, volumes))
    march.history, march.dt = history, float(table[STEP][0])


def repeated(march: March, loop: Mapping[str, Array]) -> list[Reading]:
    """The readings of a cycle from its table; what its outstrokes left is on the rod again."""
    columns = {field.name: loop[field.name].tolist() for field in fields(Reading)}
    count = len(columns["t_s"])
    past = [Reading(**{name: c[k] for name, c in columns.items()}) for k in range(count)]
    for reading in past:
        march.deposit(reading)
    return past


def drafted(march: March, cycle: Tables) -> dict[str, Array]:
    """A cycle in the middle of it: its tables so far, the march and its tangent."""
    tangent = march.corrector.tangent
    assert tangent.state is not None
    assert tangent.accepted is not None
    numbers = np.array([march.condensed_at, float(tangent.outdated)])
    tangent_table = {"state": tangent.state, "accepted": tangent.accepted, "numbers": numbers}
    tables: Tables = {**cycle, "march": packed(march), "tangent": tangent_table}
    return {f"{t}/{name}": column for t, table in tables.items() for name, column in table.items()}


def taken_up(march: March, arrays: Mapping[str, Array]) -> Tables:
    """Put a march where `drafted` took it; the tables of the cycle so far."""
    tables: dict[str, dict[str, Array]] = {}
    for name, column in arrays.items():
        table, _, column_name = name.partition("/")
        tables.setdefault(table, {})[column_name] = column
    unpacked(march, tables["march"])
    tangent = tables["tangent"]
    t, outdated = tangent["numbers"].tolist()
    march.condense(t, tangent["state"])
    march.corrector.tangent.accepted = tangent["accepted"]
    march.corrector.tangent.outdated = bool(outdated)
    return tables
