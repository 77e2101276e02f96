"""Shares of the CPU time of a program."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any


class Clock:
    """Seconds of CPU by part; what is within another part counts there alone.

    parts: their names; what is in none of them belongs to the last.
    """

    def __init__(self, parts: Sequence[str]) -> None:
        self.seconds = dict.fromkeys(parts, 0.0)
        self.open = [parts[-1]]
        self.since = time.process_time()

    def turn(self) -> None:
        """Add the time that has passed to the part that is open."""
        now = time.process_time()
        self.seconds[self.open[-1]] += now - self.since
        self.since = now

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Within it time belongs to this part."""
        self.turn()
        self.open.append(name)
        yield
        self.turn()
        self.open.pop()

    def timed(self, function: Callable[..., Any], name: Callable[..., str]) -> Callable[..., Any]:
        """The function, its time in the part that `name` makes of its arguments."""

        def call(*arguments: Any, **options: Any) -> Any:
            with self.part(name(*arguments)):
                return function(*arguments, **options)

        return call
