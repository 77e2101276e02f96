"""Names that were not found: a hint at the one that was probably meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def meant(given: object, known: Iterable[str]) -> str:
    """A hint at the name that was probably meant, or nothing."""
    close = difflib.get_close_matches(str(given), list(known), n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def listed(known: Iterable[str]) -> str:
    """Names for a message, "none" where there are none."""
    return ", ".join(known) or "none"
