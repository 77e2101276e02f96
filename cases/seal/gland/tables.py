"""Tables: those of standards and of makers in this folder, and files of a user."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import files


def rows(name: str) -> list[dict[str, str]]:
    """The rows of a table of this folder, by its columns."""
    text = files(__package__).joinpath(name).read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines()))


@contextmanager
def reading(name: object) -> Iterator[None]:
    """Names a file in what is wrong with it, a line.  Raises ValueError."""
    try:
        yield
    except (OSError, ValueError) as error:
        why = str(error)
        if isinstance(error, OSError):
            why = f"it cannot be read: {error.strerror or error}"
        elif isinstance(error, UnicodeDecodeError):
            why = "it cannot be read: not UTF-8 text"
        raise ValueError(f"{name}: {why}") from None
