"""A study: a case with fixed keys, and how some others vary; read from STUDY.toml.

    case = "NAME"
    key = 200

    [grid]
    another = [1.5, 2, 3]

Beside `[grid]` there are `[[list]]`, `[latin_hypercube]` and `[random]`, one of them in a study.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from softehl.cases.harness import sampling
from softehl.cases.harness.case import AnyCase, is_reference
from softehl.cases.harness.case_file import (
    WAYS,
    Contradiction,
    Shipped,
    find_case,
    read_assignment,
    read_toml,
    require_known,
    shown,
    validated,
)
from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.parameters import Parameters, files_of, without_unit
from softehl.cases.harness.sampling import Hypercube, Points, Random

_REPLACING = ("grid", "latin_hypercube")  # a list falls back on what is fixed, tolerances are of it
_WANTED = "one of [grid], [[list]], [latin_hypercube], [random]"


@dataclass(frozen=True)
class Study:
    """Runs of a case.

    way: how the points were chosen.  keys: those that vary.  points: their values, for each run.
    fixed: what else was given.  runs: parameters of each, or why such a case cannot be, in words.
    """

    case: AnyCase
    way: str
    fixed: Mapping[str, Any]
    keys: tuple[str, ...]
    points: tuple[Mapping[str, Any], ...]
    runs: tuple[Parameters | str, ...]


def read_study(given: str, shipped: Shipped, assignments: Iterable[str] = ()) -> Study:
    """The study in a TOML file; assignments: KEY=VALUE, of keys that do not vary.  BadInput."""
    if given in shipped:
        raise BadInput(
            f"{given!r} is a case; a study is a TOML file with case = {given!r} and {_WANTED}"
        )
    table = read_toml(given, "no file", "a TOML file, see docs/many-curves.md")
    ways = [name for name in WAYS if name in table]
    if len(ways) != 1:
        found = " and ".join(ways) or "no points"
        raise BadInput(f"{given}: {found}; allowed: {_WANTED}")
    chosen = table.pop(ways[0])
    case, fixed = _case(given, table, shipped)
    origins = dict.fromkeys(fixed, given)
    for text in assignments:
        key, fixed[key] = read_assignment(text)
        origins[key] = "--set"
    reader = _Reader(case.parameters, given)
    require_known(case.parameters, fixed, origins)
    points = _points(ways[0], chosen, reader, fixed, origins)
    keys = tuple(points[0])
    for key in fixed:
        if key in keys and ways[0] in _REPLACING:
            raise BadInput(f"{origins[key]}: {key} is fixed and varied; allowed: one of both")
    runs = _runs(case.parameters, ways[0], fixed, points, given)
    return Study(case, ways[0], fixed, keys, tuple(points), runs)


def _case(given: str, table: dict[str, Any], shipped: Shipped) -> tuple[AnyCase, dict[str, Any]]:
    """The case of a study, a shipped one or a file beside it, and what both files fix."""
    name = table.pop("case", None)
    path = Path(given).parent / str(name)
    named = isinstance(name, str) and (name in shipped or is_reference(name))
    if not isinstance(name, str) or not (named or path.is_file()):
        told = "no case" if name is None else f"case = {shown(name)}"
        known = ", ".join(f'"{each}"' for each in shipped)
        raise BadInput(f"{given}: {told}; allowed: case = one of {known}, or a case file beside it")
    case, values = find_case(name if named else str(path), shipped)
    reader = _Reader(case.parameters, given)
    return case, {**values, **{key: reader.placed(key, value) for key, value in table.items()}}


@dataclass(frozen=True)
class _Reader:
    """Reads values of keys: units, and paths that are relative to the file of the study."""

    kind: type[Parameters]
    given: str

    def placed(self, key: str, value: Any) -> Any:
        """The path of a file, from here."""
        if key in files_of(self.kind) and isinstance(value, str):
            return str(Path(self.given).parent / value)
        return value

    def __call__(self, key: str, value: object) -> Any:
        """A value in the unit of its key.  Raises BadInput."""
        require_known(self.kind, (key,), {key: self.given})
        try:
            return self.placed(key, without_unit(self.kind, key, value))
        except ValueError as error:
            raise BadInput(f"{self.given}: {error}") from None


def _points(
    way: str,
    chosen: Any,
    read: _Reader,
    fixed: Mapping[str, Any],
    origins: Mapping[str, str],
) -> Points:
    """The points of a study, of the way that it chose.  Raises BadInput."""
    if way == "grid":
        if not isinstance(chosen, dict):
            raise BadInput(f"{read.given}: grid = {shown(chosen)}; allowed: a table [grid]")
        return sampling.grid_points(chosen, read)
    if way == "latin_hypercube":
        table = sampling.table_of(Hypercube, chosen, "[latin_hypercube]")
        return sampling.hypercube_points(table, read)
    base = validated(read.kind, fixed, origins).model_dump()
    if way == "random":
        table_ = sampling.table_of(Random, chosen, "[random]")
        return sampling.tolerance_points(table_, base, read)
    return sampling.list_points(chosen if isinstance(chosen, list) else [], read, base)


def _runs(
    kind: type[Parameters],
    way: str,
    fixed: Mapping[str, Any],
    points: Points,
    origin: str,
) -> tuple[Parameters | str, ...]:
    """The parameters of every point.  Raises BadInput where no case can have a value."""
    runs: list[Parameters | str] = []
    for point in points:
        try:
            runs.append(_parameters(kind, way, fixed, point, origin))
        except Contradiction as error:
            runs.append(error.message)
    if all(isinstance(run, str) for run in runs):
        raise BadInput(str(runs[0]))
    return tuple(runs)


def _parameters(
    kind: type[Parameters],
    way: str,
    fixed: Mapping[str, Any],
    point: Mapping[str, Any],
    origin: str,
) -> Parameters:
    """As `softehl run` has it; with random tolerances what follows from a name stays as it was."""
    if way != "random":
        given = {**fixed, **point}
        return validated(kind, given, dict.fromkeys(given, origin))
    names = {key: value for key, value in point.items() if key in kind.names}
    drawn = validated(kind, {**fixed, **names}, dict.fromkeys({**fixed, **names}, origin))
    given = {**drawn.settled(), **{k: v for k, v in point.items() if k not in kind.names}}
    return validated(kind, given, dict.fromkeys(given, origin))
