"""Signals that end a command, and readers of its output that close the stream."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

from softehl.system import END_SIGNALS


class Ended(BaseException):
    """A signal that asks the process to end: what was reached is saved on the way out."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


@contextmanager
def signals() -> Iterator[None]:
    """Let the signals that ask for it end a run as Ctrl-C does; in the main thread only."""

    def end(number: int, _: FrameType | None) -> None:
        raise Ended(number)

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous = {number: signal.signal(number, end) for number in END_SIGNALS}
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


class _Stream:
    """A stream whose reader may leave, as in `softehl run CASE | head -1`: the run goes on."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write, or throw away what nobody reads."""
        with suppress(BrokenPipeError):
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        """See :meth:`write`."""
        try:
            self._stream.flush()
        except BrokenPipeError:
            self._stream = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 (it lives as long as we do)


@contextmanager
def readers_that_leave() -> Iterator[None]:
    """Let nothing but the output be lost where a reader of stdout or stderr leaves.

    A stream that is closed from the start, as by `>&-`, is None in Python.
    """
    previous = sys.stdout, sys.stderr
    with open(os.devnull, "w", encoding="utf-8") as nobody:
        sys.stdout, sys.stderr = (_Stream(nobody if s is None else s) for s in previous)
        try:
            yield
            sys.stdout.flush()
        finally:
            sys.stdout, sys.stderr = previous
