"""The pictures of a run: which there are, and what each is drawn from."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from softehl.cases.harness.pictures import save
from softehl.cases.seal.report import style
from softehl.cases.seal.report.curve import curve_figure
from softehl.cases.seal.report.fit import fit_figure, fit_of, write_residuals
from softehl.cases.seal.report.profiles import profiles_figure
from softehl.cases.seal.report.section import View, section_figure
from softehl.cases.seal.report.stribeck import stribeck_figure
from softehl.cases.seal.states.observer_adapter import read_profile, read_section
from softehl.cases.seal.states.state import FilmRow

if TYPE_CHECKING:
    from softehl.cases.seal.gland.parameters import Seal

PICTURES = ("curve", "profiles", "section")
"""Names of the files, each .png or .svg or both, of every run."""

SOME = ("fit", "stribeck")
"""Pictures of rubbers that were fitted to tests, and of rough surfaces."""


def write_plots(
    p: Seal,
    folder: Path,
    rows: Sequence[FilmRow],
    rejected: Sequence[FilmRow] = (),
    kinds: Sequence[str] = ("png",),
) -> None:
    """Draw every picture of a run, whose rows have their files in its folder, into the folder.

    kinds: of the files of each; none if empty. Raises OSError, and ValueError where a profile or a
    section cannot be read back.
    """
    if found := fit_of(p, p.temperature):
        write_residuals(found, folder / "fit.csv")
    if not kinds:
        return
    import matplotlib

    results = [(row, read_profile(folder, row)) for row in rows]
    fastest = _fastest(rows)
    views = [View(row, at, read_section(folder, row)) for row, at in results if row in fastest]
    views, head = [view for view in views if view.complete], style.subject(p)
    with matplotlib.rc_context(style.STYLE):
        save(curve_figure(head, rows, rejected), folder / "curve", kinds)
        save(profiles_figure(head, results), folder / "profiles", kinds)
        if found:
            save(fit_figure([found]), folder / "fit", kinds)
        if stribeck := stribeck_figure(p, rows):
            save(stribeck, folder / "stribeck", kinds)
        if views:
            save(section_figure(p, views), folder / "section", kinds)


def _fastest(rows: Sequence[FilmRow]) -> list[FilmRow]:
    """Of each stroke the row of the highest speed: there the film changes the contact most."""
    return [
        max((row for row in rows if row.stroke == stroke), key=lambda row: abs(row.rod_speed_mm_s))
        for stroke in style.STROKES
        if any(row.stroke == stroke for row in rows)
    ]
