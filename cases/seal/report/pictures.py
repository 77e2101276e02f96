"""The pictures of a run: which there are, and what each is drawn from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from softehl.cases.harness.curve import CurveFolder, CurveRow
from softehl.cases.seal.report import style
from softehl.cases.seal.report.curve import curve_figure
from softehl.cases.seal.report.profiles import profiles_figure
from softehl.cases.seal.report.section import View, section_figure

if TYPE_CHECKING:
    from softehl.cases.seal.parameters import ORing

PICTURES = ("curve", "profiles", "section")
"""Names of the files, each .png and .svg."""


def write_plots(p: ORing, curve: CurveFolder, rejected: Sequence[CurveRow] = ()) -> None:
    """Draw every picture of a run into its folder; none where it has no results.

    Raises OSError, and ValueError where a profile or a section cannot be read back.
    """
    if not curve.rows:
        return
    import matplotlib

    results = curve.profiles()
    fastest = _fastest(curve.rows)
    views = [View(row, at, curve.section(row)) for row, at in results if row in fastest]
    views = [view for view in views if view.complete]
    with matplotlib.rc_context(style.STYLE):
        style.save(curve_figure(p, curve.rows, rejected), curve.path / "curve")
        style.save(profiles_figure(p, results), curve.path / "profiles")
        if views:
            style.save(section_figure(p, views), curve.path / "section")


def _fastest(rows: Sequence[CurveRow]) -> list[CurveRow]:
    """Of each stroke the row of the highest speed: there the film changes the contact most."""
    return [
        max((row for row in rows if row.stroke == stroke), key=lambda row: abs(row.rod_speed_mm_s))
        for stroke in style.STROKES
        if any(row.stroke == stroke for row in rows)
    ]
