"""Your first seal: every command of the page runs, and prints and writes the numbers it shows."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.docs.pages import Reader, blocks

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "first-seal.md").read_text(encoding="utf-8")
CHAPTERS = dict(re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", PAGE, re.MULTILINE | re.DOTALL))
AGREE = 0.01

_TABLE = re.compile(r"<!-- numbers (.+?) -->\n.*?\n\|[-|]+\n(.*?)<!-- end -->", re.DOTALL)
_LINE = re.compile(r"^ +([-+]\d+) +(\S+) .*ok$", re.MULTILINE)
_COLUMNS = ("h_star_um", "rod_friction_N")


def curve(folder: str) -> dict[float, dict[str, str]]:
    """The states of a run by rod speed."""
    with (Path(folder) / "curve.csv").open(encoding="utf-8") as file:
        return {float(row["rod_speed_mm_s"]): row for row in csv.DictReader(file)}


def shown(text: str) -> Iterator[tuple[str, float, str, float, str]]:
    """Every number of the tables of a chapter: folder, speed, column, value, verdict.

    The friction of a state that is `uncertain`, or nearly so, is in italics.
    """
    for folders, lines in _TABLE.findall(text):
        for line in lines.splitlines():
            speed, *cells = (cell.strip() for cell in line.strip("|").split("|"))
            for i, folder in enumerate(folders.split()):
                pair = cells[2 * i : 2 * i + 2]
                verdict = "uncertain" if pair[1].startswith("*") else "ok"
                for column, cell in zip(_COLUMNS, pair, strict=True):
                    yield folder, float(speed), column, float(cell.strip("*")), verdict
    for speed, h_star in _LINE.findall(text):
        yield "results/oring", float(speed), "h_star_um", float(h_star), "ok"


def assert_shown(text: str) -> None:
    """`AssertionError` where a run has another number, or a verdict that the page does not say."""
    for folder, speed, column, value, verdict in shown(text):
        row = curve(folder)[speed]
        close = 0.04 if verdict != "ok" and column == "rod_friction_N" else AGREE
        assert float(row[column]) == pytest.approx(value, rel=close), f"{folder}, {speed}: {column}"
        assert row["verdict"] in ("ok", verdict), f"{folder}, {speed}"


@pytest.mark.slow
@pytest.mark.parametrize("chapter", CHAPTERS)
def test_a_chapter_does_what_it_says(
    chapter: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("bokeh", reason="the extra `report` is not installed")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    reader = Reader(DOCS / "models")
    for block in blocks(CHAPTERS[chapter]):
        reader.read(block)
    assert_shown(CHAPTERS[chapter])


def test_every_block_and_table_is_in_a_chapter() -> None:
    inside = [b for text in CHAPTERS.values() for b in blocks(text)]
    assert len(inside) == len(blocks(PAGE))
    assert PAGE.count("\n```") == 2 * len(inside)
    assert {b.kind for b in inside} == {"console", "toml"}
    counts = {name: len(list(shown(text))) for name, text in CHAPTERS.items()}
    expected = {"Run it": 10, "A cylinder rod at 10 MPa": 24, "Other sections": 16}
    assert {name: n for name, n in counts.items() if n} == expected


def test_a_number_that_is_wrong_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "results/a").mkdir(parents=True)
    head = "rod_speed_mm_s,h_star_um,rod_friction_N,verdict\n"
    table = "<!-- numbers results/a -->\n| U | h | F |\n|---|---|---|\n| 50 | 2 | 3 |\n<!-- end -->"
    (tmp_path / "results/a/curve.csv").write_text(head + "50,2.001,3.001,ok\n")
    assert_shown(table)
    for wrong in ("50,2.1,3,ok\n", "50,2,3.1,ok\n", "50,2,3,uncertain\n"):
        (tmp_path / "results/a/curve.csv").write_text(head + wrong)
        with pytest.raises(AssertionError):
            assert_shown(table)
