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
from typing import Any, Literal, get_args, get_origin

from pydantic import ValidationError

from softehl.cases.harness.case import (
    AnyCase,
    Run,
    find_named_case,
    is_reference,
    load_case,
)
from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.parameters import Parameters, files_of, keys_of
from softehl.cases.harness.units import is_number, is_quantity
from softehl.runtime.kernels.shared_library import KernelError
from softehl.runtime.suggestions import did_you_mean

Shipped = Mapping[str, str]
"""Name of a case that ships -> its module, which is imported when the case is needed."""

WAYS = ("grid", "list", "latin_hypercube", "random")
"""Tables of a study, which is no case but many: how its keys vary."""

_BARE_WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
_DASHED = re.compile(r"[-+]?0\d+")
"""A number that TOML does not read, as in the name of a part, "-010"."""
_FILE = re.compile(r"(\.{0,2}/)?[A-Za-z_][A-Za-z0-9_./-]*\.[A-Za-z]{1,5}")
_PHRASE = re.compile(
    r"""(?=.*[^\W\d_]|.*[\u00b1\u00d7\u00d8\u2300\#\"]|.*\d ?[+(-])(?!["'])"""
    r"""(?:[^\[\]{}=\\\n]|(?<=R[aq])=)+"""
)
"""Words without quotation marks, sizes with limits and finishes ("Ra=0.2") among them."""


_SHOWN = 60
_LARGEST = 1 << 20  # bytes of a case file; also ends reading what has no end


class Contradiction(BadInput):
    """Keys that are allowed each, but not together."""


def read_case(
    source: str,
    shipped: Shipped,
    assignments: Iterable[str] = (),
    options: Mapping[str, str] = MappingProxyType({}),
) -> Run:
    """Read the case `source` (a shipped name or a TOML file) and apply KEY=VALUE `assignments`.

    options: keys that have an option of their own, as they were typed.  Raises BadInput.
    """
    case, values = find_case(source, shipped)
    origins = dict.fromkeys(values, source)
    typed = [(text, "--set") for text in assignments]
    typed += [(f"{key}={text}", f"--{key}") for key, text in options.items()]
    seen = dict[str, object]()
    for text, origin in typed:
        key, value = read_assignment(text, origin)
        if repr(seen.setdefault(key, value)) != repr(value):
            both = f"{value_text(seen[key])} and {value_text(value)}"
            raise BadInput(f"{origin} {key}: {both}; allowed: one of them")
        origins[_put(values, key, value)] = origin
    checked = validated(case.parameters, values, origins)
    return Run(case, checked, set_keys=frozenset(values))


def _put(values: dict[str, Any], key: str, value: object) -> str:
    """Set a key, or with dots a key of a table in it, as TOML has it; the first of them."""
    *tables, last = key.split(".")
    for name in tables:
        inner = values.get(name)
        values[name] = dict(inner) if isinstance(inner, dict) else {}
        values = values[name]
    values[last] = value
    return key.partition(".")[0]


def find_case(source: str, shipped: Shipped) -> tuple[AnyCase, dict[str, Any]]:
    """The case `source` (shipped name, "module:attribute" or TOML file), and what the file sets.

    Raises BadInput.
    """
    named = source in shipped or is_reference(source)
    name, table = (source, {}) if named else _read_file(source, shipped)
    case = find_named_case(name, shipped)
    for key in files_of(case.parameters):
        if not named and isinstance(table.get(key), str):
            table[key] = str(Path(source).parent / table[key])
    return case, table


def read_assignment(text: str, origin: str = "--set") -> tuple[str, object]:
    """Split KEY=VALUE and read VALUE as a TOML value; a bare word is a string.  BadInput."""
    key, equals, value = (part.strip() for part in text.partition("="))
    if not key or not equals:
        raise BadInput(f"{origin} {shortened(text)}: allowed is KEY=VALUE, see softehl keys")
    plain = (_BARE_WORD, _PHRASE, _FILE, _DASHED)
    if "," in value and is_number(value) and not value.endswith(","):
        return key, value  # a number with a decimal comma or two numbers, as the key has it
    if (read := _toml_value(value)) is not None:
        return key, read
    if is_quantity(value) or any(form.fullmatch(value) for form in plain):
        return key, value
    if "," in value and (read := _toml_value(f"[{value}]")) is not None:  # 400, 100
        return key, read
    items = [item.strip() for item in value[1:-1].split(",")]
    if value.startswith("[") and value.endswith("]") and all(map(is_quantity, items)):
        return key, items
    raise BadInput(
        f"{origin} {key}: {shortened(value)!r} is not a TOML value; "
        f'allowed are a number, true or false, a word, "text" or a list as in [400, 100]'
    )


def _toml_value(text: str) -> Any:
    """A value in TOML, None where it is none."""
    try:
        table = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return None
    return table["value"] if list(table) == ["value"] else None


