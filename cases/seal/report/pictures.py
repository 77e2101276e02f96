"""The pictures of a run: which there are, and what each is drawn from."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from softehl.cases.harness.pictures import save
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.report import style
from softehl.cases.seal.report.curve import curve_figure
from softehl.cases.seal.report.fit import fit_figure
from softehl.cases.seal.report.profiles import profiles_figure
from softehl.cases.seal.report.section import section_figure, views_of
from softehl.cases.seal.report.stribeck import stribeck_figure
from softehl.cases.seal.report.tables import fit_of, read_slopes
from softehl.cases.seal.report.tornado import tornado_figure
from softehl.cases.seal.states.observer_adapter import read_profile
from softehl.cases.seal.states.state import FilmRow


def write_plots(
    p: Seal,
    folder: Path,
    rows: Sequence[FilmRow],
    rejected: Sequence[FilmRow] = (),
    kinds: Sequence[str] = ("png",),
) -> None:
    """Draw every picture of a run, whose rows have their files in its folder, into the folder.

    kinds: of the files of each. Raises OSError, and ValueError where a profile or a section cannot
    be read back.
    """
    results, views = [(row, read_profile(folder, row)) for row in rows], views_of(folder, rows)
    head, slopes = style.subject(p), read_slopes(p, folder) if p.sensitivity else {}
    with style.drawing():
        figures = {
            "curve": curve_figure(head, rows, rejected),
            "profiles": profiles_figure(head, results),
            "fit": fit_figure(found) if (found := fit_of(p)) else None,
            "stribeck": stribeck_figure(p, rows),
            "tornado": tornado_figure(head, slopes) if slopes else None,
            "section": section_figure(p, views) if views else None,
        }
        for name, figure in figures.items():
            if figure:
                save(figure, folder / name, kinds)
