"""Names that were not found, functions of other arguments: hints at what was probably meant."""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Iterable

_AS_GOOD = 0.05
"""Names whose likeness differs by less are as likely: `pressure` may be `sealed_pressure`."""


_FEW = 2
"""Names that a hint has at most."""


def meant(given: object, known: Iterable[str]) -> str:
    """A hint at the name that was probably meant, at several that are as likely, or nothing.

    Capitals do not count. A word that is like no name may be one of the words of a few names.
    """
    word, names = str(given).lower(), list(known)
    close = difflib.get_close_matches(word, [name.lower() for name in names], n=2)
    likeness = [difflib.SequenceMatcher(None, name, word).ratio() for name in close]
    likely = [n for n, r in zip(close, likeness, strict=True) if r > likeness[0] - _AS_GOOD]
    likely = likely or [name.lower() for name in names if word in name.lower().split("_")]
    found = [repr(name) for name in names if name.lower() in likely]
    return f" (did you mean {' or '.join(found)}?)" if 0 < len(found) <= _FEW else ""


def listed(known: Iterable[str]) -> str:
    """Names for a message, "none" where there are none."""
    return ", ".join(known) or "none"


def few(known: Iterable[str], most: int = 5) -> str:
    """The first of many names and how many there are."""
    names = list(known)
    return (
        listed(names) if len(names) <= most + 1 else f"{listed(names[:most])}, ... ({len(names)})"
    )


def misfit(function: object, *arguments: str) -> str:
    """Arguments of a function, for a message, if it cannot be called with these; else ""."""
    if not callable(function):
        return f"a function of ({', '.join(arguments)}) is needed, given {function!r}"
    try:
        takes = inspect.signature(function)
    except (TypeError, ValueError):  # one that is built in does not tell
        return ""
    try:
        takes.bind(*arguments)
    except TypeError:
        return f"a function of ({', '.join(arguments)}) is needed, this one takes {takes}"
    return ""
