"""The page for users of other programs runs, prints what it shows, and counts its lines."""

import re
from pathlib import Path

import pytest

from tests.docs.pages import Reader, blocks

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "compare.md").read_text(encoding="utf-8")


def test_what_is_shown_is_printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    reader = Reader(DOCS / "models" / "compare")
    for block in blocks(PAGE):
        reader.read(block)


def test_seven_problems_take_at_most_half_of_the_lines_by_hand() -> None:
    section = PAGE.partition("## Seven problems in full")[2].partition("\n## ")[0]
    code = [block.text.splitlines() for block in blocks(section) if block.kind == "python"]
    counted = [sum(bool(line.partition("#")[0].strip()) for line in lines) for lines in code]
    rows = re.findall(r"^\| (.+) \| (\d+) \| (\d+) \|$", section, re.MULTILINE)
    titles = re.findall(r"^\*\*(.+?)\.?:?\*\*", section, re.MULTILINE)
    assert [name for name, _, _ in rows] == titles
    assert [int(here) for _, _, here in rows] == counted
    assert len(rows) == 7
    assert all(2 * int(here) <= int(by_hand) for _, by_hand, here in rows)
