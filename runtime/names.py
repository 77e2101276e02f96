"""Names that were not found: a hint at the one that was probably meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_AS_GOOD = 0.05
"""Names whose likeness differs by less are as likely: `pressure` may be `sealed_pressure`."""


def meant(given: object, known: Iterable[str]) -> str:
    """A hint at the name that was probably meant, at several that are as likely, or nothing."""
    word = str(given)
    close = difflib.get_close_matches(word, list(known), n=2)
    likeness = [difflib.SequenceMatcher(None, name, word).ratio() for name in close]
    likely = [repr(n) for n, r in zip(close, likeness, strict=True) if r > likeness[0] - _AS_GOOD]
    return f" (did you mean {' or '.join(likely)}?)" if likely else ""


def listed(known: Iterable[str]) -> str:
    """Names for a message, "none" where there are none."""
    return ", ".join(known) or "none"
