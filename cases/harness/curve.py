"""The curve of a run as a table on disk: its rows, and the files of each of its states."""

from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

from softehl.cases.harness.observer import COLLAPSED, OK, FilmState, Profile, Section
from softehl.runtime.io import (
    number_text,
    read_columns,
    read_csv,
    read_vtu,
    write_columns,
    write_csv,
    write_vtu,
)

PROFILE_COLUMNS = tuple(column.name for column in fields(Profile))


@dataclass(frozen=True)
class CurveRow:
    """One row of `curve.csv`; the fields are its columns, in order."""

    sealed_pressure_MPa: float
    rod_speed_mm_s: float
    h_star_um: float
    h_star_error_percent: float
    h_min_um: float
    p_max_MPa: float
    pressure_jump_max_MPa: float
    rod_friction_N: float
    leak_rate_mm3_s: float
    contact_start_mm: float
    contact_end_mm: float
    newton_iterations: int
    flux_variation: float
    moment_N_mm: float
    contact_p_max_MPa: float
    oscillation_index: float
    inlet_segments: float
    density: int
    verdict: str

    @classmethod
    def of(cls, state: FilmState) -> "CurveRow":
        """The row of a state."""
        same = {name: getattr(state, name) for name in CURVE_COLUMNS[2:]}
        return cls(state.sealed_pressure, state.rod_speed, **same)

    @classmethod
    def parse(cls, cells: Sequence[str]) -> "CurveRow":
        """The row from the text of its cells.  Raises ValueError."""
        *numbers, verdict = cells
        row: dict[str, Any] = dict(zip(CURVE_COLUMNS, map(float, numbers), strict=False))
        integers = {name: int(row[name]) for name in ("newton_iterations", "density")}
        return cls(**{**row, **integers}, verdict=verdict)

    @property
    def name(self) -> str:
        """The part of a file name that tells this state from the others of its folder."""
        return f"{number_text(self.sealed_pressure_MPa)}_{number_text(self.rod_speed_mm_s)}"

    @property
    def usable(self) -> bool:
        """Whether this is a result (a collapsed film never is)."""
        return self.verdict != COLLAPSED

    def within(self, tolerance: float) -> bool:
        """Whether h* is a plain result whose error is known to be at most so many per cent."""
        return self.verdict == OK and abs(self.h_star_error_percent) <= tolerance

    @property
    def stroke(self) -> str:
        """ "out" or "in"."""
        return "out" if self.rod_speed_mm_s > 0 else "in"

    @property
    def order(self) -> tuple[float, bool, float]:
        """Sort key of a curve: sealed pressure, outstroke first, falling |U|."""
        return self.sealed_pressure_MPa, self.rod_speed_mm_s < 0, -abs(self.rod_speed_mm_s)


CURVE_COLUMNS = tuple(column.name for column in fields(CurveRow))


class CurveFolder:
    """A curve.csv with the profile and section of each of its rows."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.rows: list[CurveRow] = []

    def load(self) -> None:
        """Take over the rows whose files are there.  Raises OSError, ValueError."""
        curve = self.path / "curve.csv"
        if curve.exists():
            rows = [CurveRow.parse(cells) for cells in read_csv(curve, CURVE_COLUMNS)]
            self.rows = [row for row in rows if all(map(Path.exists, self._files(row)))]

    def add(self, state: FilmState) -> CurveRow:
        """Write the files of a state, then the curve with its row."""
        row = CurveRow.of(state)
        self.path.mkdir(parents=True, exist_ok=True)
        profile = {name: getattr(state.profile, name) for name in PROFILE_COLUMNS}
        write_columns(self._profile_path(row), profile)
        write_section(self._section_path(row), state.section)
        others = [r for r in self.rows if r.rod_speed_mm_s != row.rod_speed_mm_s]
        self.rows = sorted([*others, row], key=lambda r: r.order)
        self.save()
        return row

    def drop(self, rod_speed: float) -> None:
        """Take a state out of the curve; its files stay until it is written again."""
        kept = [row for row in self.rows if row.rod_speed_mm_s != rod_speed]
        if len(kept) < len(self.rows):
            self.rows = kept
            self.save()

    def save(self) -> None:
        """Write curve.csv, a header alone if there is no row yet."""
        write_csv(self.path / "curve.csv", CURVE_COLUMNS, map(astuple, self.rows))

    def profiles(self) -> list[tuple[CurveRow, Profile]]:
        """Every row with its profile, read back.  Raises OSError, ValueError."""
        return [
            (row, Profile(**read_columns(self._profile_path(row), PROFILE_COLUMNS)))
            for row in self.rows
        ]

    def section(self, row: CurveRow) -> Section:
        """The section of a row, read back.  Raises OSError, ValueError."""
        return Section(*read_vtu(self._section_path(row)))

    def _files(self, row: CurveRow) -> tuple[Path, Path]:
        return self._profile_path(row), self._section_path(row)

    def _section_path(self, row: CurveRow) -> Path:
        return self.path / f"section_{row.name}.vtu"

    def _profile_path(self, row: CurveRow) -> Path:
        return self.path / f"profile_{row.name}.csv"


def write_section(path: Path, section: Section) -> None:
    """Write a deformed section as .vtu."""
    write_vtu(path, section.points, section.cells, section.point_data, section.cell_data)
