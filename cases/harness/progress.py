"""Progress of a case: a bar on a terminal, plain lines elsewhere, or nothing."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import TracebackType
from typing import Self

import click
from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from softehl.cases.harness.row import Row
from softehl.log import LOG

_LINES = 10.0  # seconds between lines where there is no terminal


class Display:
    """Shows the stages of one or more workers (runs side by side); this one shows nothing.

    foreword: lines that are shown before the first stage.
    """

    def __init__(self, foreword: Sequence[str] = ()) -> None:
        self._foreword = list(foreword)

    def __enter__(self) -> Self:
        """Start showing."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Stop showing."""

    def begin_stage(self, worker: str, title: str) -> None:
        """A stage begins in a worker."""
        LOG.info(title)
        for line in self._foreword:
            self.say(line)
        self._foreword.clear()

    def say(self, line: str) -> None:
        """Show a line of its own."""

    def step(self, worker: str, text: str, fraction: float | None) -> None:
        """A step converged; fraction: share of the stage done in [0, 1], if known."""
        LOG.info(text)

    def state(self, row: Row) -> None:
        """A row was saved."""


class ProgressLines(Display):
    """One line a stage and one a row, on stderr."""

    def begin_stage(self, worker: str, title: str) -> None:
        """See :class:`Display`."""
        super().begin_stage(worker, title)
        self.say(title)

    def say(self, line: str) -> None:
        """See :class:`Display`."""
        click.echo(line, err=True)

    def state(self, row: Row) -> None:
        """See :class:`Display`."""
        self.say(f"  {row.line}")


class Bars(Display):
    """A bar for each worker with stage and step, on stderr."""

    def __init__(self, console: Console, foreword: Sequence[str] = ()) -> None:
        super().__init__(foreword)
        self._progress = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=24),
            TextColumn("step {task.fields[count]}  {task.fields[text]}", markup=False),
            TimeElapsedColumn(),
            console=console,
        )
        self._tasks: dict[str, TaskID] = {}
        self._counts: dict[str, int] = {}

    def __enter__(self) -> Self:
        """See :class:`Display`."""
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """See :class:`Display`."""
        self._progress.stop()

    def begin_stage(self, worker: str, title: str) -> None:
        """See :class:`Display`."""
        super().begin_stage(worker, title)
        if worker in self._tasks:
            self._progress.remove_task(self._tasks[worker])
        self._tasks[worker] = self._progress.add_task(title, total=None, count=0, text="")
        self._counts[worker] = 0

    def step(self, worker: str, text: str, fraction: float | None) -> None:
        """See :class:`Display`."""
        super().step(worker, text, fraction)
        if worker not in self._tasks:
            return
        self._counts[worker] += 1
        self._progress.update(
            self._tasks[worker],
            total=None if fraction is None else 1.0,
            completed=fraction or 0.0,
            count=self._counts[worker],
            text=text,
        )

    def say(self, line: str) -> None:
        """See :class:`Display`."""
        self._progress.console.print(line, highlight=False, markup=False)

    def state(self, row: Row) -> None:
        """See :class:`Display`."""
        self.say(f"  {row.line}")


@contextmanager
def make_counter(done: int, total: int) -> Iterator[Callable[[], None]]:
    """Shows how many runs are done: a bar on a terminal, elsewhere a line now and then, on stderr.

    Yields a function to be called after each run.
    """
    console, last = Console(stderr=True), time.monotonic()
    columns = ("{task.completed} of {task.total} runs", BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        task = progress.add_task("", total=total, completed=done)

        def count() -> None:
            nonlocal done, last
            done += 1
            progress.update(task, completed=done)
            if not console.is_terminal and time.monotonic() - last > _LINES:
                last = time.monotonic()
                click.echo(f"{done} of {total} runs", err=True)

        yield count


def make_display(foreword: Sequence[str] = (), *, quiet: bool) -> Display:
    """The display that fits where stderr goes."""
    if quiet:
        return Display()
    console = Console(stderr=True)
    return Bars(console, foreword) if console.is_terminal else ProgressLines(foreword)
