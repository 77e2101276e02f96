"""The page of derivatives and fits does what it says, in order."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.docs.pages import Reader, blocks

DOCS = Path(__file__).parents[2] / "docs"


def test_the_page_runs_and_prints_what_it_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    reader = Reader(DOCS / "models" / "derivatives")
    for block in blocks((DOCS / "derivatives.md").read_text(encoding="utf-8")):
        reader.read(block)
