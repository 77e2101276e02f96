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
    validated,
    value_text,
)
from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.parameters import Parameters, files_of, without_unit
from softehl.cases.harness.sampling import Hypercube, Points, Random

_REPLACING = ("grid", "latin_hypercube")  # a list falls back on what is fixed, tolerances are of it
_WANTED = "one of [grid], [[list]], [latin_hypercube], [random]"


@dataclass(frozen=True)
class StudyFile:
    """Runs of a case.

    scheme: how the points were chosen.  keys: those that vary.  points: their values, for each run.
    fixed: what else was given.  runs: parameters of each, or why such a case cannot be, in words.
    """

    case: AnyCase
    scheme: str
    fixed: Mapping[str, Any]
    keys: tuple[str, ...]
    points: tuple[Mapping[str, Any], ...]
    runs: tuple[Parameters | str, ...]


def read_study(source: str, shipped: Shipped, assignments: Iterable[str] = ()) -> StudyFile:
    """The study in a TOML file; assignments: KEY=VALUE, of keys that do not vary.  BadInput."""
    if source in shipped:
        raise BadInput(
            f"{source!r} is a case; a study is a TOML file with case = {source!r} and {_WANTED}"
        )
    table = read_toml(source, "no file", "a TOML file, see docs/many-curves.md")
    schemes = [name for name in WAYS if name in table]
    if len(schemes) != 1:
        problem = " and ".join(schemes) or "no points"
        raise BadInput(f"{source}: {problem}; allowed: {_WANTED}")
    selection = table.pop(schemes[0])
    case, fixed = _case(source, table, shipped)
    origins = dict.fromkeys(fixed, source)
    for text in assignments:
        key, fixed[key] = read_assignment(text)
        origins[key] = "--set"
    reader = _Reader(case.parameters, source)
    require_known(case.parameters, fixed, origins)
    points = _points(schemes[0], selection, reader, fixed, origins)
    keys = tuple(points[0])
    for key in fixed:
        if key in keys and schemes[0] in _REPLACING:
            raise BadInput(f"{origins[key]}: {key} is fixed and varied; allowed: one of both")
    runs = _runs(case.parameters, schemes[0], fixed, points, source)
    return StudyFile(case, schemes[0], fixed, keys, tuple(points), runs)


def _case(source: str, table: dict[str, Any], shipped: Shipped) -> tuple[AnyCase, dict[str, Any]]:
    """The case of a study, a shipped one or a file beside it, and what both files fix."""
    name = table.pop("case", None)
    path = Path(source).parent / str(name)
    named = isinstance(name, str) and (name in shipped or is_reference(name))
    if not isinstance(name, str) or not (named or path.is_file()):
        problem = "no case" if name is None else f"case = {value_text(name)}"
        names = ", ".join(f'"{each}"' for each in shipped)
        raise BadInput(
            f"{source}: {problem}; allowed: case = one of {names}, or a case file beside it"
        )
    case, values = find_case(name if named else str(path), shipped)
    reader = _Reader(case.parameters, source)
    return case, {**values, **{key: reader.placed(key, value) for key, value in table.items()}}


@dataclass(frozen=True)
class _Reader:
    """Reads values of keys: units, and paths that are relative to the file of the study."""

    kind: type[Parameters]
    source: str

    def placed(self, key: str, value: Any) -> Any:
        """The path of a file, from here."""
        if key in files_of(self.kind) and isinstance(value, str):
            return str(Path(self.source).parent / value)
        return value

    def __call__(self, key: str, value: object) -> Any:
        """A value in the unit of its key.  Raises BadInput."""
        require_known(self.kind, (key,), {key: self.source})
        try:
            return self.placed(key, without_unit(self.kind, key, value))
        except ValueError as error:
            raise BadInput(f"{self.source}: {error}") from None


def _points(
    scheme: str,
    selection: Any,
    read: _Reader,
    fixed: Mapping[str, Any],
    origins: Mapping[str, str],
) -> Points:
    """The points of a study, of the way that it chose.  Raises BadInput."""
    if scheme == "grid":
        if not isinstance(selection, dict):
            raise BadInput(
                f"{read.source}: grid = {value_text(selection)}; allowed: a table [grid]"
            )
        return sampling.grid_points(selection, read)
    if scheme == "latin_hypercube":
        table = sampling.table_of(Hypercube, selection, "[latin_hypercube]")
        return sampling.hypercube_points(table, read)
    base = validated(read.kind, fixed, origins).model_dump()
    if scheme == "random":
        table_ = sampling.table_of(Random, selection, "[random]")
        return sampling.tolerance_points(table_, base, read)
    return sampling.list_points(selection if isinstance(selection, list) else [], read, base)


def _runs(
    kind: type[Parameters],
    scheme: str,
    fixed: Mapping[str, Any],
    points: Points,
    origin: str,
) -> tuple[Parameters | str, ...]:
    """The parameters of every point.  Raises BadInput where no case can have a value."""
    runs: list[Parameters | str] = []
    for point in points:
        try:
            runs.append(_parameters(kind, scheme, fixed, point, origin))
        except Contradiction as error:
            runs.append(error.message)
    if all(isinstance(run, str) for run in runs):
        raise BadInput(str(runs[0]))
    return tuple(runs)


def _parameters(
    kind: type[Parameters],
    scheme: str,
    fixed: Mapping[str, Any],
    point: Mapping[str, Any],
    origin: str,
) -> Parameters:
    """As `softehl run` has it; with random tolerances what follows from a name stays as it was."""
    if scheme != "random":
        values = {**fixed, **point}
        return validated(kind, values, dict.fromkeys(values, origin))
    names = {key: value for key, value in point.items() if key in kind.names}
    drawn = validated(kind, {**fixed, **names}, dict.fromkeys({**fixed, **names}, origin))
    values = {**drawn.settled(), **{k: v for k, v in point.items() if k not in kind.names}}
    return validated(kind, values, dict.fromkeys(values, origin))
