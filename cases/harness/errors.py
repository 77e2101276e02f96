"""The error for input that cannot be used."""

import click

from softehl.errors import SoftehlError


class BadInput(SoftehlError, click.ClickException):  # noqa: N818 (named after what it is)
    """Input that cannot be used; the message is one line.  Exit code 2."""

    exit_code = 2

    def __init__(self, message: str) -> None:
        super().__init__(" ".join(message.split()))


def one_line(error: BaseException) -> str:
    """A failure of the program in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())
