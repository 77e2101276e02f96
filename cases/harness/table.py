"""Tables on the terminal and in the documentation, from the declarations of columns and keys."""

import json
from collections.abc import Collection, Sequence
from itertools import groupby

from rich.box import SIMPLE
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

from softehl.cases.harness.case import AnyCase
from softehl.cases.harness.parameters import Key, Parameters, keys_of
from softehl.cases.harness.row import OK, Column, Record, Row

_WIDTH = 110
"""Width where stdout is no terminal."""

_DEFAULT = 15
"""Width of the defaults in the table of keys, which is to be readable at 80 columns."""


def print_rows(case: AnyCase, rows: Sequence[Row], rejected: Sequence[Row] = ()) -> None:
    """Print the rows to stdout, at full width where stdout is not a terminal.

    On a narrow terminal the last columns are left out and named; digits are never cut.
    """
    console, left = Console(), 0
    width = console.width if console.is_terminal else 10 * _WIDTH
    wide = console.options.update(width=10 * _WIDTH)
    heads = _heads(case.row)
    while len(heads) - left > 1:
        table = rows_table(case, rows, rejected, without=left)
        if Measurement.get(console, wide, table).minimum <= width:
            break
        left += 1
    _print(rows_table(case, rows, rejected, without=left), _WIDTH)
    if left:
        names = ", ".join(columns[0].head for columns in heads[len(heads) - left :])
        console.print(f"not shown, the terminal is too narrow: {names}", highlight=False)


def rows_table(
    case: AnyCase, rows: Sequence[Row], rejected: Sequence[Row] = (), *, without: int = 0
) -> Table:
    """The rows as a table; a rejected one is flagged and shows no number but the first.

    without: how many of the last columns before the verdict are left out.
    """
    ordered = sorted([*rows, *rejected], key=lambda row: row.order)
    heads = _heads(case.row)
    heads = heads[: len(heads) - without]
    table = Table(
        title=Text(case.caption(ordered)), box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False
    )
    for columns in heads:
        head = f"{columns[0].head}\n{columns[0].unit}"
        table.add_column(Text(head), justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    for row in ordered:
        texts = [_cell_text(row, columns) for columns in heads]
        if not row.usable:
            texts = [texts[0], *("-" for _ in texts[1:])]
        verdict = row.verdict if row.usable else row.verdict.upper()
        style = None if row.verdict == OK else ("yellow" if row.usable else "bold red")
        table.add_row(*(Text(text) for text in [*texts, verdict]), style=style)
    return table


def print_keys(kind: type[Parameters]) -> None:
    """Print every key under its heading with its default, unit, bounds and meaning to stdout."""
    table = Table(box=SIMPLE, padding=(0, 2, 0, 0), pad_edge=False)
    table.add_column("key", no_wrap=True)
    table.add_column("default", max_width=_DEFAULT, overflow="fold")
    table.add_column(Text("meaning [unit]; what is allowed"))
    for heading, keys in groupby(keys_of(kind), key=lambda key: key.heading):
        if heading:
            table.add_section()
            table.add_row(Text(heading.upper(), style="bold"))
        for key in keys:
            meaning = str(kind.model_fields[key.name].description)
            table.add_row(*map(Text, (key.name, default_text(key), meaning)))
    _print(table, _WIDTH)


def default_text(key: Key) -> str:
    """The default as it would be typed, "-" for none."""
    return "-" if key.default is None else json.dumps(key.default)


def key_lines(kind: type[Parameters], excluded: Collection[Key] = ()) -> list[str]:
    """The keys of a case as a table for the documentation, without those that are known."""
    lines = ["| key | default | unit | allowed | meaning |", "|---|---|---|---|---|"]
    shown_keys = [key for key in keys_of(kind) if key not in excluded]
    for heading, keys in groupby(shown_keys, key=lambda key: key.heading):
        if heading:
            lines.append(_line(f"**{heading}**", "", "", "", ""))
        for key in keys:
            default = "-" if key.default is None else f"`{default_text(key)}`"
            lines.append(_line(f"`{key.name}`", default, key.unit, key.bounds, key.meaning))
    return lines


def column_lines(kind: type[Record]) -> list[str]:
    """The columns of a table as a table for the documentation."""
    lines = ["| column | unit | meaning |", "|---|---|---|"]
    return [*lines, *(_line(f"`{c.name}`", c.unit, c.meaning) for c in kind.columns())]


def _line(*cells: str) -> str:
    return f"| {' | '.join(cell.replace('|', '&#124;') for cell in cells)} |"


def _heads(kind: type[Record]) -> list[list[Column]]:
    """The columns that are shown; neighbours under one head together."""
    columns = [column for column in kind.columns() if column.head]
    return [list(group) for _, group in groupby(columns, key=lambda column: column.head)]


def _cell_text(row: Row, columns: Sequence[Column]) -> str:
    return " ".join(row.shown(column) for column in columns).strip()


def _print(table: Table, width: int) -> None:
    console = Console()
    if not console.is_terminal:
        console = Console(width=width)
    console.print(table)
