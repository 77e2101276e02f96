"""Rows of a table on disk: each column is declared once, with its unit and its meaning.

From the declaration come the columns of a file and their text, what is read back, the entries of
run.json, the heads of the table on the terminal and the table in the documentation.
"""

import dataclasses
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import isnan, nan
from pathlib import Path
from typing import Any, ClassVar, Self, get_type_hints

from softehl.runtime.io import Cell, number_text, read_csv

OK = "ok"
"""Verdict of a row that may be used as a result."""

_MARK = "column"


@dataclass(frozen=True)
class Column:
    """A column of a table: its name there, the type of its cells, its unit and its meaning.

    head: what it is called on the terminal, empty if it is not shown there; neighbours with the
    same head share a column. number_format: format of its numbers there.
    """

    name: str
    kind: type
    unit: str
    meaning: str
    head: str = ""
    number_format: str = ""

    @property
    def title(self) -> str:
        """The head of a column for readers: its name in words, and its unit."""
        unit = self.unit.replace("%", "percent").replace(" ", "_").replace("/", "_(per_)?")
        text = re.sub(f"_{unit}(?=_|$)", "", self.name, count=1).replace("_", " ")
        return f"{text} [{self.unit}]" if self.unit else text

    def read(self, text: str) -> Cell:
        """The value of a cell; that of a number which is not there is nan.  Raises ValueError."""
        if self.kind is float and not text:
            return nan
        value: Cell = text if self.kind is str else self.kind(float(text))
        return value

    def show(self, value: Cell) -> str:
        """The text of a cell on the terminal; a number that is not known leaves it empty."""
        return (
            "" if isinstance(value, float) and isnan(value) else format(value, self.number_format)
        )


def column(
    unit: str, meaning: str, *, head: str = "", number_format: str = "", **default: Any
) -> Any:
    """Declare a field of a :class:`Record` to be a column; see :class:`Column`."""
    return dataclasses.field(metadata={_MARK: (unit, meaning, head, number_format)}, **default)


class Record:
    """Base of a frozen dataclass whose fields by :func:`column` are the columns of a table."""

    @classmethod
    def columns(cls) -> tuple[Column, ...]:
        """The columns in order."""
        hints = get_type_hints(cls)
        fields: Iterable[Any] = dataclasses.fields(cls)  # type: ignore[arg-type]
        return tuple(
            Column(field.name, hints[field.name], *field.metadata[_MARK])
            for field in fields
            if _MARK in field.metadata
        )

    @classmethod
    def header(cls) -> tuple[str, ...]:
        """The names of the columns: the first line of the file."""
        return tuple(column.name for column in cls.columns())

    @classmethod
    def titles(cls) -> tuple[str, ...]:
        """The heads of the columns for readers."""
        return tuple(column.title for column in cls.columns())

    @classmethod
    def parse(cls, cells: Sequence[str]) -> Self:
        """The record from the text of its cells.  Raises ValueError."""
        texts = zip(cls.columns(), cells, strict=True)
        return cls(**{column.name: column.read(text) for column, text in texts})

    @classmethod
    def read(cls, path: Path) -> list[Self]:
        """The records of a table, none where there is no such file.  Raises OSError, ValueError."""
        return [cls.parse(cells) for cells in read_csv(path, cls.header())] if path.exists() else []

    @classmethod
    def part_of(cls, other: Any) -> Self:
        """The record with the values of the same names of another object."""
        return cls(**{name: getattr(other, name) for name in cls.header()})

    def cells(self) -> tuple[Cell, ...]:
        """The values of the columns."""
        return tuple(getattr(self, name) for name in self.header())

    def as_dict(self) -> dict[str, Cell]:
        """Column -> value."""
        return dict(zip(self.header(), self.cells(), strict=True))


class Row(Record):
    """A row of curve.csv.  A case derives its own, with `verdict` as the last column.

    The first column with a head is the key: one of the values that the run was asked for.

    files: names of the files that belong to a row, with {} for :attr:`name`.
    """

    verdict: str
    files: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def key_column(cls) -> Column:
        """The column of the key."""
        return next(column for column in cls.columns() if column.head)

    @property
    def key(self) -> float:
        """Value that identifies this row in its run: one of those asked for."""
        return float(getattr(self, self.key_column().name))

    @classmethod
    def label(cls, key: float) -> str:
        """A row of which nothing is known but its key, in words."""
        column = cls.key_column()
        return f"{column.head} = {column.show(key)} {column.unit}".rstrip()

    @classmethod
    def labels(cls, keys: Sequence[float]) -> str:
        """Rows of which nothing is known but their keys, in words: "U = +200, +100 mm/s"."""
        column = cls.key_column()
        shown = ", ".join(column.show(key) for key in keys)
        return f"{column.head} = {shown} {column.unit}".rstrip() if shown else ""

    @property
    def name(self) -> str:
        """The part of a file name that tells this row from the others of its folder: key and unit.

        A unit has no slash there: "100mm_s".
        """
        return f"{number_text(self.key)}{self.key_column().unit.replace('/', '_')}"

    def shown(self, column: Column) -> str:
        """The text of a cell of this row on the terminal."""
        return column.show(getattr(self, column.name))

    @property
    def order(self) -> tuple[Any, ...]:
        """Sort key of the table; as it is, positive keys come first, and large ones."""
        return self.key < 0, -abs(self.key)

    @property
    def usable(self) -> bool:
        """True for a result; other rows go to the folder `rejected`."""
        return True

    @property
    def line(self) -> str:
        """The row in one line, as it is shown when it is there."""
        return f"{self.label(self.key)}: {self.verdict}"

    @classmethod
    def file_patterns(cls) -> tuple[str, ...]:
        """Patterns that the files of every row match."""
        return tuple(file.format("*") for file in cls.files)

    def file_names(self) -> tuple[str, ...]:
        """The files of this row, in the folder of the table."""
        return tuple(file.format(self.name) for file in self.files)
