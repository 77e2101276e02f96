"""Folder of `curve.csv`: the rows of a run as a table on disk, with the files of each of them."""

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Generic, TypeVar

from softehl.cases.harness.file_content import file_digest, write_content
from softehl.cases.harness.observer import State
from softehl.cases.harness.row import Row
from softehl.runtime.io import write_csv

R = TypeVar("R", bound=Row)


class CurveFolder(Generic[R]):
    """A curve.csv with the files of each of its rows, which are of one class."""

    def __init__(self, path: Path, kind: type[R]) -> None:
        self.path = path
        self.kind = kind
        self.rows: list[R] = []
        self.digests: dict[str, str] = {}

    def load(self) -> None:
        """Take over the rows whose files are there.  Raises OSError, ValueError."""
        rows = self.kind.read(self.path / "curve.csv")
        self.rows = [row for row in rows if self._is_there(row)]

    def add(self, state: State) -> R:
        """Write the files of a state, then the curve with its row."""
        row = state.row
        assert isinstance(row, self.kind), f"{row!r} is no row of this case"
        self.path.mkdir(parents=True, exist_ok=True)
        for name, content in zip(row.file_names(), state.contents, strict=True):
            write_content(self.path / name, content)
            self.digests[name] = file_digest(self.path / name)
        others = [other for other in self.rows if other.key != row.key]
        self.rows = sorted([*others, row], key=lambda r: r.order)
        self.save()
        return row

    def keep(self, rows: Iterable[R]) -> None:
        """Take over rows that are known to be good, with their files."""
        self.rows = sorted(rows, key=lambda r: r.order)
        names = [name for row in self.rows for name in row.file_names()]
        self.digests = {name: file_digest(self.path / name) for name in names}

    def drop(self, key: float) -> None:
        """Take a row out of the curve with its files; nothing is left of a curve without rows."""
        gone = [row for row in self.rows if row.key == key]
        if not gone:
            return
        self.rows = [row for row in self.rows if row.key != key]
        if self.rows:
            self.save()
        else:
            (self.path / "curve.csv").unlink(missing_ok=True)
        for row in gone:
            for name in row.file_names():
                (self.path / name).unlink(missing_ok=True)
        with suppress(OSError):  # something is in it
            self.path.rmdir()

    def save(self) -> None:
        """Write curve.csv, a header alone if there is no row yet."""
        write_csv(self.path / "curve.csv", self.kind.header(), [row.cells() for row in self.rows])

    def _is_there(self, row: R) -> bool:
        return all((self.path / name).exists() for name in row.file_names())
