"""What follows from the declaration of columns and keys: files, terminal, documentation."""

from dataclasses import dataclass
from math import nan
from typing import Literal

import pytest

from softehl.cases.harness.case import Case
from softehl.cases.harness.parameters import Nonzeros, Parameters, key, keys_of
from softehl.cases.harness.row import OK, Row, column
from softehl.cases.seal.states.state import FilmRow
from tests.cases.test_report import row as film_row


@dataclass(frozen=True)
class Fall(Row):
    """A made-up row: a stone that falls."""

    files = ("path_{}.csv",)
    height_m: float = column("m", "height", head="H", number_format="g")
    start_s: float = column("s", "when it is let go", head="time", number_format=".1f")
    end_s: float = column("s", "when it is there", head="time", number_format="+.1f")
    bounces: int = column("", "how often it is thrown back | or not")
    verdict: str = column("", "`ok`")


class Stone(Parameters):
    """Keys of every kind."""

    heights: Nonzeros = key((2.0, 1.0), "heights", unit="m")
    hard: bool = key(True, "whether it is")
    kind: Literal["round", "flat", "sharp"] = key("flat", "its shape")
    mass: float = key(1.0, "mass", unit="kg", gt=0, le=5)
    name: str | None = key(None, "its name", bounds="left out = none")


class Falls(Case[Stone, Fall]):
    """A made-up case."""

    name, title, parameters, row, list_key = "fall", "stones that fall", Stone, Fall, "heights"


def test_a_row_is_read_back_as_it_was() -> None:
    rows = [Fall(2.0, 0.0, 0.639, 3, OK), Fall(-0.1, nan, 1e300, 0, "broken, or not")]
    for one in rows:
        again = Fall.parse([str(cell) for cell in one.cells()])
        assert repr(again) == repr(one)
        assert type(again.bounces) is int
    with pytest.raises(ValueError, match="could not convert"):
        Fall.parse(["high", "0", "0", "0", OK])
    with pytest.raises(ValueError, match="shorter"):
        Fall.parse(["1", "2"])


def test_key_names_and_order() -> None:
    rows = [Fall(height, 0.0, 0.6, 3, OK) for height in (-3.0, 1.5, 2.0)]
    assert [one.key for one in sorted(rows, key=lambda r: r.order)] == [2.0, 1.5, -3.0]
    assert rows[1].file_names() == ("path_1.5.csv",)
    assert Fall.file_patterns() == ("path_*.csv",)
    assert (Fall.label(1.5), FilmRow.label(400.0)) == ("H = 1.5 m", "U = +400 mm/s")


def test_only_declared_fields_are_columns() -> None:
    """A state is a row with more; its columns are those of the row."""
    row = film_row(400.0, 1.3)
    assert FilmRow.part_of(row) == row
    assert len(FilmRow.header()) == len(row.as_dict())


def test_pieces_share_what_is_missing() -> None:
    stone, case = Stone(heights=(4.0, 3.0, 2.0, 1.0)), Falls()
    there = [Fall(3.0, 0.0, 0.0, 0, OK)]
    assert [p.heights for p in case.pieces(stone, there, 1)] == [(4.0, 2.0, 1.0)]
    assert [p.heights for p in case.pieces(stone, there, 2)] == [(4.0, 1.0), (2.0,)]
    everything = [Fall(h, 0.0, 0.0, 0, OK) for h in stone.heights]
    assert case.pieces(stone, everything, 2) == []


def test_bounds_come_from_limits_and_types() -> None:
    bounds = {one.name: one.bounds for one in keys_of(Stone)}
    assert bounds == {
        "heights": "a number or a list of different ones, none 0",
        "hard": "true or false",
        "kind": '"round", "flat" or "sharp"',
        "mass": "> 0 and <= 5",
        "name": "left out = none",
    }
    assert Stone.model_fields["mass"].description == "mass [kg]; > 0 and <= 5"
