"""Files of the states of a seal: what is reported to be written, and how it is read back."""

from pathlib import Path

import numpy as np

from softehl.cases.harness.observer import Observer, State
from softehl.cases.seal.states.sensitivity_table import SensitivityRow, rows_of
from softehl.cases.seal.states.state import (
    PROFILE_COLUMNS,
    ContactState,
    FilmRow,
    FilmState,
    Profile,
    Section,
    contact_name,
)
from softehl.runtime.io import read_columns, read_vtu


def report_contact(observer: Observer, state: ContactState) -> None:
    """Report a dry contact: contact_<p_s>.csv and .vtu, unless the observer has `contact_state`."""
    if report := getattr(observer, "contact_state", None):
        report(state)
        return
    name = contact_name(state.sealed_pressure)
    columns = {"x_mm": state.x_mm, "p_MPa": state.p_MPa}
    observer.files({f"{name}.csv": columns, f"{name}.vtu": state.section})


def report_film(observer: Observer, state: FilmState) -> None:
    """Report a film, unless the observer has `film_state`: a row, its profile and its section.

    Its sensitivities are a file of their own.
    """
    if report := getattr(observer, "film_state", None):
        report(state)
        return
    row = FilmRow.part_of(state)
    if state.sensitivity:
        table = rows_of(row, state.sensitivity)
        columns = {n: np.array([getattr(r, n) for r in table]) for n in SensitivityRow.header()}
        observer.files({f"sensitivity_{row.name}.csv": columns})
    observer.state(State(row, (vars(state.profile), state.section), state.advice))


def read_profile(folder: Path, row: FilmRow) -> Profile:
    """The profile of a row, read back.  Raises OSError, ValueError."""
    profile, _ = row.file_names()
    return Profile(**read_columns(folder / profile, PROFILE_COLUMNS))


def read_section(folder: Path, row: FilmRow) -> Section:
    """The section of a row, read back.  Raises OSError, ValueError."""
    _, section = row.file_names()
    return Section(*read_vtu(folder / section))
