"""Values of keys: type checks, agreement of values that are given twice, messages."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from math import isclose
from sys import float_info
from typing import Any, TypeGuard

from pydantic import ValidationError


def number(value: object) -> TypeGuard[float]:
    """True if a value is a finite number; True and False are none."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    return abs(value) <= float_info.max


def put(values: dict[str, Any], key: str, value: Any, source: str, within: float = 1e-6) -> None:
    """Set a key, or see that what was given agrees.

    source: what it follows from, in words. within: as in `agree`. Raises ValueError for a
    contradiction.
    """
    previous = values.get(key)
    if previous is None:
        values[key] = value
    elif not agree(previous, value, within):
        raise ValueError(
            f"{key} = {value_text(previous)} and {source} contradict: the latter gives "
            f"{value_text(value)}; leave one of them out"
        )


def agree(existing: object, value: object, within: float = 1e-6) -> bool:
    """True if what was given, a number or several, is what follows, or has yet to be refused.

    A value of another type is refused with its key. within: relative difference that agrees,
    usually less than tables and units round.
    """
    existing_numbers, expected = _numbers(existing), _numbers(value)
    if not existing_numbers or not all(map(number, existing_numbers)):
        return True
    return len(existing_numbers) == len(expected) and all(
        isclose(a, b, rel_tol=within, abs_tol=1e-12)
        for a, b in zip(existing_numbers, expected, strict=True)
    )


@contextmanager
def one_line(where: str, **also: str) -> Iterator[None]:
    """The first complaint about a record, its key behind `where`.  Raises ValueError.

    also: key -> what its complaint ends with.
    """
    try:
        yield
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        key, message = ".".join(map(str, first["loc"])), first["msg"].removeprefix("Value error, ")
        at = f"{where}{key}".rstrip(" .:")
        raise ValueError(f"{at}: {message[0].lower()}{message[1:]}{also.get(key, '')}") from None


def value_text(value: object) -> str:
    """A number, or several, in words."""
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(value_text, value))}]"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def times(value: Any, factor: float) -> Any:
    """A number, or each of several, times a factor."""
    return tuple(factor * v for v in value) if isinstance(value, tuple) else factor * value


def _numbers(value: Any) -> list[Any]:
    return list(value) if isinstance(value, list | tuple) else [value]
