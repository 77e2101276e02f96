"""From what the user typed to a checked parameter set: a case name or TOML file, and `--set`.

A case file is data.  It is read by `tomllib` and checked against the parameter class; nothing in
it is ever evaluated.  Whatever is wrong ends in one :class:`BadInput`, a single line that says what
was given and what is allowed.
"""

import difflib
import importlib
import json
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import click
from pydantic import ValidationError

from softehl.cases.harness.observer import Observer, Outcome
from softehl.cases.seal.parameters import ORing

Solve = Callable[[ORing, Observer], Outcome]

SHIPPED: Mapping[str, tuple[type[ORing], str]] = {"oring": (ORing, "softehl.cases.seal.run")}
"""Case name -> its parameter class and the module that holds its `run`."""

_BARE_WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
_SHOWN = 60


class BadInput(click.ClickException):
    """What the user gave cannot be used; the message is one line.  Exit code 2."""

    exit_code = 2

    def __init__(self, message: str) -> None:
        super().__init__(" ".join(message.split()))


@dataclass(frozen=True)
class Case:
    """A named case with its checked parameters.

    contacts: folder in which runs leave their contact states for each other, None for none.
    """

    name: str
    parameters: ORing
    contacts: Path | None = None

    def load_solve(self) -> Solve:
        """Import the module of the case (late: it is heavy) and return its `run`."""
        run = importlib.import_module(SHIPPED[self.name][1]).run
        solve: Solve = partial(run, contacts=self.contacts) if self.contacts else run
        return solve


def read_case(given: str, assignments: Iterable[str] = ()) -> Case:
    """Read the case `given` (a shipped name or a TOML file) and apply KEY=VALUE `assignments`.

    Raises BadInput.
    """
    name, from_file = (given, {}) if given in SHIPPED else _read_file(given)
    from_line = dict(read_assignment(text) for text in assignments)
    origins = dict.fromkeys(from_file, given) | dict.fromkeys(from_line, "--set")
    return Case(name, _validate(SHIPPED[name][0], from_file | from_line, origins))


def read_assignment(text: str) -> tuple[str, object]:
    """Split KEY=VALUE and read VALUE as a TOML value; a bare word is a string.  BadInput."""
    key, equals, value = (part.strip() for part in text.partition("="))
    if not key or not equals:
        raise BadInput(f"--set {_shorten(text)}: allowed is KEY=VALUE, as in density=4")
    try:
        table = tomllib.loads(f"value = {value}")
    except (ValueError, RecursionError):
        table = {}
    if list(table) == ["value"]:
        return key, table["value"]
    if _BARE_WORD.fullmatch(value):
        return key, value
    raise BadInput(
        f"--set {key}: {_shorten(value)!r} is not a TOML value; "
        f'allowed are a number, true or false, a word, "text" or a list as in [400, 100]'
    )


def _read_file(given: str) -> tuple[str, dict[str, Any]]:
    """The case name and the remaining keys of a TOML file."""
    try:
        table = tomllib.loads(Path(given).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise BadInput(
            f"no case or file {given!r}{_meant(given, SHIPPED)}; "
            f"allowed: a TOML file or one of {', '.join(SHIPPED)}"
        ) from None
    except OSError as error:
        raise BadInput(f"cannot read the case file {given!r}: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise BadInput(f"{given}: not a TOML file: {_shorten(str(error), 200)}") from None
    name = table.pop("case", None)
    if not isinstance(name, str) or name not in SHIPPED:
        shown = "no case" if name is None else f"case = {_shown(name)}"
        allowed = " or ".join(f'case = "{known}"' for known in SHIPPED)
        raise BadInput(f"{given}: {shown}{_meant(str(name), SHIPPED)}; allowed: {allowed}")
    return name, table


def _validate(kind: type[ORing], values: Mapping[str, Any], origins: Mapping[str, str]) -> ORing:
    known = list(kind.model_fields)
    for key in values:
        if key not in kind.model_fields:
            raise BadInput(
                f"{origins[key]}: unknown key {_shorten(key)!r}{_meant(key, known)}; "
                f"allowed: {', '.join(known)}"
            )
    try:
        return kind(**values)
    except ValidationError as error:
        raise BadInput(_one_line(kind, values, origins, error)) from None


def _one_line(
    kind: type[ORing], values: Mapping[str, Any], origins: Mapping[str, str], error: ValidationError
) -> str:
    """The first complaint of pydantic in the user's words, and how many more there are."""
    complaints = error.errors(include_url=False, include_context=False)
    first, keys = complaints[0], {c["loc"][:1] for c in complaints}
    more = f" (and {len(keys) - 1} more)" if len(keys) > 1 else ""
    reason = first["msg"].removeprefix("Value error, ")
    reason = (reason[0].lower() + reason[1:]).replace("tuple", "list")
    if not first["loc"]:  # a relation between several keys
        return f"{' and '.join(sorted(set(origins.values())))}: {reason}"
    key = str(first["loc"][0])
    return (
        f"{origins[key]}: {key} = {_shown(values[key])}: {reason}{more}; "
        f"allowed: {kind.model_fields[key].description}"
    )


def _meant(given: str, known: Iterable[str]) -> str:
    close = difflib.get_close_matches(given, list(known), n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def _shown(value: object) -> str:
    return _shorten(json.dumps(value, default=str, ensure_ascii=False))


def _shorten(text: str, limit: int = _SHOWN) -> str:
    return text if len(text) <= limit else text[: limit - 3] + "..."
