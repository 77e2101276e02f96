"""Callbacks after each converged step: progress on a terminal, files, functions of the user."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from softehl.log import LOG
from softehl.runtime.definition.argument_checks import writable
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.io import write_pvd
from softehl.runtime.results.result import Result

OnStep = Callable[[Result], object]


@dataclass(eq=False)
class Series:
    """A `.pvd` file that names a `.vtu` file for each result, complete at any moment.

    Given as `write` or `on_step` of a path: part.pvd names part_0001.vtu, ... beside it.

    Parameters
    ----------
    path : str or Path
        The .pvd file.
    since : float, optional
        Results up to this load factor or time that the file names are kept.
    entries : list of tuple
        Load factor or time, and file, of each result.

    Raises
    ------
    StudyError
        The name does not end in .pvd, or the file cannot be written.
    """

    path: Path
    since: float | None = None
    entries: list[tuple[float, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Raises StudyError for a name that does not end in .pvd, or cannot be written."""
        self.path = Path(self.path)
        if self.path.suffix != ".pvd":
            raise StudyError(f"write = {str(self.path)!r}: a series of results is written as .pvd")
        writable(f"write = {str(self.path)!r}", self.path)
        if self.since is not None and self.path.exists():
            self.entries = [e for e in read_series(self.path) if e[0] <= self.since]

    def __call__(self, result: Result) -> None:
        """Write one more result; its file first, then the list that names it."""
        kind = "vtu" if result.system.mesh.piece is None else "pvtu"
        name = f"{self.path.stem}_{len(self.entries) + 1:04d}.{kind}"
        result.write(self.path.with_name(name))
        self.entries.append((result.t, name))
        if result.system.comm.is_root:
            write_pvd(self.path, self.entries)


def read_series(path: Path) -> list[tuple[float, str]]:
    """Times and files of a `.pvd`; raises OSError, or StudyError where it is none."""
    from xml.etree import ElementTree  # late: few need it

    try:
        rows = ElementTree.parse(path).getroot().iter("DataSet")
        return [(float(row.attrib["timestep"]), row.attrib["file"]) for row in rows]
    except (ElementTree.ParseError, KeyError, ValueError):
        raise StudyError(f"{str(path)!r} is no series of results; remove it") from None


@dataclass(eq=False)
class Progress:
    """Progress line on the terminal; a line for each step elsewhere, and in the log.

    name: of what grows, such as "load factor", from `begin` to `until` (None: unknown). inplace:
    rewrite the one line. note: returns words for the end of the line. visible: on stderr; else
    steps are in the log alone.
    """

    name: str
    begin: float
    until: float | None
    inplace: bool
    note: Callable[[], str] = str
    visible: bool = True
    steps: int = 0
    since: float = field(default_factory=time.monotonic)

    @classmethod
    def on_stderr(
        cls,
        visible: bool | None,
        name: str,
        begin: float,
        until: float | None,
        *,
        note: Callable[[], str],
    ) -> Progress:
        """Return progress on stderr; visible: None if that is a terminal."""
        terminal = sys.stderr.isatty()
        return cls(name, begin, until, terminal, note, terminal if visible is None else visible)

    def __call__(self, result: Result) -> None:
        """Report one more step."""
        if not self.steps and result.t == self.begin:
            return  # where the path begins
        self.steps += 1
        if not (self.visible or LOG.isEnabledFor(logging.INFO)):
            return
        end = "" if self.until is None else f" of {self.until:g}"
        note = self.note()
        text = (
            f"step {self.steps}: {self.name} {result.t:.4g}{end}, {result.iterations} iterations, "
            f"{time.monotonic() - self.since:.1f} s{f' ({note})' if note else ''}"
        )
        LOG.info(text)
        if not self.visible:
            return
        sys.stderr.write(f"\r\x1b[K{text}" if self.inplace else f"{text}\n")
        sys.stderr.flush()

    def close(self) -> None:
        """End the line."""
        if self.visible and self.inplace and self.steps:
            sys.stderr.write("\n")


class Callbacks:
    """Callbacks after each converged step; as a context manager it closes the progress line.

    write: a `.pvd` file.
    """

    def __init__(
        self,
        progress: Progress | None,
        write: str | Path | Series | None = None,
        on_step: OnStep | None = None,
    ) -> None:
        self._progress = progress
        series = Series(Path(write)) if isinstance(write, str | Path) else write
        self._callbacks: list[OnStep] = [f for f in (series, progress, on_step) if f is not None]

    def __call__(self, result: Result) -> None:
        for callback in self._callbacks:
            callback(result)

    def __enter__(self) -> Callbacks:
        return self

    def __exit__(self, *_: object) -> None:
        if self._progress is not None:
            self._progress.close()

    def around(self, results: Iterator[Result]) -> Iterator[Result]:
        """Yield the results, each after its callbacks."""
        with self:
            for result in results:
                self(result)
                yield result
