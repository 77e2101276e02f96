"""From the folders of runs to a report: `report.html`, and the tables as `report.xlsx`."""

from __future__ import annotations

import base64
import os
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

from softehl.cases.harness.case import Alarm, AnyCase, find_named_case
from softehl.cases.harness.curve_folder import CurveFolder
from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.parameters import keys_of
from softehl.cases.harness.report.part import FinishedRun, Part, ReportTable
from softehl.cases.harness.resume import advice_of, disbelief, edited_table
from softehl.runtime.io import Cell, read_json, replacing, write_text

_HERE = Path(__file__).parent
_SHEET_NAME = 31  # letters, by the file format
_AGAIN = "softehl run --resume computes it again"
_MISSING = "softehl report needs Bokeh and openpyxl: pip install 'softehl[report]'"


def read_finished(folder: Path, shipped: Mapping[str, str]) -> FinishedRun:
    """The run in a folder.  Raises BadInput where there is none that can be read."""
    if not os.path.exists(folder / "run.json"):  # no error of a name that is too long
        raise BadInput(f"{folder} holds no run (there is no run.json); allowed: the DIR of a run")
    try:
        content = read_json(folder / "run.json")
        if "points" in content:
            raise BadInput(
                f"{folder} holds a sweep; allowed: one sweep alone, or runs, as in softehl report "
                f"{folder}/runs/00001 {folder}/runs/00002"
            )
        case = find_named_case(content["case"], shipped)
        parameters = case.parameters(**content["parameters"])
        curve, rejected = (CurveFolder(f, case.row) for f in (folder, folder / "rejected"))
        for rows, name in ((curve, "states"), (rejected, "rejected")):
            rows.load()
            _require_written(rows, content, name)
        if edited := edited_table(folder, content):
            raise BadInput(f"{folder}: {edited}; {_AGAIN}")
    except (OSError, ValueError, KeyError, TypeError) as error:
        reason = " ".join(str(error).split())[:120]
        raise BadInput(f"{folder} holds no run that can be read: {reason}") from None
    return FinishedRun(folder, case, parameters, curve.rows, rejected.rows, content)


def _require_written(rows: CurveFolder[Any], content: Mapping[str, Any], name: str) -> None:
    """Leave the rows that run.json has too, with their files as they were written.

    name: of these rows in run.json. Raises BadInput where a row is another one or missing, but of a
    run that is under way: its curve is written before its run.json.
    """
    states = [state for state in content.get(name, ()) if isinstance(state, dict)]
    faults = {row.key: disbelief(rows.path, row, states) for row in rows.rows}
    name_of_key = rows.kind.key_column().name
    lost = [s[name_of_key] for s in states if s.get(name_of_key) not in faults]
    invalid = [(key, doubt) for key, doubt in faults.items() if doubt]
    count = Counter(row.key for row in rows.rows)
    invalid += [(key, "it is there twice") for key, times in count.items() if times > 1]
    invalid += [(key, "its row or a file of it is missing") for key in lost]
    if invalid and content.get("status") != "running":
        (key, doubt), *_ = invalid
        raise BadInput(f"{rows.path}: {rows.kind.label(key)}: {doubt}; {_AGAIN}")
    rows.rows = [row for row in rows.rows if not faults[row.key]]


def write_page(
    runs: Sequence[FinishedRun], parts: Sequence[Part], path: Path, title: str = ""
) -> int:
    """Write a report; returns its size in bytes.  Raises OSError, and BadInput without Bokeh.

    title: that of a page on something else than runs.
    """
    text = render(runs, parts, title)
    write_text(path, text)
    return len(text.encode())


def parts_of(runs: Sequence[FinishedRun]) -> list[Part]:
    """All parts in order: of the harness, and between them those of the case."""
    cases = {run.case.name for run in runs}
    if len(cases) > 1:
        raise BadInput(f"runs of different cases ({', '.join(sorted(cases))}); allowed: of one")
    for run in runs:
        if not run.rows:
            raise BadInput(f"{run.folder} has no result yet: nothing to report")
    try:
        case_parts = list(runs[0].case.report(runs))
    except ImportError as error:
        raise BadInput(f"{_MISSING} ({error})") from None
    several = [_side_by_side(runs)] if len(runs) > 1 else []
    parts = [*_answers(runs), input_part(runs), *several, *case_parts, *left_out(runs[0].case)]
    return [*parts, _all_rows(runs), all_keys(runs), versions(runs)]


