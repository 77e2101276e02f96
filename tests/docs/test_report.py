"""The page of reports: its commands, and that its pictures are of sections a browser found."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.docs.pages import Reader, blocks

DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.slow
def test_the_page_does_what_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("bokeh", reason="the extra `report` is not installed")
    monkeypatch.chdir(tmp_path)
    reader = Reader(DOCS / "models")
    for block in blocks((DOCS / "report.md").read_text(encoding="utf-8")):
        reader.read(block)
    for name in ("results/soft/report.html", "results/hard/report.html", "both.html"):
        assert (tmp_path / name).stat().st_size < 5e6
    assert (tmp_path / "both.xlsx").is_file()
