"""What the user sees while a case runs: a bar on a terminal, plain lines elsewhere, or nothing."""

from types import TracebackType
from typing import Self

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from softehl.cases.harness.curve import CurveRow


class Display:
    """Shows the stages of one or more lanes (runs side by side); this one shows nothing."""

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

    def stage(self, lane: str, title: str) -> None:
        """A stage begins on a lane."""

    def step(self, lane: str, text: str, fraction: float | None) -> None:
        """A step converged; fraction: share of the stage done in [0, 1], if known."""

    def state(self, row: CurveRow) -> None:
        """A film state was saved."""


class Lines(Display):
    """One line a stage and one a state, on stderr."""

    def stage(self, lane: str, title: str) -> None:
        """See :class:`Display`."""
        click.echo(title, err=True)

    def state(self, row: CurveRow) -> None:
        """See :class:`Display`."""
        click.echo(state_text(row), err=True)


class Bars(Display):
    """A bar for each lane with stage, p_s, U and step, on stderr."""

    def __init__(self, console: Console) -> None:
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

    def stage(self, lane: str, title: str) -> None:
        """See :class:`Display`."""
        if lane in self._tasks:
            self._progress.remove_task(self._tasks[lane])
        self._tasks[lane] = self._progress.add_task(title, total=None, count=0, text="")
        self._counts[lane] = 0

    def step(self, lane: str, text: str, fraction: float | None) -> None:
        """See :class:`Display`."""
        if lane not in self._tasks:
            return
        self._counts[lane] += 1
        self._progress.update(
            self._tasks[lane],
            total=None if fraction is None else 1.0,
            completed=fraction or 0.0,
            count=self._counts[lane],
            text=text,
        )

    def state(self, row: CurveRow) -> None:
        """See :class:`Display`."""
        self._progress.console.print(state_text(row), highlight=False, markup=False)


def make_display(*, quiet: bool) -> Display:
    """The display that fits where stderr goes."""
    if quiet:
        return Display()
    console = Console(stderr=True)
    return Bars(console) if console.is_terminal else Lines()


def state_text(row: CurveRow) -> str:
    """One line on a saved state."""
    place = f"p_s = {row.sealed_pressure_MPa:g} MPa, U = {row.rod_speed_mm_s:+g} mm/s"
    value = f"h* = {row.h_star_um:.4g} um" if row.usable else f"{row.verdict}: not a result"
    return f"  {place}: {value}"
