"""Lookup of states by density, pressure and speed, and measures of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite, nan
from typing import Any

import numpy as np

from softehl.cases.paper.figure_spec import Scope
from softehl.cases.paper.states import RequestedState, Store, setup
from softehl.cases.seal.states.state import FilmRow
from softehl.runtime.arrays import Array


@dataclass(frozen=True)
class Finding:
    """A measured value in words, and whether the statement holds (None: not known)."""

    text: str
    holds: bool | None


@dataclass(frozen=True)
class Query:
    """States by density, p_s and U; each that is given is replaced by what the scope has."""

    store: Store
    scope: Scope

    @property
    def density(self) -> int:
        """The density of figures that the paper makes with 16."""
        return self.scope.mesh(16)

    @property
    def speeds(self) -> tuple[float, ...]:
        """All speeds |U|, falling."""
        return self.scope.some_speeds()

    @property
    def pressures(self) -> tuple[float, ...]:
        """The pressures of the matrix, rising."""
        return self.scope.some_pressures((0.0, 1.0, 2.0, 5.0))

    def state(self, density: int, p_s: float, speed: float, **others: Any) -> RequestedState:
        """A state at a signed speed."""
        u = self.scope.speed(abs(speed)) * (1.0 if speed > 0 else -1.0)
        return self.store.state(setup(density, self.scope.pressure(p_s), **others), u)

    def row(self, density: int, p_s: float, speed: float, **others: Any) -> FilmRow:
        """Its numbers.  Raises ValueError where there are none, or the film collapsed."""
        state = self.state(density, p_s, speed, **others)
        if state.row is None or not state.usable:
            raise ValueError(f"{state.title}: {state.verdict}")
        return state.row

    def h(self, density: int, p_s: float, speed: float, **others: Any) -> float:
        """h* in um, nan where there is none."""
        return self.state(density, p_s, speed, **others).h_star


Measure = Callable[[Query], Finding]
"""Measure of a statement.  Raises ValueError where a state that it needs was not reached."""


def all_hold(tests: Sequence[tuple[float, float]]) -> tuple[int, int]:
    """Number of pairs that rise, and number of pairs that have both values."""
    finite = [(a, b) for a, b in tests if isfinite(a) and isfinite(b)]
    return sum(a < b for a, b in finite), len(finite)


def counted(tests: Sequence[tuple[float, float]], what: str) -> Finding:
    """ "27 of 28 pairs ...": holds if all do."""
    count, total = all_hold(tests)
    return Finding(f"{what}: {count} of {total}", count == total if total else None)


def numbers(values: Sequence[float], form: str = ".3g") -> str:
    """Numbers with blanks between, a dash for none."""
    return " ".join(format(v, form) if isfinite(v) else "-" for v in values)


def angle(x: Array, h: Array, low: float, high: float) -> float:
    """Inclination in degrees of h (n,) in um over x (n,) in mm, between two thicknesses.

    The points run away from the contact; the first crossings of low and high are taken.
    """
    above = [np.flatnonzero(h >= level) for level in (low, high)]
    if not len(above[0]) or not len(above[1]):
        return nan
    at = [
        _crossing(x, h, int(indices[0]), level)
        for indices, level in zip(above, (low, high), strict=True)
    ]
    return float(np.degrees(np.arctan2(1e-3 * (high - low), abs(at[1] - at[0]))))


def _crossing(x: Array, h: Array, i: int, level: float) -> float:
    if i == 0:
        return float(x[0])
    share = (level - h[i - 1]) / (h[i] - h[i - 1])
    return float(x[i - 1] + share * (x[i] - x[i - 1]))


def ripple(state: RequestedState) -> float:
    """Largest rise of h towards the outlet before the dip, in h*; nan if there is no film.

    A smooth film falls from the inlet to the dip at the outlet: what rises on the way is an
    oscillation. Unlike the index of `curve.csv` this includes the surroundings of the dip.
    """
    if not state.usable:
        return nan
    profile = state.profile
    h = profile.h_um if state.rod_speed > 0 else profile.h_um[::-1]
    first = int(np.argmax(h < 1.5 * state.h_star))
    thin = np.flatnonzero(h < state.h_star)
    if not len(thin):
        return nan
    last = int(thin[-1])
    while last > first and h[last - 1] <= h[last]:
        last -= 1
    film = h[first : last + 1]
    return float((film - np.minimum.accumulate(film)).max() / state.h_star)


def difference(a: RequestedState, b: RequestedState, margin: float = 0.0) -> float:
    """Largest difference of the pressures of two states over the contact of b, MPa.

    margin: share of the contact left out at either end.
    """
    first, second = a.profile, b.profile
    assert b.row is not None
    start, end = b.row.contact_start_mm, b.row.contact_end_mm
    cut = margin * (end - start)
    inside = (second.x_mm > start + cut) & (second.x_mm < end - cut)
    other = np.interp(second.x_mm[inside], first.x_mm, first.p_MPa)
    return float(np.abs(other - second.p_MPa[inside]).max())
