"""Bases of the errors that a user meets."""

from __future__ import annotations

from typing import Any


class SoftehlError(Exception):
    """Base of all errors of softehl; the message is one line that says what is allowed.

    Each also is an error of Python's: a `StudyError` is a ValueError, `NotConverged` a
    RuntimeError.
    """

    def __reduce__(self) -> tuple[Any, ...]:
        """For `pickle`: processes of a pool hand their errors on."""
        return _restored, (type(self), self.args, vars(self))


def _restored(kind: type[SoftehlError], args: tuple[Any, ...], state: dict[str, Any]) -> Any:
    """An error as it was, whatever arguments its class is made with."""
    error = kind.__new__(kind, *args)
    vars(error).update(state)
    return error


class UnknownNameError(SoftehlError, KeyError):
    """No unknown, block or field has this name; the message names those that there are."""

    def __str__(self) -> str:
        """The message as it is; that of a KeyError is quoted."""
        return " ".join(map(str, self.args))