def render(runs: Sequence[FinishedRun], parts: Sequence[Part], title: str = "") -> str:
    """The page, with everything that it needs."""
    try:
        from bokeh.core.templates import JS_RESOURCES
        from bokeh.embed import components
        from bokeh.resources import Resources
        from jinja2 import Environment, FileSystemLoader
    except ImportError as error:
        raise BadInput(f"{_MISSING} ({error})") from None
    plots = {f"{i}-{k}": plot for i, part in enumerate(parts) for k, plot in enumerate(part.plots)}
    script, divs = components(plots) if plots else ("", {})
    # Bokeh's own scripts alone: `render` adds those of any package that was imported beside
    scripts = Resources(mode="inline", components=["bokeh", "bokeh-widgets"]).js_raw
    needed = JS_RESOURCES.render(js_raw=scripts, js_files=[]) if plots else ""
    page = Environment(
        loader=FileSystemLoader(_HERE), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    page.filters["shown"] = cell_text
    page.tests["alarm"] = lambda line: isinstance(line, Alarm)
    page.filters["base64"] = lambda data: base64.b64encode(data).decode()
    return page.get_template("report.html").render(
        title=capital(title or _title(runs)),
        runs=runs,
        parts=parts,
        resources=needed,
        script=script,
        divs=divs,
    )


def _title(runs: Sequence[FinishedRun]) -> str:
    """Title that names the runs, each kind once; what all of them show stands once, at its end."""
    titles = dict.fromkeys(run.case.titled(run.parameters) for run in runs)
    subjects, details = zip(*(title.partition(": ")[::2] for title in titles), strict=True)
    same = len(set(details)) == 1 and bool(details[0])
    return f"{' and '.join(subjects)}: {details[0]}" if same else "; ".join(titles)


def capital(text: str) -> str:
    """Words that begin with a capital letter, all else as it is."""
    return text[:1].upper() + text[1:]


def cell_text(value: Cell | None) -> str:
    """A cell in words: four digits of a number, nothing where it is not known."""
    if value is None or (isinstance(value, float) and not isfinite(value)):
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def write_xlsx(parts: Sequence[Part], path: Path) -> None:
    """Write every table of a report as a sheet.  Raises BadInput where openpyxl is missing."""
    try:
        from openpyxl import Workbook
    except ImportError as error:
        raise BadInput(f"{_MISSING} ({error})") from None
    book, names = Workbook(), dict[str, int]()
    book.remove(book.worksheets[0])
    for title, table in ((part.title, table) for part in parts for table in part.tables):
        name = "".join(c for c in title if c not in "[]:*?/\\")[: _SHEET_NAME - 3]
        names[name] = names.get(name, 0) + 1
        sheet = book.create_sheet(name if names[name] == 1 else f"{name} {names[name]}")
        for row in ([table.caption], table.header, *table.rows):
            finite = [isinstance(c, str) or (c is not None and isfinite(c)) for c in row]
            sheet.append([c if good else None for c, good in zip(row, finite, strict=True)])
        for cell in (cell for cells in sheet.iter_rows() for cell in cells):
            if isinstance(cell.value, str):  # never a formula, also where somebody edits it
                cell.data_type = "s"
                cell.quotePrefix = cell.value.startswith(("=", "+", "-", "@"))
    with replacing(path) as temporary, temporary.open("wb") as file:
        book.save(file)


# --- parts that every case has ------------------------------------------------------------------


def _answers(runs: Sequence[FinishedRun]) -> list[Part]:
    """The main results of every run in words."""
    several = len(runs) > 1
    lines = [
        type(line)(f"{run.name}: {line.strip()}" if several else line.strip())
        for run in runs
        for line in _summary(run)
    ]
    return [Part("Answer", lines=lines)] if lines else []


def _summary(run: FinishedRun) -> list[str]:
    """The answer of a run, then what it rests on: notes, warnings, assumptions, measurements."""
    summary = run.summary
    if not summary:
        return []
    assumed = run.content.get("assumed") or ()
    return [
        *summary,
        *run.case.notes(run.rows, advice_of(run.content, run.rows)),
        *(run.content.get("warnings") or ()),
        *([f"assumed: {'; '.join(assumed)}"] if assumed else []),
        *run.case.cautions(run.parameters),
    ]


def left_out(case: AnyCase) -> list[Part]:
    """The limits of a model, in words."""
    return [Part("What the model leaves out", lines=case.left_out)] if case.left_out else []


def input_part(runs: Sequence[FinishedRun], without: Collection[str] = ()) -> Part:
    """The keys that are not at their defaults, with units and meaning, a column for each run.

    without: keys that are told elsewhere.
    """
    default = runs[0].case.parameters().model_dump()
    values = [run.parameters.model_dump() for run in runs]
    rows = [
        (key.name, *(_text(g[key.name]) for g in values), key.unit, key.meaning)
        for key in keys_of(runs[0].case.parameters)
        if key.name not in without and any(g[key.name] != default[key.name] for g in values)
    ]
    header = ("key", *(run.name for run in runs), "unit", "meaning")
    text = "Every key is at its default." if not rows else ""
    table = ReportTable("Keys that are not at their defaults", header, rows)
    status = [
        f"{run.name}: {run.content.get('status')} {run.content.get('message') or ''}"
        for run in runs
        if run.content.get("status") != "converged"
    ]
    return Part("What was asked", text, tables=[table] if rows else [], lines=status)


def _side_by_side(runs: Sequence[FinishedRun]) -> Part:
    """Every shown column of the rows that all runs share, and differences from the first run."""
    first, *others = runs
    heads = Counter(c.head for c in first.case.row.columns())  # two of one head are a range
    columns = [
        c
        for c in first.case.row.columns()
        if c.head and heads[c.head] == 1 and c.kind is float and c.unit != "%"
    ]
    key = first.case.row.key_column()
    rows_by_key = [{row.key: row for row in run.rows} for run in runs]
    common = [row.key for row in first.rows if all(row.key in rows for rows in rows_by_key[1:])]
    tables = []
    for column in columns:
        if column.name == key.name:
            continue
        rows: list[list[Cell]] = []
        for at in common:
            values = [float(getattr(rows[at], column.name)) for rows in rows_by_key]
            changes = [_percent(v, values[0]) for v in values[1:]]
            rows.append([at, *values, *changes])
        header = [f"{key.head} [{key.unit}]", *(run.name for run in runs)]
        header += [f"{run.name}, difference in %" for run in others]
        tables.append(ReportTable(f"{column.title}: {column.meaning}", header, rows))
    text = "" if common else "The runs share no row."
    return Part("Side by side", text, tables=tables if common else [])


def _percent(value: float, reference: float) -> float:
    return 100.0 * (value / reference - 1.0) if reference else float("nan")


def _all_rows(runs: Sequence[FinishedRun]) -> Part:
    tables = [
        ReportTable(
            f"{run.name}: every state", run.case.row.titles(), [row.cells() for row in run.rows]
        )
        for run in runs
    ]
    return Part("All columns", tables=tables, folded=True)


def all_keys(runs: Sequence[FinishedRun]) -> Part:
    """Every key with its value."""
    values = [run.parameters.model_dump() for run in runs]
    rows = [
        (key.name, *(_text(g[key.name]) for g in values), key.unit, key.bounds, key.meaning)
        for key in keys_of(runs[0].case.parameters)
    ]
    header = ("key", *(run.name for run in runs), "unit", "allowed", "meaning")
    return Part("All keys", tables=[ReportTable("As used", header, rows)], folded=True)


def versions(runs: Sequence[FinishedRun]) -> Part:
    """Versions of what computed the runs."""
    versions_by_run = [run.content.get("versions") or {} for run in runs]
    names = dict.fromkeys(name for entry in versions_by_run for name in entry)
    rows = [(name, *(str(entry.get(name) or "") for entry in versions_by_run)) for name in names]
    rows.append(("seconds", *(cell_text(run.content.get("seconds")) for run in runs)))
    table = ReportTable("Versions", ("", *(run.name for run in runs)), rows)
    return Part("Versions", tables=[table], folded=True)


def _text(value: Any) -> str:
    if isinstance(value, list | tuple):
        return ", ".join(map(_text, value))
    return "-" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
