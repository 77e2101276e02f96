"""Pictures of a sweep: each result over each key that varied."""

from collections.abc import Mapping, Sequence
from math import isfinite, nan
from pathlib import Path

from softehl.cases.harness.row import Column, Row
from softehl.runtime.io import Cell, replacing

_LABELS = 8
"""States of a run that are told apart by colour."""


def draw_responses(
    folder: Path, rows: Sequence[Mapping[str, Cell]], keys: Mapping[str, str], kind: type[Row]
) -> list[str]:
    """Write response_KEY.png for each key that has two values or more; their names.

    rows: of `sweep.csv`.  keys: those that varied -> their units.  kind: the rows of a run; its
    numbers with a head are the results.  Raises OSError.
    """
    results = [c for c in kind.columns() if c.head and c.kind is float and c != kind.key_column()]
    results = [c for c in results if c.name not in keys]
    shown = [row for row in rows if row[kind.key_column().name] != ""]
    results = [c for c in results if any(_is_known(row[c.name]) for row in shown)]
    names = []
    for key, unit in keys.items():
        if len({row[key] for row in shown}) > 1:
            title = f"{key} [{unit}]" if unit else key
            names.append(f"response_{key}.png")
            _draw(folder / names[-1], shown, (key, title), results, kind)
    return names


def _draw(
    path: Path,
    rows: Sequence[Mapping[str, Cell]],
    over: tuple[str, str],
    results: Sequence[Column],
    kind: type[Row],
) -> None:
    from matplotlib.figure import Figure  # late: it is slow to import

    wide = min(len(results), 3)
    high = -(-len(results) // wide)
    figure = Figure(figsize=(3.6 * wide, 2.7 * high), layout="constrained")
    panels = figure.subplots(high, wide, sharex=True, squeeze=False).ravel()
    for axes, column in zip(panels, results, strict=False):
        for label, some in _by_state(rows, kind).items():
            points = [(_place(row[over[0]]), row[column.name] or nan) for row in some]
            axes.plot(*zip(*points, strict=True), ".", label=label, alpha=0.7)
        axes.set_ylabel(f"{column.head} [{column.unit}]" if column.unit else column.head)
        axes.grid(alpha=0.35)
    for axes in panels[len(results) :]:
        axes.set_visible(False)
    for axes in panels[max(0, len(results) - wide) : len(results)]:
        axes.set_xlabel(over[1])
        axes.tick_params(labelbottom=True)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png", dpi=120)


def _is_known(value: Cell) -> bool:
    return isinstance(value, float) and isfinite(value)


def _place(value: Cell) -> Cell:
    """Where a value stands on the axis; words and lists side by side."""
    return float(value) if isinstance(value, int) else value


def _by_state(
    rows: Sequence[Mapping[str, Cell]], kind: type[Row]
) -> dict[str, list[Mapping[str, Cell]]]:
    """The rows of each state of a run, by its label; together where there are too many."""
    column, found = kind.key_column().name, dict[str, list[Mapping[str, Cell]]]()
    for row in rows:
        found.setdefault(kind.label(float(row[column])), []).append(row)
    return found if len(found) <= _LABELS else {"all states": list(rows)}
