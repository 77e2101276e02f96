"""The pictures of a run: which there are, and what each is drawn from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from io import BytesIO
from typing import TypeAlias

from matplotlib.figure import Figure

from softehl.cases.harness.pictures import save
from softehl.cases.harness.report.part import FinishedRun, Picture
from softehl.cases.seal.report import style
from softehl.cases.seal.report.curve import curve_figure
from softehl.cases.seal.report.fit import fit_figure
from softehl.cases.seal.report.profiles import profiles_figure
from softehl.cases.seal.report.section import section_figure, views_of
from softehl.cases.seal.report.stribeck import stribeck_figure
from softehl.cases.seal.report.tables import fit_of, read_slopes
from softehl.cases.seal.report.tornado import tornado_figure
from softehl.cases.seal.states.observer_adapter import read_profile

Draw: TypeAlias = Callable[[FinishedRun], Figure | None]
"""Draws a run, whose rows have their files in its folder; None where it has nothing to show.

Raises OSError, and ValueError where a file cannot be read back.
"""


def _fit(run: FinishedRun) -> Figure | None:
    try:
        found = fit_of(run.parameters)
    except ValueError:
        return None  # the table of tests is elsewhere now
    return fit_figure(found) if found else None


def _tornado(run: FinishedRun) -> Figure | None:
    slopes = read_slopes(run.parameters, run.folder)
    return tornado_figure(style.subject(run.parameters), slopes) if slopes else None


def _section(run: FinishedRun) -> Figure | None:
    views = views_of(run.folder, run.rows)
    return section_figure(run.parameters, views) if views else None


FIGURES: Mapping[str, Draw] = {
    "curve": lambda run: curve_figure(style.subject(run.parameters), run.rows, run.rejected),
    "profiles": lambda run: profiles_figure(
        style.subject(run.parameters), [(row, read_profile(run.folder, row)) for row in run.rows]
    ),
    "fit": _fit,
    "stribeck": lambda run: stribeck_figure(run.parameters, run.rows),
    "tornado": _tornado,
    "section": _section,
}
"""Pictures of a run by the names of their files."""


def write_plots(run: FinishedRun, kinds: Sequence[str] = ("png",)) -> None:
    """Draw every picture of a run into its folder.  kinds: of the files of each.  See `Draw`."""
    with style.drawing():
        for name, draw in FIGURES.items():
            if figure := draw(run):
                save(figure, run.folder / name, kinds)


def pictures_of(
    runs: Sequence[FinishedRun],
    draw: Draw,
    caption: Callable[[FinishedRun], str] = lambda run: run.name,
) -> list[Picture]:
    """Pictures for a page, of the runs that have something to show."""
    with style.drawing():
        found = [(caption(run), draw(run)) for run in runs]
        return [Picture(words, _png(figure)) for words, figure in found if figure]


def _png(figure: Figure) -> bytes:
    found = BytesIO()
    figure.savefig(found, format="png", dpi=130)
    return found.getvalue()
