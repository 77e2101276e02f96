"""Report of a sweep: runs compared by the numbers that the case judges them by."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite, nan
from pathlib import Path
from typing import Any

from softehl.cases.harness.case import AnyCase, find_named_case
from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.parameters import keys_of
from softehl.cases.harness.report.page import capital, input_part, left_out, read_finished
from softehl.cases.harness.report.part import FinishedRun, Part, ReportTable
from softehl.cases.harness.responses import titled, titled_value
from softehl.cases.harness.resume import advice_of
from softehl.runtime.io import Cell, read_json

_COLUMNS = 12  # of a table at most: random points have a value of their own each


@dataclass(frozen=True)
class SweepPoint:
    """A run of a sweep: its number, the values of its keys, how it ended, the run, its numbers."""

    number: int
    values: Mapping[str, Cell]
    status: str
    run: FinishedRun | None
    merits: Mapping[str, float]

    def merit(self, name: str) -> float:
        """A number that the run is judged by, nan where it has none."""
        return self.merits.get(name, nan)


@dataclass(frozen=True)
class FinishedSweep:
    """A sweep in a folder. keys: those that varied -> their units."""

    case: AnyCase
    keys: Mapping[str, str]
    points: Sequence[SweepPoint]
    title: str

    @property
    def names(self) -> list[str]:
        """The numbers that runs are judged by."""
        return list(dict.fromkeys(name for point in self.points for name in point.merits))

    def values_text(self, point: SweepPoint, keys: Sequence[str]) -> str:
        """The values of some keys of a run in words."""
        return ", ".join(titled_value(_plain(k), point.values[k], self.keys[k]) for k in keys)


def is_sweep(folder: Path) -> bool:
    """True if a folder holds a sweep."""
    try:
        return "points" in read_json(folder / "run.json")
    except (OSError, ValueError, TypeError):
        return False


def read_sweep(folder: Path, shipped: Mapping[str, str]) -> FinishedSweep:
    """The sweep in a folder.  Raises BadInput where it cannot be read or has no result yet."""
    try:
        content = read_json(folder / "run.json")
        case = find_named_case(content["case"], shipped)
        with (folder / "sweep.csv").open(encoding="utf-8", newline="") as file:
            rows = {int(row["run"]): row for row in csv.DictReader(file)}
        units = {key.name: key.unit for key in keys_of(case.parameters)}
        keys = {key: units[key] for key in content["keys"]}
        points = [_point(folder, number, row, keys, shipped) for number, row in rows.items()]
    except (OSError, ValueError, KeyError, TypeError) as error:
        reason = " ".join(str(error).split())[:120]
        raise BadInput(f"{folder} holds no sweep that can be read: {reason}") from None
    runs = [point.run for point in points if point.run is not None and point.run.rows]
    if not runs:
        raise BadInput(f"{folder} has no result yet: nothing to report")
    names = " and ".join(map(_plain, keys))
    return FinishedSweep(case, keys, points, f"{case.titled(runs[0].parameters)}; over {names}")


def sweep_parts(sweep: FinishedSweep) -> list[Part]:
    """Best and worst runs, a table and a plot of each number, every run."""
    *others, last = sweep.keys
    few = len({point.values[last] for point in sweep.points}) <= _COLUMNS
    parts = [_best(sweep)]
    for name in sweep.names:
        tables = [_pivot(sweep, name)] if others and few else []
        parts.append(Part(capital(name), plots=[_plot(sweep, name)], tables=tables))
    return [*parts, _same(sweep), *left_out(sweep.case), _every(sweep)]


def _same(sweep: FinishedSweep) -> Part:
    """The keys that are the same in all runs."""
    runs = [point.run for point in sweep.points if point.run is not None]
    first, *others = (run.parameters.model_dump() for run in runs)
    differ = [key for key in first if any(other[key] != first[key] for other in others)]
    named = replace(runs[0], folder=Path("all runs"), content={"status": "converged"})
    return input_part([named], without=[*differ, *sweep.keys])


def _point(
    folder: Path, number: int, row: Mapping[str, str], keys: Mapping[str, str], shipped: Any
) -> SweepPoint:
    try:
        run: FinishedRun | None = read_finished(folder / "runs" / f"{number:05d}", shipped)
    except BadInput:  # it is not possible, or did not begin
        run = None
    merits = run.case.merits(run.parameters, run.rows) if run and run.rows else {}
    values = {key: _value(row[key]) for key in keys}
    return SweepPoint(number, values, row["status"], run, merits)


def _plain(key: str) -> str:
    """A key for readers."""
    return key.replace("_", " ")


def _value(text: str) -> Cell:
    try:
        return float(text)
    except ValueError:
        return text


def _best(sweep: FinishedSweep) -> Part:
    """The runs with the least and the largest number of each kind."""
    rows: list[Sequence[Cell]] = []
    named = dict[int, SweepPoint]()
    for name in sweep.names:
        finite = [p for p in sweep.points if isfinite(p.merit(name))]
        if not finite:
            continue
        best = min(finite, key=lambda p: p.merit(name) * sweep.case.sense(name))
        worst = max(finite, key=lambda p: p.merit(name) * sweep.case.sense(name))
        named |= {p.number: p for p in (best, worst)}
        cells = [
            cell
            for p in (best, worst)
            for cell in (
                p.merit(name),
                f"{sweep.values_text(p, list(sweep.keys))} (run {p.number})",
            )
        ]
        rows.append((name, *cells))
    table = ReportTable("Of all runs with a result", ("", "best", "at", "worst", "at"), rows)
    failed = [p for p in sweep.points if p.status != "converged"]
    lines = [
        f"run {p.number}, {sweep.values_text(p, list(sweep.keys))}: {p.status}" for p in failed
    ]
    lines += [
        f"run {p.number}, {sweep.values_text(p, list(sweep.keys))}: {note}"
        for p in named.values()
        if p.run is not None
        for note in p.run.case.notes(p.run.rows, advice_of(p.run.content, p.run.rows))
    ]
    return Part("Best and worst", tables=[table], lines=lines)


def _pivot(sweep: FinishedSweep, name: str) -> ReportTable:
    """A number over the last key (columns) and all others (rows)."""
    *others, last = sweep.keys
    columns = list(dict.fromkeys(p.values[last] for p in sweep.points))
    cells_by_row: dict[str, dict[Cell, float]] = {}
    for p in sweep.points:
        cells_by_row.setdefault(sweep.values_text(p, others), {})[p.values[last]] = p.merit(name)
    header = ("", *(titled_value(_plain(last), value, sweep.keys[last]) for value in columns))
    rows: list[Sequence[Cell]] = [
        (label, *(cells.get(c, nan) for c in columns)) for label, cells in cells_by_row.items()
    ]
    return ReportTable(name, header, rows)


def _plot(sweep: FinishedSweep, name: str) -> Any:
    """A number over the first key, a line for each value of the others."""
    from softehl.cases.harness.report.plot import COLOURS, plot, put_legend_above

    first, *others = sweep.keys
    along = list(dict.fromkeys(p.values[first] for p in sweep.points))
    numbers = all(isinstance(value, float) for value in along)
    size: dict[str, Any] = {} if numbers else {"x_range": [str(value) for value in along]}
    panel = plot(titled(_plain(first), sweep.keys[first]), name, **size)
    lines: dict[str, list[tuple[Any, float]]] = {}
    for p in sweep.points:
        if isfinite(p.merit(name)):
            at = p.values[first] if numbers else str(p.values[first])
            lines.setdefault(sweep.values_text(p, others), []).append((at, p.merit(name)))
    for number, (label, points) in enumerate(lines.items()):
        x, y = zip(*(sorted(points) if numbers else points), strict=True)
        look: dict[str, Any] = {"color": COLOURS[number % len(COLOURS)]}
        if label and len(lines) <= len(COLOURS):
            look["legend_label"] = label
        panel.line(x, y, **look)
        panel.scatter(x, y, size=6, **look)
    if panel.legend:
        put_legend_above(panel, columns=1)
    return panel


def _every(sweep: FinishedSweep) -> Part:
    """Every run with its keys and numbers."""
    heads = (titled(_plain(key), unit) for key, unit in sweep.keys.items())
    rows: list[Sequence[Cell]] = [
        (p.number, *p.values.values(), p.status, *(p.merit(name) for name in sweep.names))
        for p in sweep.points
    ]
    table = ReportTable("Every run", ("run", *heads, "status", *sweep.names), rows)
    return Part("All runs", tables=[table], folded=True)
