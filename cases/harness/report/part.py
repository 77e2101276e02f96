"""Parts of a report; a case adds parts of its own, the page puts them one below another."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from softehl.runtime.io import Cell

_BROAD = 1.6  # width over height of a picture with several panels


@dataclass(frozen=True)
class ReportTable:
    """A table with a caption; numbers are shown with four digits."""

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[Cell]]


@dataclass(frozen=True, eq=False)
class ReportPicture:
    """A picture (PNG) with a caption."""

    caption: str
    png: bytes

    @property
    def broad(self) -> bool:
        """True if it is much wider than high: a narrow page shows it at a size that can be read."""
        width, height = struct.unpack(">II", self.png[16:24])
        return bool(width > _BROAD * height)


@dataclass(frozen=True, eq=False)
class Part:
    """A part of a report under a title: text, pictures, interactive plots (Bokeh), tables, lines.

    folded: whether it is shown closed until it is asked for.
    """

    title: str
    text: str = ""
    pictures: Sequence[ReportPicture] = ()
    plots: Sequence[Any] = ()
    tables: Sequence[ReportTable] = ()
    lines: Sequence[str] = ()
    folded: bool = False


@dataclass(frozen=True, eq=False)
class FinishedRun:
    """A run that is in a folder, whole or not: its parameters, its rows, what run.json says."""

    folder: Path
    case: Any
    parameters: Any
    rows: Sequence[Any]
    rejected: Sequence[Any] = ()
    content: dict[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Name of the run in a report."""
        return self.folder.resolve().name

    @property
    def summary(self) -> list[str]:
        """The main results in words; those of a run that goes on are of the rows so far."""
        lines: list[str] = self.case.summary(self.parameters, self.rows)
        if lines and self.content.get("status") == "running":
            lines[0] = type(lines[0])(f"so far, of {len(self.rows)} states: {lines[0].strip()}")
        return lines
