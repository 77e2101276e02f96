"""Values of keys: numbers or several; what follows from others is set, or agrees with them."""

from __future__ import annotations

from math import isclose
from typing import Any, TypeGuard


def number(value: object) -> TypeGuard[float]:
    """True if a value is a number; True and False are none."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def put(values: dict[str, Any], key: str, value: Any, source: str, within: float = 1e-6) -> None:
    """Set a key, or see that what was given agrees.

    value: a number or several. source: what it follows from, in words. within: relative difference
    that agrees, usually less than tables and units round. A value of another type stays, to be
    refused with its key. Raises ValueError for a contradiction.
    """
    before = values.get(key)
    if before is None:
        values[key] = value
        return
    given, expected = _numbers(before), _numbers(value)
    if not all(map(number, given)):
        return
    if len(given) != len(expected) or not all(
        isclose(a, b, rel_tol=within, abs_tol=1e-12) for a, b in zip(given, expected, strict=True)
    ):
        raise ValueError(
            f"{key} = {shown(before)} and {source} contradict: the latter gives {shown(value)}; "
            "leave one of them out"
        )


def shown(value: object) -> str:
    """A number, or several, in words."""
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(shown, value))}]"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def times(value: Any, factor: float) -> Any:
    """A number, or each of several, times a factor."""
    return tuple(factor * v for v in value) if isinstance(value, tuple) else factor * value


def _numbers(value: Any) -> list[Any]:
    return list(value) if isinstance(value, list | tuple) else [value]
