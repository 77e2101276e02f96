"""Parts of the report of cycles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from softehl.cases.harness.report.part import FinishedRun, Part, Picture, Table
from softehl.cases.seal.report import style
from softehl.cases.seal.report.parts import gland

if TYPE_CHECKING:
    from softehl.runtime.io import Cell


def cycle_parts(runs: Sequence[FinishedRun], pictures: Sequence[str]) -> list[Part]:
    """Cycles in numbers, the pictures (names without .png) that the runs have, the glands."""
    import matplotlib

    titles = {"friction_loop": "Friction loop", "film_map": "Film over time and place"}
    shown = (titles.get(name, name) for name in pictures)
    parts = (
        Part(title, pictures=_found(runs, n)) for title, n in zip(shown, pictures, strict=True)
    )
    with matplotlib.rc_context(style.STYLE):
        seals = gland(runs)
    return [_numbers(runs), *(part for part in parts if part.pictures), seals]


def _numbers(runs: Sequence[FinishedRun]) -> Part:
    columns = [c for c in runs[0].case.row.columns() if c.head]
    header = [
        "run",
        *(f"{c.meaning}{f' [{c.unit}]' if c.unit else ''}" for c in columns),
        "verdict",
    ]
    rows: list[Sequence[Cell]] = [
        (run.name, *(getattr(row, c.name) for c in columns), row.verdict)
        for run in runs
        for row in run.rows
    ]
    text = "A cycle is periodic where it differs from the one before by less than 1 %."
    return Part("Cycles", text, tables=[Table("Every cycle", header, rows)])


def _found(runs: Sequence[FinishedRun], name: str) -> list[Picture]:
    paths = [(run.name, run.folder / f"{name}.png") for run in runs]
    return [Picture(title, path.read_bytes()) for title, path in paths if path.exists()]
