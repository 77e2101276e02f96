"""The tables that a person reads and the JSON that a program reads."""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from rich.table import Table

from benchmarks.measure import NOBODY, Best, Measured, Row
from benchmarks.routes import OURS

HEADINGS = (
    ("generator", "route", "compiler"),
    ("derive s", "compile s", "operations", "error", "ns", "least", "ratio", "% peak"),
    ("own flags ns", "least", "ratio"),
)


def fastest(rows: Iterable[Row]) -> list[Row]:
    """Of each generator and compiler the fastest verified route (all of ours)."""
    chosen: dict[tuple[str, str], Row] = {}
    for row in rows:
        key = (row.route if row.generator == OURS.title else row.generator, row.compiler)
        if key not in chosen or _rank(row) < _rank(chosen[key]):
            chosen[key] = row
    return list(chosen.values())


def _rank(row: Row) -> float:
    return float("inf") if row.nanoseconds is None else row.nanoseconds


def percent_of_peak(operations: int | None, nanoseconds: float | None, peak: float) -> float | None:
    """Operations as written per ns, in percent of the peak [operations per ns]."""
    if operations is None or nanoseconds is None:
        return None
    return 100 * operations / nanoseconds / peak


def table(title: str, rows: Sequence[Row], peak: float) -> Table:
    """One case; `peak` in operations per ns.  Who has no C at all stands below, with the reason."""
    words, numbers, own = HEADINGS
    absent = [f"{r.generator}, {r.route}: {r.outcome}" for r in rows if r.compiler == NOBODY]
    out = Table(*words, title=f"{title}   (multiply-add peak {peak:.1f} GFLOP/s)")
    out.caption = "\n".join(absent) or None
    for heading in (*numbers, *own):
        out.add_column(heading, justify="right")
    for r in rows:
        if r.compiler == NOBODY:
            continue
        used = percent_of_peak(r.operations, r.nanoseconds, peak)
        out.add_row(
            r.generator,
            r.route,
            r.compiler,
            _number(r.derive_seconds, ".2f"),
            _number(r.compile_seconds, ".1f"),
            _number(r.operations, "d"),
            _number(r.error, ".0e"),
            r.outcome or _number(r.nanoseconds, ".1f"),
            _number(r.least_nanoseconds, ".1f"),
            _number(r.ratio, ".2f"),
            _number(used, ".0f"),
            _number(r.own_nanoseconds, ".1f"),
            _number(r.own_least_nanoseconds, ".1f"),
            _number(r.own_ratio, ".2f"),
        )
    return out


def best_table(best: Iterable[Best], peaks: Mapping[str, float]) -> Table:
    """Every generator at its best."""
    out = Table("case", "generator", "route", "compiler", "flags", title="each at its best")
    for heading in ("ns", "least", "ratio", "% peak"):
        out.add_column(heading, justify="right")
    for b in best:
        used = percent_of_peak(b.operations, b.nanoseconds, peaks[b.case])
        names = (b.case, b.generator, b.route, b.compiler, b.flags)
        least = f"{b.least_nanoseconds:.1f}"
        out.add_row(*names, f"{b.nanoseconds:.1f}", least, f"{b.ratio:.2f}", _number(used, ".0f"))
    return out


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


def write_json(path: Path, measured: Mapping[str, Measured], rounds: int) -> None:
    """Everything that was measured, all routes, by the title of the case."""
    cases = {title: dataclasses.asdict(m) for title, m in measured.items()}
    text = json.dumps({"rounds": rounds, "cases": cases}, indent=1) + "\n"
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    part.write_text(text, encoding="utf-8")
    os.replace(part, path)
