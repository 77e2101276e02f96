"""Driver of cycles: from contact to a film that moves, then cycle by cycle."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from softehl.cases.harness.observer import Observer, Outcome
from softehl.cases.seal.correctors.schur_corrector import StaleTangent
from softehl.cases.seal.cycle.motion import RodMotion
from softehl.cases.seal.cycle.transient import (
    Instant,
    March,
    Reading,
    drafted,
    packed,
    repeated,
    taken_up,
    unpacked,
)
from softehl.cases.seal.equations.system import build_system
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.solve.correctors import film_corrector
from softehl.cases.seal.solve.driver import DryContact
from softehl.cases.seal.solve.failure_messages import explained
from softehl.cases.seal.solve.film_solver import NoFilm
from softehl.cases.seal.solve.load_stages import StageError
from softehl.cases.seal.solve.squeeze_film import film_layer
from softehl.runtime.analyses.time_integrators import BDF2, Euler
from softehl.runtime.arrays import Array
from softehl.runtime.solve.linear.linear_solver import Condenser
from softehl.runtime.solve.solution import Branch, Status

OUTLINES = 48
"""Outlines of the section that are kept of a cycle, at most."""

BETWEEN_DRAFTS = 2.0
"""Seconds of work that are lost at most where a run is killed within a cycle."""

_STALE = 0.1
"""See `SchurCorrector`: many films follow each other, and 0.35 takes a quarter more time."""


@dataclass
class Films:
    """Readings of the cycle that is computed, what its film was, and where the next one starts.

    films: a table for every reading. outlines: the deformed outline, `OUTLINES` times or fewer.
    """

    readings: list[Reading] = field(default_factory=list)
    films: list[Mapping[str, Array]] = field(default_factory=list)
    outlines: list[Mapping[str, Array]] = field(default_factory=list)
    end: dict[str, Array] = field(default_factory=dict)

    @property
    def tables(self) -> dict[str, dict[str, Array]]:
        """All readings, and film and outline over time and place: name -> column -> values."""
        rows = [asdict(reading) for reading in self.readings]
        loop = {name: np.array([row[name] for row in rows], dtype=float) for name in rows[0]}
        return {"loop": loop, "film": joined(self.films), "outline": joined(self.outlines)}


def joined(tables: Sequence[Mapping[str, Array]]) -> dict[str, Array]:
    """Tables of the same columns in one."""
    return {name: np.concatenate([table[name] for table in tables]) for name in tables[0]}


Log = Callable[[int, Films, Reading, Any], Any]
"""A row of the number of a cycle, what happened in it, the reading before it, the last row."""


def run_cycles(parameters: Any, motion: RodMotion, observer: Observer, log: Log) -> Outcome[Any]:
    """All cycles of a case; log: makes a row of each.  Failure is in the outcome's status."""
    speed = motion.speed.at(0.0)
    changes = {"speeds": (speed,), "stroke": "out", "error_estimate": False, "tolerance": None}
    p: Seal = parameters.model_copy(update={**changes, "sealed_pressure": motion.pressure.at(0.0)})
    try:
        contact = DryContact.of(p, observer)
    except StageError as failed:
        return _outcome(p, *explained(failed, p))
    film, linear = contact.film("out", speed), contact.newton.linear
    if isinstance(film, NoFilm) or not isinstance(linear, Condenser):
        message = f"no steady film at U = {speed:g} mm/s to begin with; use a finer mesh (density)"
        return _outcome(p, Status.MAX_ITERATIONS, message)
    corrector = replace(film_corrector(p, linear), stale=_STALE)
    march = March(
        system=film.system,
        motion=motion,
        film=film.loads,
        corrector=corrector,
        layer=film_layer(film.system, film.x),
        tolerance=parameters.time_tolerance,
        integrator=BDF2() if parameters.time_order == 2 else Euler(),
        returned=parameters.supply == "returned",
    )
    stuck = _cycles(march, film.x, parameters.cycles, observer, log)
    if stuck is not None:
        return _outcome(p, stuck.status, march.stuck)
    return _outcome(p, Status.CONVERGED, "all cycles")


def _cycles(march: March, x: Array, count: int, observer: Observer, log: Log) -> Branch | None:
    """All cycles; the one that did not come to its end, if there is one."""
    reading, done, last = march.initialise(x), 0, None
    while (saved := observer.saved_row(float(done + 1))) is not None:
        last, (loop, _, state, _) = saved
        reading, done = repeated(march, loop)[-1], done + 1
        unpacked(march, state)
    for number in range(done + 1, count + 1):
        films, branch = _cycle(march, number, observer)
        if not branch.converged:
            return branch
        last = log(number, films, reading, last)
        reading = films.readings[-1]
    return None


def _cycle(march: March, number: int, observer: Observer) -> tuple[Films, Branch]:
    """A cycle, from its start or from the last draft of it."""
    films, key, period, saved = Films(), float(number), march.motion.period, time.monotonic()
    # its condensations are its own, so that a run that goes on from here does the same
    march.corrector = replace(march.corrector, tangent=StaleTangent())
    observer.stage(f"cycle {number}")
    if (draft := observer.drafted(key)) is not None:
        tables = taken_up(march, draft)
        films = Films(repeated(march, tables["loop"]), [tables["film"]], [tables["outline"]])

    def record_step(instant: Instant, reading: Reading) -> None:
        nonlocal saved
        films.readings.append(reading)
        films.films.append(_film(march, instant))
        if not films.outlines or instant.t - films.outlines[-1]["t_s"][-1] >= period / OUTLINES:
            films.outlines.append(_outline(march, instant))
        if time.monotonic() - saved > BETWEEN_DRAFTS:
            observer.draft(key, drafted(march, films.tables))
            saved = time.monotonic()
        observer.step(
            label="t",
            parameter=reading.t_s,
            iterations=reading.iterations,
            residuals=(),
            fraction=(reading.t_s / period) % 1.0,
        )

    branch = march.until(number * period, record_step)
    films.end = packed(march)
    return films, branch


def _film(march: March, instant: Instant) -> dict[str, Array]:
    z, h = march.system.arc_film(instant.x)
    p = march.system.pressures(instant.x)[:: march.system.parameters.pressure_order]
    t = np.full(len(z), instant.t)
    return {"t_s": t, "x_mm": z, "h_um": 1e3 * h, "p_MPa": p}


def _outline(march: March, instant: Instant) -> dict[str, Array]:
    z, r = march.system.deformed(instant.x)[march.system.mesh.boundary].T
    return {"t_s": np.full(len(z), instant.t), "z_mm": z.copy(), "r_mm": r.copy()}


def _outcome(p: Seal, status: Status, message: str) -> Outcome[Any]:
    system = build_system(p)
    kernels = {b.kernel.name: b.kernel.signature for b in system.problem.assembler.blocks}
    return Outcome((), status, message, system.counts, kernels)
