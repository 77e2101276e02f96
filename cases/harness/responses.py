"""Pictures of a sweep: each result over each key that varied; the other keys are told by colour."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softehl.cases.harness.row import Column, Row
from softehl.runtime.io import Cell, replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LABELS = 8
"""Values of the other keys, or states of a run, that are told apart by colour."""

_MARKERS = "os^vD<>pPX*h"
"""Of the states of a run, where colours tell the other keys."""

Rows = Sequence[Mapping[str, Cell]]


def draw_responses(folder: Path, rows: Rows, keys: Mapping[str, str], kind: type[Row]) -> list[str]:
    """Write response_KEY.png for each key that has two values or more; their names.

    rows: of `sweep.csv`.  keys: those that varied -> their units.  kind: the rows of a run; its
    numbers with a head are the results.  Raises OSError.
    """
    results = [c for c in kind.columns() if c.head and c.kind is float and c != kind.key_column()]
    results = [c for c in results if c.name not in keys]
    known_rows = [row for row in rows if row[kind.key_column().name] != ""]
    results = [c for c in results if any(_is_known(row[c.name]) for row in known_rows)]
    varied = {key: unit for key, unit in keys.items() if len({row[key] for row in known_rows}) > 1}
    for key in varied:
        _draw(folder / f"response_{key}.png", Response(key, varied, known_rows, kind), results)
    return [f"response_{key}.png" for key in varied]


@dataclass(frozen=True, eq=False)
class Response:
    """Results to be drawn over a key.  keys: all that varied -> their units."""

    key: str
    keys: Mapping[str, str]
    rows: Rows
    kind: type[Row]

    @property
    def others(self) -> list[str]:
        """The other keys that varied."""
        return [key for key in self.keys if key != self.key]

    def series(self) -> list[tuple[str, str, Rows]]:
        """Rows that belong together: the values of the other keys, the state of a run, the rows.

        Words are empty where they would be too many to be told apart.
        """
        column, rows_of_pair = self.kind.key_column().name, dict[tuple[str, str], list[Any]]()
        for row in self.rows:
            other = ", ".join(titled_value(key, row[key], self.keys[key]) for key in self.others)
            state = self.kind.label(float(row[column]))
            rows_of_pair.setdefault((other, state), []).append(row)
        few = [len({pair[k] for pair in rows_of_pair}) for k in (0, 1)]
        many_others, many_states = few[0] > _LABELS, few[1] > len(_MARKERS)
        return [
            ("" if many_others else other, "" if many_states else state, some)
            for (other, state), some in rows_of_pair.items()
        ]


def titled(key: str, unit: str) -> str:
    """A key on an axis."""
    return f"{key} [{unit}]" if unit else key


def titled_value(key: str, value: Cell, unit: str) -> str:
    """A value of a key in a legend."""
    text = f"{value:g}" if isinstance(value, int | float) else str(value)
    return f"{key} = {text} {unit}".rstrip()


def _draw(path: Path, response: Response, results: Sequence[Column]) -> None:
    from matplotlib.figure import Figure  # late: it is slow to import

    wide = min(len(results), 3)
    high = -(-len(results) // wide)
    figure = Figure(figsize=(3.6 * wide, 2.7 * high), layout="constrained")
    panels = figure.subplots(high, wide, sharex=True, squeeze=False).ravel()
    for axes, column in zip(panels, results, strict=False):
        handles, labels = draw_panel(axes, response, column)
        axes.set_ylabel(f"{column.head} [{column.unit}]" if column.unit else column.head)
        axes.grid(alpha=0.35)
    for axes in panels[len(results) :]:
        axes.set_visible(False)
    for axes in panels[max(0, len(results) - wide) : len(results)]:
        axes.set_xlabel(titled(response.key, response.keys[response.key]))
        axes.tick_params(labelbottom=True)
    figure.legend(handles, labels, loc="outside upper center", ncols=4, fontsize="small")
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png", dpi=120)


def draw_panel(axes: Axes, response: Response, column: Column) -> tuple[list[Any], list[str]]:
    """A result over the key; handles and words of a legend."""
    from matplotlib.lines import Line2D

    series = response.series()
    others = [word for word in dict.fromkeys(other for other, _, _ in series) if word]
    states = [word for word in dict.fromkeys(state for _, state, _ in series) if word]
    colours = {word: f"C{k}" for k, word in enumerate(others or states)}
    for other, state, rows in series:
        points = sorted(
            ((_abscissa(row[response.key]), _height(row[column.name])) for row in rows),
            key=lambda point: (isinstance(point[0], str), point[0]),
        )
        look: dict[str, Any] = {
            "color": colours.get(other or state, "C0"),
            "marker": _MARKERS[states.index(state)] if others and state else ".",
            "linestyle": "-" if other and len(points) > 1 else "",
        }
        abscissas, heights = [x for x, _ in points], [y for _, y in points]
        axes.plot(abscissas, heights, alpha=0.7, linewidth=0.8, markersize=4, **look)
    handles = [Line2D([], [], color=c, marker=".", linestyle="") for c in colours.values()]
    labels = list(colours)
    if others:
        marks = dict(zip(states, _MARKERS, strict=False))
        handles += [Line2D([], [], color="0.3", marker=m, linestyle="") for m in marks.values()]
        labels += list(marks)
    return handles, labels or ["all states"]


def _is_known(value: Cell) -> bool:
    return isinstance(value, float) and isfinite(value)


def _height(value: Cell) -> Cell:
    """Ordinate of a result; one that is not there is not drawn."""
    return nan if value == "" else value


def _abscissa(value: Cell) -> Cell:
    """Abscissa of a value; words and lists stand side by side."""
    return float(value) if isinstance(value, int) else value
