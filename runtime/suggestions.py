"""Suggestions for messages: similar names, lists of names, signatures of functions."""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Iterable

_AS_GOOD = 0.05
"""Names whose likeness differs by less are as likely: `pressure` may be `sealed_pressure`."""


_FEW = 2
"""Names that a hint has at most."""


def did_you_mean(text: object, allowed: Iterable[str]) -> str:
    """A hint at the name that was probably meant, at several that are as likely, or nothing.

    Capitals do not count. A word that is like no name may be one of the words of a few names.
    """
    word, names = str(text).lower(), list(allowed)
    close = difflib.get_close_matches(word, [name.lower() for name in names], n=2)
    likeness = [difflib.SequenceMatcher(None, name, word).ratio() for name in close]
    likely = [n for n, r in zip(close, likeness, strict=True) if r > likeness[0] - _AS_GOOD]
    likely = likely or [name.lower() for name in names if word in name.lower().split("_")]
    likely_names = [repr(name) for name in names if name.lower() in likely]
    return f" (did you mean {' or '.join(likely_names)}?)" if 0 < len(likely_names) <= _FEW else ""


def join_names(names: Iterable[str]) -> str:
    """Names for a message, "none" where there are none."""
    return ", ".join(names) or "none"


def short_list(allowed: Iterable[str], max_names: int = 5) -> str:
    """The first of many names and how many there are."""
    names = list(allowed)
    return (
        join_names(names)
        if len(names) <= max_names + 1
        else f"{join_names(names[:max_names])}, ... ({len(names)})"
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