def _read_file(path: str, shipped: Shipped) -> tuple[str, dict[str, Any]]:
    """The case name and the remaining keys of a TOML file."""
    allowed = f"a TOML file or one of {', '.join(shipped)}"
    if not Path(path).exists():
        allowed += _as_value(path, shipped)
    table = read_toml(path, "no case or file", allowed, shipped)
    if any(isinstance(table.get(kind), dict | list) for kind in WAYS):
        raise BadInput(f"{path} is a study of many runs: softehl sweep {path}")
    name = table.pop("case", None)
    if not isinstance(name, str) or not (name in shipped or is_reference(name)):
        problem = "no case" if name is None else f"case = {value_text(name)}"
        allowed = " or ".join(f'case = "{case_name}"' for case_name in shipped)
        raise BadInput(f"{path}: {problem}{did_you_mean(str(name), shipped)}; allowed: {allowed}")
    return name, table


def _as_value(text: str, shipped: Shipped) -> str:
    """Hint how to run a case whose key has a value of this name, "" where there is none."""
    word = text.lower().replace("-", "_")
    for name, module in shipped.items():
        for key, field in load_case(module).parameters.model_fields.items():
            if get_origin(field.annotation) is Literal and word in get_args(field.annotation):
                return f", as in softehl run {name} --set {key}={word}"
    return ""


def read_toml(
    path: str, missing: str, allowed: str, candidates: Iterable[str] = ()
) -> dict[str, Any]:
    """Content of a TOML file; the words are for a file that is not there.  Raises BadInput."""
    text = ""
    try:
        text = _text(Path(path))
        return tomllib.loads(text)
    except FileNotFoundError:
        raise BadInput(
            f"{missing} {path!r}{did_you_mean(path, candidates)}; allowed: {allowed}"
        ) from None
    except OSError as error:
        raise BadInput(f"cannot read the case file {path!r}: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        message = f"{shortened(str(error), 200)}{_slip(str(error), text)}"
        raise BadInput(f"{path}: not a TOML file: {message}") from None


def _slip(error: str, text: str) -> str:
    """The key of a usual slip in the line that an error of TOML names, and what to write."""
    lines = text.splitlines()
    number = int(match[1]) if (match := re.search(r"at line (\d+)", error)) else 0
    if not 0 < number <= len(lines):
        return ""
    key, _, value = (part.strip() for part in lines[number - 1].partition("="))
    value = value.partition("#")[0].strip()
    if error.startswith("Cannot overwrite"):
        return f": {key} is given twice"
    if _DASHED.fullmatch(value):
        return f': write {key} = "{value}"'
    if "," in value and is_number(value):
        return f": write {key} = {value.replace(',', '.')}"
    if "," in value and all(is_number(item) for item in value.split(",")):
        return f": write {key} = [{value}]"
    return ""


def _text(path: Path) -> str:
    """Text of a file.  Raises OSError, and ValueError for a file that is no text or too long."""
    with path.open("rb") as file:
        content = file.read(_LARGEST + 1)
    if len(content) > _LARGEST:
        raise ValueError(f"it is longer than {_LARGEST} bytes")
    return content.decode("utf-8-sig")


def require_known(kind: type[Parameters], keys: Iterable[str], origins: Mapping[str, str]) -> None:
    """Raise BadInput unless a case has all these keys.  origins: where they were given."""
    names = [one.name for one in keys_of(kind)]
    for key in keys:
        if key not in kind.model_fields:
            hint = (
                f" ({kind.hints[key.lower()]})"
                if key.lower() in kind.hints
                else did_you_mean(key, names)
            )
            problem = f"{origins[key]}: unknown key {shortened(key)!r}{hint}"
            raise BadInput(f"{problem}; allowed: what `softehl keys` lists")


def validated(
    kind: type[Parameters], values: Mapping[str, Any], origins: Mapping[str, str]
) -> Parameters:
    """Checked parameters.  origins: where each key was given.

    Raises BadInput, :class:`Contradiction` where no key alone is wrong.
    """
    require_known(kind, values, origins)
    try:
        return kind(**values)
    except ValidationError as error:
        message = _one_line(kind, values, origins, error)
        alone = error.errors(include_url=False, include_context=False)[0]["loc"]
        raise (BadInput if alone else Contradiction)(message) from None
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
    # what was given before what follows from it
    complaints.sort(key=lambda one: bool(one["loc"]) and str(one["loc"][0]) not in origins)
    first, keys = complaints[0], {c["loc"][:1] for c in complaints}
    more = f" (and {len(keys) - 1} more)" if len(keys) > 1 else ""
    reason = first["msg"].removeprefix("Value error, ")
    reason = (reason[0].lower() + reason[1:]).replace("tuple", "list")
    if not first["loc"]:  # a relation between several keys
        return f"{' and '.join(sorted(set(origins.values())))}: {reason}"
    key = str(first["loc"][0])
    if key in origins:
        message = f"{origins[key]}: {key} = {value_text(values[key])}"
    else:
        sources = " and ".join(sorted(set(origins.values())))
        message = (
            f"{sources}: {key} = {value_text(first['input'])}, which follows from what was given"
        )
    return f"{message}: {reason}{more}; allowed: {kind.model_fields[key].description}"


def value_text(value: object) -> str:
    """A value in words."""
    return shortened(json.dumps(value, default=str, ensure_ascii=False))


def shortened(text: str, limit: int = _SHOWN) -> str:
    """A text of at most `limit` letters."""
    return text if len(text) <= limit else text[: limit - 3] + "..."
