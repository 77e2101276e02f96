"""The points of a study: a grid, a list, a Latin hypercube or random tolerances of some keys.

A point is a value for each varied key.  Nothing here knows what the keys mean.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, Literal, TypeAlias, TypeGuard, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from scipy.stats import qmc

from softehl.cases.harness.errors import BadInput
from softehl.runtime.arrays import Array
from softehl.runtime.suggestions import did_you_mean

F = TypeVar("F", bound="StudyTable")
Points: TypeAlias = list[dict[str, Any]]
Read: TypeAlias = Callable[[str, object], Any]
"""(key, value as it was typed) -> value in the unit of the key.  Raises BadInput."""

MOST = 100_000
"""Runs of a study."""

NORMAL_DEVIATIONS = 2.0
"""Standard deviations that a tolerance is, of a normal distribution."""

_SHARE = re.compile(r"(\+-\s*)?(?P<size>\d+(\.\d*)?([eE][-+]?\d+)?)\s*%")


class StudyTable(BaseModel):
    """Allowed content of a table of a study."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Span(StudyTable):
    """Equally spaced values of a key: {from = 1, to = 2, count = 5}, or of its logarithm."""

    start: Any = Field(alias="from")
    to: Any
    count: int = Field(ge=2, le=MOST)
    spacing: Literal["linear", "log"] = "linear"


class Hypercube(StudyTable):
    """[latin_hypercube]: a number of points that fill the box between bounds of each key."""

    count: int = Field(ge=1, le=MOST)
    seed: int = Field(default=1, ge=0)
    between: dict[str, Any] = Field(min_length=1)


class Random(StudyTable):
    """[random]: keys that are off by independent tolerances."""

    count: int = Field(ge=1, le=MOST)
    seed: int = Field(default=1, ge=0)
    distribution: Literal["uniform", "normal"] = "uniform"
    tolerances: dict[str, Any] = Field(min_length=1)


def table_of(kind: type[F], content: object, where: str) -> F:
    """A table of a study, checked.  Raises BadInput."""
    names = [field.alias or name for name, field in kind.model_fields.items()]
    if not isinstance(content, dict):
        raise BadInput(f"{where} = {content!r}: allowed: a table of {', '.join(names)}")
    for name in content:
        if name not in names:
            hint = did_you_mean(name, names)
            raise BadInput(f"{where}: unknown {name!r}{hint}; allowed: {', '.join(names)}")
    try:
        return kind(**content)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        name = str(first["loc"][0])
        problem = f"{name} = {content[name]!r}: " if name in content else f"{name} is missing: "
        raise BadInput(f"{where} {problem}{first['msg'].lower()}") from None


def grid_points(axes: Mapping[str, Any], read: Read) -> Points:
    """Every combination of the values of each key; the last key varies fastest.  BadInput."""
    if not axes:
        raise BadInput("[grid] is empty; allowed: a list of values for each key that is varied")
    values = [_axis(key, axis, read) for key, axis in axes.items()]
    count = math.prod(map(len, values))
    if count > MOST:
        raise BadInput(f"[grid] has {count} combinations; allowed: at most {MOST}")
    return [dict(zip(axes, combination, strict=True)) for combination in product(*values)]


def _axis(key: str, axis: object, read: Read) -> list[Any]:
    if isinstance(axis, dict):
        return _spaced(key, axis, read)
    if not isinstance(axis, list) or not axis:
        raise BadInput(
            f"[grid] {key} = {axis!r}: allowed: a list of values, or "
            '{from = 1, to = 2, count = 5}, with spacing = "log" if wanted'
        )
    return [read(key, value) for value in axis]


def _spaced(key: str, axis: Mapping[str, Any], read: Read) -> list[Any]:
    span = table_of(Span, axis, f"[grid] {key}")
    low, high = _bounds(f"[grid] {key}", read(key, span.start), read(key, span.to))
    if span.spacing == "linear":
        values = np.linspace(low, high, span.count)
    elif low > 0.0:
        values = np.geomspace(low, high, span.count)
    else:
        raise BadInput(f"[grid] {key}: from = {low:g} has no logarithm; allowed: more than 0")
    integers = isinstance(span.start, int) and isinstance(span.to, int)
    if integers and np.array_equal(values, np.round(values)):
        return [int(value) for value in values]
    return [float(value) for value in values]


