"""The tutorial does what it says: every block is run in order, every number it shows comes out."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.docs.pages import Block, Reader, blocks

DOCS = Path(__file__).parents[2] / "docs"
PAGES = (
    *("tutorial.md", "study.md", "fields.md", "contact.md", "modes.md", "dynamics.md"),
    *("matrix-free.md", "facets.md", "umat.md", "how-to.md", "learned-law.md"),
)
TUTORIAL = "\n".join((DOCS / page).read_text(encoding="utf-8") for page in PAGES)
CHAPTERS = dict(re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", TUTORIAL, re.MULTILINE | re.DOTALL))

LONG = (
    *("A rubber on any cell", "Cook's membrane", "Two bodies", "A page with products"),
    *("Ogden: principal stretches in three dimensions", "A viscoplastic steel"),
    *("Gent: a rubber that locks", "A beam that swings", "Interior penalty"),
    *("Heat: weak forms and rates", "Unknowns of one element"),
    *("Press a rigid sphere into a body?", "A convex network of two invariants"),
)
"""Chapters that take 1.5 s and more."""


@pytest.fixture
def reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Reader]:
    """In an empty folder, with an empty cache, a window of 100 columns and a log as at first."""
    monkeypatch.setenv("SOFTEHL_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("COLUMNS", "100")
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    log = logging.getLogger("softehl")
    level, handlers = log.level, list(log.handlers)
    yield Reader(DOCS / "models")
    log.setLevel(level)
    for handler in set(log.handlers) - set(handlers):
        log.removeHandler(handler)
        handler.close()


@pytest.mark.parametrize(
    "chapter", [pytest.param(c, marks=[pytest.mark.slow] * (c in LONG)) for c in CHAPTERS]
)
def test_a_chapter_runs_in_order_and_prints_what_it_shows(chapter: str, reader: Reader) -> None:
    for block in blocks(CHAPTERS[chapter]):
        reader.read(block)


def test_the_chapters_hold_the_whole_page_and_every_model() -> None:
    inside = [b for text in CHAPTERS.values() for b in blocks(text)]
    assert set(LONG) < set(CHAPTERS)
    assert len(inside) == len(blocks(TUTORIAL))
    assert TUTORIAL.count("\n```") == 2 * len(inside)
    shown = {b.name for b in inside if b.kind == "python" and b.name}
    assert shown == {p.name for p in (DOCS / "models").glob("*.py")}


@pytest.mark.parametrize(
    "wrong",
    [
        [Block("python", "gent.py", "x = 1\n", 1)],
        [Block("python", "", "print(1 + 1)\n", 1), Block("text", "", "3\n", 2)],
        [Block("console", "", "$ softehl kernels --no\n", 1)],
        [Block("console", "", "$ softehl generate --trace contact\nsomething else\n", 1)],
        [Block("console", "", "$ rm it\n", 1)],
        [Block("yaml", "", "", 1)],
    ],
)
def test_a_page_that_is_wrong_is_noticed(wrong: list[Block], reader: Reader) -> None:
    *before, last = wrong
    for block in before:
        reader.read(block)
    with pytest.raises(AssertionError, match="line "):
        reader.read(last)
