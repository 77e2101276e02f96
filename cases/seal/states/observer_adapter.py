"""From what a run of a seal tells to what the harness keeps, rows and files; and back."""

from dataclasses import dataclass
from pathlib import Path
from typing import Unpack

import numpy as np

from softehl.cases.harness import observer as harness
from softehl.cases.seal.states.sensitivity_table import SensitivityRow, rows_of
from softehl.cases.seal.states.state import (
    PROFILE_COLUMNS,
    ContactState,
    FilmRow,
    FilmState,
    Observer,
    Profile,
    Section,
    operating_point,
)
from softehl.runtime.io import number_text, read_columns, read_vtu


@dataclass(frozen=True)
class ObserverAdapter(Observer):
    """Passes on what a run tells to an observer of the harness."""

    to: harness.RunObserver

    def stage(self, name: str, *, sealed_pressure: float, stroke: str, steps: int | None) -> None:
        """See :class:`Observer`."""
        title = f"{name}, p_s = {sealed_pressure:g} MPa, stroke {stroke}"
        self.to.stage(name, title=title, where=operating_point(sealed_pressure, stroke))

    def step(self, **step: Unpack[harness.StepReport]) -> None:
        """See :class:`Observer`."""
        self.to.step(**step)

    def contact_state(self, state: ContactState) -> None:
        """Written as contact_<p_s>.csv and .vtu."""
        name = f"contact_{number_text(state.sealed_pressure)}"
        columns = {"x_mm": state.x_mm, "p_MPa": state.p_MPa}
        self.to.files({f"{name}.csv": columns, f"{name}.vtu": state.section})

    def film_state(self, state: FilmState) -> None:
        """A row, its profile and its section, and a file of its sensitivities."""
        row = FilmRow.part_of(state)
        if state.sensitivity:
            table = rows_of(row, state.sensitivity)
            columns = {n: np.array([getattr(r, n) for r in table]) for n in SensitivityRow.header()}
            self.to.files({f"sensitivity_{row.name}.csv": columns})
        self.to.state(harness.State(row, (vars(state.profile), state.section), state.advice))


def read_profile(folder: Path, row: FilmRow) -> Profile:
    """The profile of a row, read back.  Raises OSError, ValueError."""
    profile, _ = row.file_names()
    return Profile(**read_columns(folder / profile, PROFILE_COLUMNS))


def read_section(folder: Path, row: FilmRow) -> Section:
    """The section of a row, read back.  Raises OSError, ValueError."""
    _, section = row.file_names()
    return Section(*read_vtu(folder / section))