def list_points(entries: Sequence[Any], read: Read, otherwise: Mapping[str, Any]) -> Points:
    """Points one by one; a key that an entry leaves out is as `otherwise` says.  BadInput."""
    if not entries or not all(isinstance(entry, dict) and entry for entry in entries):
        raise BadInput("[[list]] is empty; allowed: one [[list]] of KEY = VALUE for each run")
    keys = list(dict.fromkeys(key for entry in entries for key in entry))
    return [
        {key: read(key, entry[key]) if key in entry else otherwise.get(key) for key in keys}
        for entry in entries
    ]


def hypercube_points(table: Hypercube, read: Read) -> Points:
    """A Latin hypercube between the bounds of each key, the same for the same seed.  BadInput."""
    where = "[latin_hypercube] between."
    box = [_pair(f"{where}{key}", key, bounds, read) for key, bounds in table.between.items()]
    low, high = np.array(box, dtype=np.float64).T
    random = np.random.default_rng(table.seed)
    fractions = qmc.LatinHypercube(len(box), seed=random).random(table.count)
    return _named(list(table.between), low + fractions * (high - low))


def _pair(where: str, key: str, bounds: object, read: Read) -> tuple[float, float]:
    if not isinstance(bounds, list) or len(bounds) != 2:
        raise BadInput(f"{where} = {bounds!r}: allowed: [least, largest]")
    return _bounds(where, *(read(key, value) for value in bounds))


def _bounds(where: str, low: object, high: object) -> tuple[float, float]:
    if not _is_number(low) or not _is_number(high):
        raise BadInput(f"{where}: {low!r} to {high!r} is no range; allowed: two numbers")
    minimum, largest = float(low), float(high)
    if not minimum < largest:
        raise BadInput(f"{where}: from {minimum:g} to {largest:g}; allowed: the smaller one first")
    return minimum, largest


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


@dataclass(frozen=True)
class Tolerance:
    """Keys that are off by the same share of their value, at most `share` if it is uniform."""

    keys: tuple[str, ...]
    share: float


def tolerance_points(table: Random, values: Mapping[str, Any], read: Read) -> Points:
    """Keys around their values, each tolerance independent of the others; BadInput.

    A tolerance is the largest deviation of a uniform, twice the standard deviation of a normal
    distribution.  The first points of a study of more points are the same.
    """
    tolerances = [_tolerance(name, text, values, read) for name, text in table.tolerances.items()]
    keys = [key for tolerance in tolerances for key in tolerance.keys]
    if len(set(keys)) < len(keys):
        raise BadInput("[random] tolerances: a key is given twice; allowed: once")
    random, shape = np.random.default_rng(table.seed), (table.count, len(tolerances))
    if table.distribution == "uniform":
        fractions = random.uniform(-1.0, 1.0, shape)
    else:
        fractions = random.normal(size=shape) / NORMAL_DEVIATIONS
    columns = [
        values[key] * (1.0 + tolerance.share * fractions[:, n])
        for n, tolerance in enumerate(tolerances)
        for key in tolerance.keys
    ]
    return _named(keys, np.stack(columns, axis=1))


def _tolerance(name: str, text: object, values: Mapping[str, Any], read: Read) -> Tolerance:
    """Tolerance of a line `"key, other" = "15 %"`, a share of both, or `key = "0.05 mm"`."""
    where = f"[random] tolerances.{name} = {text!r}"
    keys = tuple(part.strip() for part in name.split(","))
    for key in keys:
        read(key, 1.0)
        if not _is_number(values.get(key)) or not values[key]:
            candidates = [k for k in values if k.startswith(f"{key}_") and _is_number(values[k])]
            instead = f", as {' or '.join(candidates)} has" if candidates else ""
            message = f"{where}: {key} = {values.get(key)!r}"
            raise BadInput(f"{message}; allowed: a key with a number that is not 0{instead}")
    percent = _SHARE.fullmatch(text.strip()) if isinstance(text, str) else None
    if percent:
        return Tolerance(keys, 0.01 * float(percent["size"]))
    size = read(keys[0], text)
    if len(keys) > 1 or not _is_number(size) or not size > 0.0:
        raise BadInput(
            f'{where}: allowed: a share as in "15 %", or of one key a number in its unit'
        )
    return Tolerance(keys, float(size) / abs(values[keys[0]]))


def _named(keys: Sequence[str], table: Array) -> Points:
    return [dict(zip(keys, map(float, row), strict=True)) for row in table]
