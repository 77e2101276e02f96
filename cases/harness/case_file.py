"""From what the user typed to a checked parameter set: a case name or TOML file, and `--set`.

A case file is data.  It is read by `tomllib` and checked against the parameter class; nothing in
it is ever evaluated.  Whatever is wrong ends in one :class:`BadInput`, a single line that says what
was given and what is allowed.
"""

import json
import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pydantic import ValidationError

from softehl.cases.harness.case import AnyCase, Run, load_case
from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.parameters import Parameters, files_of
from softehl.cases.harness.units import is_quantity
from softehl.runtime.library import KernelError
from softehl.runtime.names import meant

Shipped = Mapping[str, str]
"""Name of a case that ships -> its module, which is imported when the case is needed."""

_BARE_WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
_FILE = re.compile(r"(\.{0,2}/)?[A-Za-z_][A-Za-z0-9_./-]*\.[A-Za-z]{1,5}")
_PHRASE = re.compile(r"[A-Za-z][A-Za-z0-9]*( [A-Za-z0-9][A-Za-z0-9.,]*)+")
_SHOWN = 60
_LARGEST = 1 << 20  # bytes of a case file; also ends reading what has no end


def read_case(
    given: str,
    shipped: Shipped,
    assignments: Iterable[str] = (),
    options: Mapping[str, str] = MappingProxyType({}),
) -> Run:
    """Read the case `given` (a shipped name or a TOML file) and apply KEY=VALUE `assignments`.

    options: keys that have an option of their own, as they were typed.  Raises BadInput.
    """
    case, values = find_case(given, shipped)
    origins = dict.fromkeys(values, given)
    typed = [(text, "--set") for text in assignments]
    typed += [(f"{key}={text}", f"--{key}") for key, text in options.items()]
    for text, origin in typed:
        key, values[key] = read_assignment(text, origin)
        origins[key] = origin
    return Run(case, _validate(case.parameters, values, origins))


def find_case(given: str, shipped: Shipped) -> tuple[AnyCase, dict[str, Any]]:
    """The case `given` (a shipped name or a TOML file), and what the file sets.  BadInput."""
    name, table = (given, {}) if given in shipped else _read_file(given, shipped)
    case = load_case(shipped[name])
    for key in files_of(case.parameters):
        if given not in shipped and isinstance(table.get(key), str):
            table[key] = str(Path(given).parent / table[key])
    return case, table


def read_assignment(text: str, origin: str = "--set") -> tuple[str, object]:
    """Split KEY=VALUE and read VALUE as a TOML value; a bare word is a string.  BadInput."""
    key, equals, value = (part.strip() for part in text.partition("="))
    if not key or not equals:
        raise BadInput(f"{origin} {_shorten(text)}: allowed is KEY=VALUE, as in length=4")
    try:
        table = tomllib.loads(f"value = {value}")
    except (ValueError, RecursionError):
        table = {}
    if list(table) == ["value"]:
        return key, table["value"]
    plain = (_BARE_WORD, _PHRASE, _FILE)
    if is_quantity(value) or any(form.fullmatch(value) for form in plain):
        return key, value
    raise BadInput(
        f"{origin} {key}: {_shorten(value)!r} is not a TOML value; "
        f'allowed are a number, true or false, a word, "text" or a list as in [400, 100]'
    )


def _read_file(given: str, shipped: Shipped) -> tuple[str, dict[str, Any]]:
    """The case name and the remaining keys of a TOML file."""
    try:
        table = tomllib.loads(_text(Path(given)))
    except FileNotFoundError:
        raise BadInput(
            f"no case or file {given!r}{meant(given, shipped)}; "
            f"allowed: a TOML file or one of {', '.join(shipped)}"
        ) from None
    except OSError as error:
        raise BadInput(f"cannot read the case file {given!r}: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise BadInput(f"{given}: not a TOML file: {_shorten(str(error), 200)}") from None
    name = table.pop("case", None)
    if not isinstance(name, str) or name not in shipped:
        shown = "no case" if name is None else f"case = {_shown(name)}"
        allowed = " or ".join(f'case = "{known}"' for known in shipped)
        raise BadInput(f"{given}: {shown}{meant(str(name), shipped)}; allowed: {allowed}")
    return name, table


def _text(path: Path) -> str:
    """What a file holds.  Raises OSError, and ValueError for a file that is no text or too long."""
    with path.open("rb") as file:
        content = file.read(_LARGEST + 1)
    if len(content) > _LARGEST:
        raise ValueError(f"it is longer than {_LARGEST} bytes")
    return content.decode("utf-8")


def _validate(
    kind: type[Parameters], values: Mapping[str, Any], origins: Mapping[str, str]
) -> Parameters:
    known = list(kind.model_fields)
    for key in values:
        if key not in kind.model_fields:
            raise BadInput(
                f"{origins[key]}: unknown key {_shorten(key)!r}{meant(key, known)}; "
                f"allowed: {', '.join(known)}"
            )
    try:
        return kind(**values)
    except ValidationError as error:
        raise BadInput(_one_line(kind, values, origins, error)) from None
    except KernelError as error:
        raise BadInput(str(error)) from None


def _one_line(
    kind: type[Parameters],
    values: Mapping[str, Any],
    origins: Mapping[str, str],
    error: ValidationError,
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


def _shown(value: object) -> str:
    return _shorten(json.dumps(value, default=str, ensure_ascii=False))


def _shorten(text: str, limit: int = _SHOWN) -> str:
    return text if len(text) <= limit else text[: limit - 3] + "..."
