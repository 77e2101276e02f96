"""Motion of a rod and sealed pressure: tables over time that repeat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from softehl.runtime.discretisation import quadrature
from softehl.runtime.io import read_table

Rows = Sequence[Sequence[float]]
"""Times and values of a table."""


@dataclass(frozen=True)
class TimeTable:
    """Values over time, straight in between, the same again after the last time."""

    times: tuple[float, ...]
    values: tuple[float, ...]

    @classmethod
    def of(cls, rows: Rows, key: str = "motion") -> TimeTable:
        """From rows (time, value) of a key.  ValueError for times that do not rise from 0."""
        times = tuple(float(time) for time, _ in rows)
        values = tuple(float(value) for _, value in rows)
        if times[0] != 0.0 or len(times) < 2 or not np.all(np.diff(times) > 0.0):
            times_text = ", ".join(f"{t:g}" for t in times[:4]) + ", ..." * (len(times) > 4)
            raise ValueError(f"{key}: times {times_text}: at least two, rising from 0, in seconds")
        return cls(times, values)

    @property
    def period(self) -> float:
        """Time after which it repeats, s."""
        return self.times[-1]

    def at(self, t: float) -> float:
        """Value at a time."""
        return float(np.interp(t % self.period, self.times, self.values))

    def next_corner(self, t: float) -> float:
        """The first time after t at which its slope may jump."""
        start = self.period * np.floor(t / self.period + 1e-12)
        later = start + np.array([*self.times[1:], self.period + self.times[1]])
        return float(later[later > t + 1e-12 * self.period][0])

    @cached_property
    def largest(self) -> float:
        """Largest magnitude."""
        return max(abs(v) for v in self.values)


def _repeated(pressure: Rows | float, period: float) -> TimeTable:
    """A pressure over time from its rows, or one that is the same all the time.  ValueError."""
    if isinstance(pressure, int | float):
        return TimeTable.of([(0.0, pressure), (period, pressure)])
    return TimeTable.of(pressure, "pressures")


@dataclass(frozen=True)
class RodMotion:
    """A rod that moves at U(t), mm/s, + to the air side, under p_s(t), MPa.

    corners: whether U or p_s have corners that a step must not pass.
    """

    speed: TimeTable
    pressure: TimeTable
    corners: bool = True

    @classmethod
    def sine(cls, stroke: float, frequency: float, pressure: Rows | float) -> RodMotion:
        """U = pi f S cos(2 pi f t): the rod starts in the middle of its way, at outstroke.

        Straight between 241 times: right to 1e-4 of the largest speed.
        """
        t = np.linspace(0.0, 1.0 / frequency, 241)
        speed = pi * frequency * stroke * np.cos(2.0 * pi * frequency * t)
        return cls(TimeTable(tuple(t), tuple(speed)), _repeated(pressure, 1.0 / frequency), False)

    @classmethod
    def trapezoid(
        cls, stroke: float, frequency: float, ramp: float, pressure: Rows | float
    ) -> RodMotion:
        """Constant speeds with ramps of a share of the period each, from the middle of a way."""
        T = 1.0 / frequency
        U = stroke / (T * 0.5 * (1.0 - ramp))
        fractions = (0.0, 0.25 - ramp / 2, 0.25 + ramp / 2, 0.75 - ramp / 2, 0.75 + ramp / 2, 1.0)
        values = (U, U, -U, -U, U, U)
        return cls(TimeTable(tuple(T * s for s in fractions), values), _repeated(pressure, T))

    @classmethod
    def of(cls, rows: Rows, pressure: Rows | float) -> RodMotion:
        """From rows (time, speed).  ValueError."""
        speed = TimeTable.of(rows)
        return cls(speed, _repeated(pressure, speed.period))

    @property
    def period(self) -> float:
        """Time of a cycle, s."""
        return self.speed.period

    def defects(self) -> list[str]:
        """Why the rod does not go to and fro as the table repeats, in words; none if it does.

        One per cent of its way and of its largest speed is no defect: so well measured ones close.
        """
        values, messages = self.speed.values, []
        if self.drift:
            on = f"{self.drift:+.3g} mm farther in each cycle"
            messages.append(f"motion: the rod does not come back: {on}")
        if abs(values[0] - values[-1]) > 0.01 * self.speed.largest:
            messages.append(
                f"motion: the speed jumps from {values[-1]:g} to {values[0]:g} mm/s where it "
                "repeats; end it with the speed that it begins with"
            )
        return messages

    @property
    def drift(self) -> float:
        """Way by which a cycle moves the rod on, mm; 0 within one per cent of all its way."""
        on = self.position(self.period)
        return on if abs(on) > 0.01 * self.distance else 0.0

    @cached_property
    def distance(self) -> float:
        """Way of the rod in a cycle, out and back together, mm."""
        U, duration = np.array(self.speed.values), np.diff(self.speed.times)
        before, after = np.abs(U[:-1]), np.abs(U[1:])
        turns = U[:-1] * U[1:] < 0.0  # then the speed is two triangles
        mean = 0.5 * (before + after)
        mean[turns] = 0.5 * (before**2 + after**2)[turns] / (before + after)[turns]
        return float(mean @ duration)

    def position(self, t: float) -> float:
        """Way of the rod since t = 0, mm."""
        cycles, remainder = divmod(t, self.period)
        return float(cycles * self._position(self.period) + self._position(remainder))

    @cached_property
    def _position(self) -> BSpline:
        return make_interp_spline(self.speed.times, self.speed.values, k=1).antiderivative()


@dataclass
class RodFilm:
    """Film that an outstroke leaves on the rod, for the instroke that brings it back.

    positions: of the rod, mm, where it passed the air side; films: thickness there, as h* of (16),
    mm.
    """

    positions: list[float]
    films: list[float]

    def leave(self, position: float, film: float) -> None:
        """A film at a new place; what was there before is forgotten."""
        while self.positions and self.positions[-1] >= position:
            self.positions.pop()
            self.films.pop()
        self.positions.append(position)
        self.films.append(max(film, 0.0))

    def thickness_at(self, position: float) -> float | None:
        """The film at a place, None where nothing was left: the rod is new there."""
        if not self.positions or not self.positions[0] <= position <= self.positions[-1]:
            return None
        return float(np.interp(position, self.positions, self.films))


def motion_keys(values: dict[str, Any]) -> dict[str, Any]:
    """Keys in which `motion` is a list or left out: words and files are read.  ValueError."""
    motion = values.get("motion")
    if isinstance(motion, dict):
        key_names = {"stroke": "travel", "frequency": "frequency", "shape": "shape", "ramp": "ramp"}
        unknown = [name for name in motion if name not in key_names]
        if unknown:
            raise ValueError(
                f"motion: {unknown[0]!r} is not known; there are {', '.join(key_names)}"
            )
        renamed = {key_names[name]: value for name, value in motion.items()}
        for key, value in renamed.items():
            if values.get(key) not in (None, value):
                raise ValueError(
                    f"{key} = {values[key]} and motion contradict: the latter gives {value}; leave "
                    "one of them out"
                )
        return {**{k: v for k, v in values.items() if k != "motion"}, **renamed}
    if isinstance(motion, str):
        try:
            table = read_table(Path(motion))
            rows = list(zip(table["t_s"].tolist(), table["U_mm_s"].tolist(), strict=True))
        except (OSError, KeyError, ValueError) as error:
            raise ValueError(f"motion = {motion!r}: no CSV with t_s, U_mm_s ({error})") from None
        return {**values, "motion": rows}
    return values


def missing(supply: float, outer: float, inner: float, order: int) -> float:
    """Void fraction of an end of the film to which the rod brings a film of this thickness (mm).

    outer, inner: h at this end and at the other of its segment, mm, which has `order` subcells.
    Of the outmost one the rod carries h_1 h_2 over their mean (`codegen/models/mixed_film.py`).
    """
    share = 0.5 * (1.0 + quadrature.pressure_nodes(order)[1])
    next_to = outer + share * (inner - outer)
    return float(max(0.0, 1.0 - supply * 0.5 * (outer + next_to) / (outer * next_to)))
