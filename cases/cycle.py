"""The O-ring on a rod that goes to and fro: film, friction and leakage in time, cycle by cycle."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite, nan, pi
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator
from scipy.integrate import trapezoid

from softehl.cases.harness.case import Alarm, Case
from softehl.cases.harness.observer import Observer, Outcome, State
from softehl.cases.harness.parameters import key
from softehl.cases.harness.pictures import KINDS, draw_columns, save
from softehl.cases.harness.report.part import FinishedRun, Part
from softehl.cases.harness.row import OK, Row, column
from softehl.cases.seal.cycle.motion import RodMotion, motion_keys
from softehl.cases.seal.gland.messages import assumed, foreword, warnings
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.surfaces import MIXED
from softehl.cases.seal.gland.validation import require_films
from softehl.cases.seal.report.model_limits import LEFT_OUT, cautions, titled
from softehl.cases.seal.states.state import stage_label
from softehl.cases.seal.states.summary import far, leaks
from softehl.runtime.arrays import Array
from softehl.runtime.io import read_table

TRANSIENT = "transient"
"""Verdict of a cycle that differs from the one before by more than PERIODIC."""
PERIODIC = 1.0  # per cent

PICTURES, ANIMATION = ("friction_loop", "film_map"), "cycle.gif"

Points = tuple[Annotated[tuple[float, float], Field(strict=False)], ...]


class Cycle(Seal):
    """An O-ring and how its rod moves; the film conserves mass. `speeds`, `stroke` are not used."""

    headings: ClassVar = {
        **Seal.headings,
        "motion": (
            *("sealed_pressure", "pressures", "travel", "frequency", "shape", "ramp", "motion"),
            *("cycles", "supply", "speeds", "stroke"),
        ),
        "numerics": (*Seal.headings["numerics"], "time_order", "time_tolerance", "animation"),
    }

    motion: Points | None = key(
        None,
        "speed of the rod over time, repeated: [[t, U], ...]; {stroke = 20, frequency = 2} and a "
        "CSV file with the columns t_s, U_mm_s are understood too",
        bounds="t rising from 0; left out = by travel, frequency and shape",
        strict=False,
    )
    travel: float = key(20.0, "stroke length of the rod", unit="mm", gt=0)
    frequency: float = key(2.0, "cycles in a second", unit="1/s", gt=0)
    shape: Literal["sine", "trapezoidal"] = key("sine", "speed over time")
    ramp: float = key(0.1, "trapezoidal: share of the cycle of each ramp", gt=0, lt=0.5)
    pressures: Points | None = key(
        None,
        "sealed pressure over time, repeated: [[t, p_s], ...]",
        bounds="t rising from 0, in s and MPa; left out = sealed_pressure",
        strict=False,
    )
    supply: Literal["flooded", "returned"] = key(
        "flooded", "supply of the instroke: flooded, or the film that the outstroke left on the rod"
    )
    cycles: int = key(3, "cycles to compute", ge=1, le=1000)
    time_order: Literal[1, 2] = key(2, "1: backward Euler, 2: BDF2", bounds="1 or 2")
    animation: bool = key(False, "whether the last cycle is drawn as cycle.gif")
    time_tolerance: float = key(0.02, "error of h in a step, relative to it", gt=0, le=0.5)

    @classmethod
    def completed(cls, values: dict[str, Any]) -> dict[str, Any]:
        """As for the O-ring, and motion by words or from a file.  ValueError."""
        return super().completed(motion_keys(values))

    @model_validator(mode="after")
    def _moves(self) -> Self:
        if self.cavitation == "penalty":
            raise ValueError(
                'cavitation = "penalty" does not conserve oil over a cycle; leave cavitation out'
            )
        if self.rubs:
            raise ValueError(
                f"housing_friction = {self.housing_friction:g} is not available in a cycle, which "
                "holds the section; leave housing_friction out"
            )
        if self.heating:
            raise ValueError(
                "heating = true: the heat of a film is known in steady state only, not in a cycle; "
                "leave heating out"
            )
        if not self.path.speed.largest > 0.0 or not self.path.speed.values[0] > 0.0:
            raise ValueError("motion: the rod must begin with an outstroke, U > 0 at t = 0")
        if min(self.path.pressure.values) < 0.0:
            lowest = min(self.path.pressure.values)
            raise ValueError(
                f"pressures: {lowest:g} MPa; a sealed pressure is 0 or more, above the air side"
            )
        require_films(self, self.path.pressure.largest)
        return self

    @property
    def conserving(self) -> bool:
        """Always."""
        return True

    @property
    def path(self) -> RodMotion:
        """The motion of the rod."""
        pressure = self.pressures or self.sealed_pressure
        if self.motion is not None:
            return RodMotion.of(self.motion, pressure)
        if self.shape == "sine":
            return RodMotion.sine(self.travel, self.frequency, pressure)
        return RodMotion.trapezoid(self.travel, self.frequency, self.ramp, pressure)


_OF_STEADY_FILMS = (
    *("speeds", "stroke", "error_estimate", "tolerance", "sensitivity", "tolerances"),
)
"""Keys of the seal that a cycle has no use for."""

_WITHOUT_TABLE = ("travel", "frequency", "shape", "ramp")
"""Keys of which a table of the motion takes the place."""


def unused(p: Cycle) -> list[str]:
    """Which of these were given, in words."""
    fields = type(p).model_fields
    set_keys = [key for key in fields if getattr(p, key) != fields[key].default]
    steady = [key for key in _OF_STEADY_FILMS if key in set_keys]
    table_keys = [key for key in _WITHOUT_TABLE if key in set_keys and p.motion]
    return [
        *(f"{key} has no effect on a cycle, only on steady films" for key in steady),
        *(f"{key} has no effect beside a motion of its own" for key in table_keys),
    ]


BREAKAWAY = 0.1
"""Part of the largest speed up to which friction counts as that of breaking away."""


@dataclass(frozen=True, kw_only=True)
class CycleRow(Row):
    """A row of curve.csv: one cycle."""

    files = tuple(f"{name}_cycle_{{}}.csv" for name in ("loop", "film", "state", "section"))
    cycle: float = column("", "number of the cycle", head="cycle", number_format="g")
    leak_mm3: float = column(
        "mm3", "oil past the air end, + = out", head="leak", number_format=".4g"
    )
    leak_sealed_mm3: float = column("mm3", "oil past the sealed end, + = to the air side")
    friction_out_N: float = column("N", "largest friction", head="friction", number_format=".4g")
    friction_in_N: float = column("N", "least friction", head="friction", number_format=".4g")
    energy_mJ: float = column(
        "mJ", "work of friction on the rod", head="energy", number_format=".4g"
    )
    h_min_um: float = column(
        "um", "least film thickness at a node", head="h min", number_format=".4g"
    )
    p_max_MPa: float = column("MPa", "largest film pressure")
    asperity_load_percent: float = column("%", "largest share of asperities in the load")
    change_percent: float = column(
        "%",
        "change of energy and leaks against the cycle before",
        head="change",
        number_format=".2g",
        default=nan,
    )
    breakaway_N: float = column(
        "N",
        f"breakaway friction: the largest while the rod is slower than {BREAKAWAY:.0%} of its most",
        head="breakaway",
        number_format=".4g",
        default=nan,
    )
    lambda_ratio: float = column(
        "",
        "least mean gap of the film over the roughness",
        head="lambda",
        number_format=".2g",
        default=nan,
    )
    mass_error: float = column(
        "", "largest error of the balance of oil, relative to the oil in the film"
    )
    steps: int = column("", "steps in time", head="steps")
    newton_iterations: int = column("", "iterations of Newton's method")
    verdict: str = column("", "`ok`; `transient` where the change is above 1 % or not known")

    @property
    def order(self) -> tuple[float]:
        """As they follow each other."""
        return (self.cycle,)


def cycle_row(number: int, radius: float, films: Any, start: Any, last: Any) -> CycleRow:
    """A cycle in numbers; films: what happened in it, see `cases.seal.cycle.cycle_driver.Films`.

    start: the reading at its start, last: the row before it or None.
    """
    all_of_them, around = [start, *films.readings], 2.0 * pi * radius
    t, U, F = (
        np.array([getattr(r, name) for r in all_of_them])
        for name in ("t_s", "rod_speed_mm_s", "friction_N")
    )
    end, names = all_of_them[-1], ("content_mm2", "volume_air_mm2", "volume_sealed_mm2")
    content, out, came = (np.array([getattr(r, n) for r in all_of_them]) for n in names)
    balance = content + out - came
    row = CycleRow(
        cycle=float(number),
        leak_mm3=around * (end.volume_air_mm2 - start.volume_air_mm2),
        leak_sealed_mm3=around * (end.volume_sealed_mm2 - start.volume_sealed_mm2),
        friction_out_N=float(F.max()),
        friction_in_N=float(F.min()),
        energy_mJ=float(trapezoid(F * U, t)),
        h_min_um=min(r.h_min_um for r in films.readings),
        p_max_MPa=max(r.p_max_MPa for r in films.readings),
        asperity_load_percent=max(r.asperity_load_percent for r in films.readings),
        breakaway_N=float(np.abs(F[np.abs(U) <= BREAKAWAY * np.abs(U).max()]).max(initial=0.0)),
        lambda_ratio=min(r.lambda_ratio for r in films.readings),
        mass_error=float(np.ptp(balance) / start.content_mm2),
        steps=len(films.readings),
        newton_iterations=sum(r.iterations for r in films.readings),
        verdict=TRANSIENT,
    )
    if last is None:
        return row
    through = max(abs(row.leak_mm3), 1e-3 * around * start.content_mm2)
    leak = abs(row.leak_mm3 - last.leak_mm3) / through
    change = 100.0 * max(leak, abs(row.energy_mJ / last.energy_mJ - 1.0))
    return replace(row, change_percent=change, verdict=OK if change < PERIODIC else TRANSIENT)


def cycle_tables(films: Any) -> list[dict[str, Array]]:
    """The friction loop with all readings, the film over time and place, where the next starts,
    and the outline of the section over time.
    """
    loop, film, outline = films.tables.values()
    return [loop, film, films.end, outline]


class CycleCase(Case[Cycle, CycleRow]):
    """Cycles of a reciprocating rod, one after the other."""

    name = "cycle"
    title = "reciprocating O-ring, a rod seal, in time: friction loop and leakage of every cycle"
    parameters, row = Cycle, CycleRow
    selection = ("cycles", "animation")
    files = (*(f"{n}.{k}" for n in ("rows", *PICTURES) for k in KINDS), ANIMATION)

    left_out = tuple(limit for limit in LEFT_OUT if not limit.startswith(("Time", "Breakaway")))

    def assumed(self, parameters: Cycle, set_keys: Collection[str]) -> list[str]:
        """See :class:`Case`."""
        return assumed(parameters, set_keys)

    def warnings(self, parameters: Cycle) -> list[str]:
        """See :class:`Case`."""
        highest = parameters.path.pressure.largest
        messages = [*warnings(parameters, highest), *unused(parameters), *parameters.path.defects()]
        if parameters.rough:
            return messages
        return [
            *messages,
            "between smooth surfaces a reversal squeezes the film to nanometres; give a roughness "
            "(rms of the seal in um, 0.2 to 0.4 is usual)",
        ]

    def summary(self, parameters: Cycle, rows: Sequence[CycleRow]) -> list[str]:
        """See :class:`Case`: the last cycle."""
        if not rows:
            return []
        row = rows[-1]
        end = "" if row.verdict == OK else f" ({row.verdict}: more cycles may change it)"
        leak = leaks(row.leak_mm3)
        if parameters.path.drift:
            leak = f"{row.leak_mm3:+.3g} mm3 past the air end, by a rod that does not come back"
        elif row.leak_mm3 > 0.0:
            path = parameters.path
            travel = 0.5 * path.distance
            leak += f", {far(row.leak_mm3, travel, parameters.service, path.period)}"
        back = f", {-row.friction_in_N:.3g} N in" if row.friction_in_N < 0.0 else ""
        friction = f"friction {row.friction_out_N:.3g} N out{back} at most"
        parts = [f"cycle {row.cycle:g}: {leak}", friction]
        if isfinite(row.breakaway_N):
            parts.append(f"{row.breakaway_N:.3g} N to break away")
        parts.append(f"its work {row.energy_mJ:.4g} mJ")
        if isfinite(row.lambda_ratio):
            parts.append(f"least lambda {row.lambda_ratio:.2g}")
        line = f"{'; '.join(parts)}{end}"
        if row.lambda_ratio < MIXED:
            line = Alarm(f"{line}; film below the roughness of the surfaces")
        return [line]

    def caption(self, rows: Sequence[CycleRow]) -> str:
        """See :class:`Case`."""
        return "Friction loop and leakage of every cycle"

    def titled(self, parameters: Cycle) -> str:
        """See :class:`Case`."""
        return titled(self.title, parameters)

    def report(self, runs: Sequence[FinishedRun]) -> Sequence[Part]:
        """See :class:`Case`."""
        from softehl.cases.seal.report.parts import cycle_parts

        return cycle_parts(runs)

    def foreword(self, parameters: Cycle) -> list[str]:
        """See :class:`Case`."""
        return foreword(parameters, parameters.path.pressure.largest)

    def requested(self, parameters: Cycle) -> list[float]:
        """See :class:`Case`."""
        return [float(n + 1) for n in range(parameters.cycles)]

    def pieces(self, parameters: Cycle, rows: Sequence[CycleRow], jobs: int) -> list[Cycle]:
        """See :class:`Case`; a run that goes on starts from the last cycle that is there."""
        return [] if len(rows) >= parameters.cycles else [parameters]

    def piece_name(self, piece: Cycle) -> str:
        """See :class:`Case`."""
        return f"{piece.cycles} cycles"

    def solve(self, parameters: Cycle, observer: Observer, shared: Path | None) -> Outcome[Any]:
        """See :class:`Case`."""
        from softehl.cases.seal.cycle.cycle_driver import run_cycles

        def log(number: int, films: Any, start: Any, last: Any) -> CycleRow:
            row = cycle_row(number, 0.5 * abs(parameters.rod_diameter), films, start, last)
            observer.state(State(row, cycle_tables(films)))
            return row

        return run_cycles(parameters, parameters.path, observer, log)

    def stage_label(self, name: str, marks: Mapping[str, Any]) -> tuple[str, Mapping[str, Any]]:
        """See :class:`Case`."""
        return stage_label(name, marks)

    def cautions(self, parameters: Cycle) -> list[str]:
        """See :class:`Case`."""
        return cautions(parameters)

    def draw(
        self,
        parameters: Cycle,
        folder: Path,
        rows: Sequence[CycleRow],
        rejected: Sequence[CycleRow],
        kinds: Sequence[str],
    ) -> None:
        """See :class:`Case`: friction loops, and the film of the last cycle."""
        if not kinds:
            return
        from softehl.cases.seal.report.cycle import loop_figure, map_figure, write_animation
        from softehl.cases.seal.report.style import drawing

        loops = {row.label(row.key): read_table(folder / row.file_names()[0]) for row in rows}
        columns = ("place_mm", "friction_N", "flux_air_mm2_s")
        draw_columns(folder / "rows", loops, columns, kinds)
        names, last = rows[-1].file_names(), [*loops.values()][-1]
        film, outline = (read_table(folder / names[k]) for k in (1, 3))
        with drawing():
            save(loop_figure(loops, [row.energy_mJ for row in rows]), folder / PICTURES[0], kinds)
            save(map_figure(film, last), folder / PICTURES[1], kinds)
            if parameters.animation:
                write_animation(folder / ANIMATION, parameters, film, last, outline)


CASE = CycleCase()
