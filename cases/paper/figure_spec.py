"""Specification of a table or figure: the runs that it needs, and the product made of them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from softehl.cases.paper.states import SPEEDS, Request, RequestedState, Store
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records import DENSITIES
from softehl.runtime.io import Cell

if TYPE_CHECKING:  # imported late: matplotlib is slow to import
    from matplotlib.figure import Figure

STUDY_DENSITIES = DENSITIES[1:]
"""Densities that mesh studies compare."""


@dataclass(frozen=True)
class Scope:
    """Fineness and extent of a reproduction.

    density: mesh density, None = the default of each item; never finer than the paper's own.
    speeds: rod speeds |U| to be kept, None = all; where an item has none of them, it takes the
    nearest one instead. pressures: the same for p_s (tests run a small version of every figure).
    """

    density: int | None = None
    speeds: tuple[float, ...] | None = None
    pressures: tuple[float, ...] | None = None

    def mesh(self, paper: int, default: int = 4) -> int:
        """The density of an item that has one."""
        return min(self.density or default, paper)

    def meshes(self, paper: Sequence[int], default: int = 4) -> tuple[int, ...]:
        """The densities of an item that compares several: the paper's, up to the finest one."""
        finest = self.density or default
        return tuple(d for d in paper if d <= finest) or (finest,)

    def speed(self, target: float) -> float:
        """The speed |U| that stands for a single one of the paper."""
        return _nearest(target, self.speeds)

    def some_speeds(self, targets: Sequence[float] = SPEEDS) -> tuple[float, ...]:
        """The speeds |U| that stand for several of the paper, falling."""
        return tuple(sorted({self.speed(u) for u in targets}, reverse=True))

    def some_pressures(self, targets: Sequence[float]) -> tuple[float, ...]:
        """The sealed pressures that stand for several of the paper, rising."""
        return tuple(sorted({_nearest(p, self.pressures) for p in targets}))

    def pressure(self, target: float) -> float:
        """The sealed pressure that stands for a single one of the paper."""
        return _nearest(target, self.pressures)


def _nearest(target: float, allowed: Sequence[float] | None) -> float:
    return min(allowed, key=lambda value: abs(value - target)) if allowed else target


@dataclass(frozen=True)
class CsvTable:
    """Header and rows of a CSV file."""

    header: tuple[str, ...]
    rows: Sequence[Sequence[Cell]]


@dataclass(frozen=True, eq=False)
class FigureContent:
    """Tables and picture of an item.

    tables: file stem -> table. caption: text below the picture. draw: fills a figure of `size`
    inches, None for a table.
    """

    tables: Mapping[str, CsvTable]
    caption: str
    draw: "Callable[[Figure], None] | None" = None
    size: tuple[float, float] = (7.2, 3.4)


@dataclass(frozen=True)
class Item:
    """A table, a figure or a check: its title, its runs and what is made of them."""

    name: str
    title: str
    make: Callable[[Store, Scope], FigureContent]
    requests: Callable[[Scope], list[Request]] = field(default=lambda scope: [])


STATE_COLUMNS = (
    *("series", "density", "reynolds", "pressure_order", "solid", "quadrature"),
    *("pressure_viscosity", "shear_traction", "sealed_pressure_MPa", "rod_speed_mm_s"),
    *("h_star_um", "h_min_um", "p_max_MPa", "pressure_jump_max_MPa", "rod_friction_N"),
    *("oscillation_index", "inlet_segments", "verdict"),
)
_FROM_ROW = STATE_COLUMNS[10:-1]


def state_table(series: Sequence[tuple[str, RequestedState]]) -> CsvTable:
    """The states of a figure with the label of the series that each belongs to."""
    return CsvTable(STATE_COLUMNS, [_state_row(label, state) for label, state in series])


def _state_row(label: str, state: RequestedState) -> list[Cell]:
    p = state.setup
    numbers = [getattr(state.row, name) if state.row else float("nan") for name in _FROM_ROW]
    return [
        *(label, p.density, p.reynolds, p.pressure_order, p.solid, p.quadrature),
        *(p.pressure_viscosity, str(p.shear_traction).lower(), p.sealed_pressure, state.rod_speed),
        *numbers,
        state.verdict,
    ]


PROFILE_HEADER = ("series", "verdict", "x_mm", "h_um", "p_MPa")


def profile_table(series: Sequence[tuple[str, RequestedState]]) -> CsvTable:
    """The profiles that are drawn, one below the other."""
    rows: list[Sequence[Cell]] = []
    for label, state in series:
        if state.usable:
            profile = state.profile
            values = np.column_stack([profile.x_mm, profile.h_um, profile.p_MPa]).tolist()
            rows += [(label, state.verdict, *row) for row in values]
    return CsvTable(PROFILE_HEADER, rows)


def density_words(used: int | Sequence[int], paper: int | Sequence[int]) -> str:
    """ "Mesh density 4 (paper: 16)."."""
    used_text, paper_text = (_join_densities(x) for x in (used, paper))
    return (
        f"Mesh density {used_text}."
        if used_text == paper_text
        else f"Mesh density {used_text} (paper: {paper_text})."
    )


def verdict_note(states: Sequence[RequestedState]) -> str:
    """The states whose verdict is not ok, by verdict; empty if there are none."""
    names_by_verdict: dict[str, list[str]] = {}
    for state in states:
        if not state.plain:
            names_by_verdict.setdefault(state.verdict, []).append(_short(state, states))
    named = [
        f"{verdict}: {', '.join(dict.fromkeys(names))}"
        for verdict, names in names_by_verdict.items()
    ]
    return f" Marked, because not ok - {'; '.join(named)}." if named else ""


def _short(state: RequestedState, among: Sequence[RequestedState]) -> str:
    """A state in as few words as tell it from the others."""
    parts = [f"U {state.rod_speed:+g}"]
    others: list[tuple[str, str]] = [
        ("sealed_pressure", "p_s"),
        ("density", "d"),
        ("reynolds", ""),
        ("pressure_order", "m_p"),
        ("solid", ""),
        ("quadrature", ""),
        ("pressure_viscosity", "alpha"),
    ]
    for key, symbol in others:
        if len({getattr(s.setup, key) for s in among}) > 1:
            value = getattr(state.setup, key)
            parts.append(f"{symbol} {value:g}" if symbol else str(value))
    return " ".join(parts)


def _join_densities(densities: int | Sequence[int]) -> str:
    return ", ".join(map(str, [densities] if isinstance(densities, int) else densities))


def both(speeds: Sequence[float]) -> list[float]:
    """Signed speeds of both strokes."""
    return [sign * u for sign in (1.0, -1.0) for u in speeds]


def with_all(base: Seal, **changes: object) -> Seal:
    """Copy of the parameters with some changed, checked again."""
    return Seal(**(base.model_dump() | changes))
