"""The page for users of other programs runs and prints what they find as well."""

from pathlib import Path

import pytest

from tests.docs.pages import Reader, blocks

DOCS = Path(__file__).parents[2] / "docs"


def test_the_same_problem_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    reader = Reader(DOCS / "models" / "compare")
    for block in blocks((DOCS / "compare.md").read_text(encoding="utf-8")):
        reader.read(block)
    assert reader.printed == "11.53022\n"
