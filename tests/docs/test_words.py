"""The pages describe the program as it is, agree with it and with each other, in plain words."""

from __future__ import annotations

import ast
import re
import shlex
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import click
import pytest

from softehl.__main__ import _commands as program
from softehl.cases.harness.case import load_case
from softehl.cases.harness.parameters import keys_of
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.rubbers.hardness import youngs_modulus
from softehl.cases.seal.states import verdict
from softehl.cases.shipped import SHIPPED
from tests.docs.test_site import PAGES, ROOT, is_named

TIMELESS = [page for page in PAGES if page.name != "CHANGELOG.md"]
"""Pages that say what is; the change log says what was."""

HISTORY = (
    r"\b20\d\d-\d\d-\d\d\b",
    r"\b\d{1,2} (January|February|March|April|May|June|July|August|September|October|November"
    r"|December) \d{4}\b",
    r"\bused to be\b",
    r"\bare `?ok`? since\b",
    r"\bBefore, ",
    r"\b(before|had) and now\b",
    r"\bthan before\b",
    r"\|[^|\n]*\b(before|now|after)\b[^|\n]*\|[^|\n]*\b(before|now|after)\b[^|\n]*\|",  # of a table
    r"\b(gland|number|X-ring|U-cup|trapezoid) \d+ \((\d|p_s)",
)
"""Signs of a diary."""

SAMPLES = r"\b([Gg]lands?|X-rings?|U-cups?|[Tt]rapezoids?) (#|no\. |number )?\d+\b(?!\.\d)"
"""Numbers of glands and seals in a sample, which only pages of measurements may name."""


CLAUSES = re.compile(r"(What|Where|Whether|How|That of|The same|Those)\b")
"""Beginnings of docstrings that say what a thing is by a clause instead of by its name."""

SOURCES = ("benchmarks", "cases", "codegen", "docs", "runtime", "src")

OPENINGS = 4
"""Docstrings that still begin with such a clause; the number only falls."""

PRIVATE = (
    "plain result",
    "without a word",
    "that are none",
    "stands behind",
    "what was not said",
    "## Rooms",
    "Nobody differentiates",
    "drawer",
    "page of mathematics",
    "takes no part",
    "is believed",
)
"""Words of our own, and sentences that have to be guessed."""


def test_pages_have_no_history() -> None:
    for page in TIMELESS:
        text = page.read_text(encoding="utf-8")
        found = [match[0] for pattern in HISTORY for match in re.finditer(pattern, text)]
        assert found == [], is_named(page)


def test_numbers_of_glands_are_in_validation_alone() -> None:
    pages = [page for page in TIMELESS if page.parent.name != "validation"]
    for path in [*pages, *sources()]:
        text = path.read_text(encoding="utf-8")
        assert [match[0] for match in re.finditer(SAMPLES, text)] == [], is_named(path)
    assert re.search(SAMPLES, "as of gland 71 or of X-ring no. 3")
    assert not re.search(SAMPLES, "300 glands, a gland 3.2 mm high")


def sources() -> Iterator[Path]:
    """Files of Python below the folders of the project, each once, without what is generated."""
    for folder in SOURCES:
        for path in sorted((ROOT / folder).rglob("*.py")):
            if not any(parent.is_symlink() for parent in path.parents):
                yield path


def openings(path: Path) -> Iterator[str]:
    """First lines of the docstrings of a file that begin with a clause."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            text = ast.get_docstring(node) or ""
            if CLAUSES.match(text):
                yield f"{is_named(path)}: {text.splitlines()[0]}"


def test_docstrings_begin_with_what_they_describe() -> None:
    found = [line for path in sources() for line in openings(path)]
    assert len(found) <= OPENINGS, "\n".join(found)


def test_pages_have_standard_words() -> None:
    for page in TIMELESS:
        text = " ".join(page.read_text(encoding="utf-8").splitlines())
        assert [words for words in PRIVATE if words in text] == [], is_named(page)


def commands() -> Iterator[tuple[str, list[str]]]:
    """Page and words of every command line of a page."""
    for page in TIMELESS:
        text = page.read_text(encoding="utf-8").replace("\\\n", " ")
        for line in re.findall(
            r"^(?: {4}|\$ |.*?mpiexec -n \d+ )(softehl .*)$", text, re.MULTILINE
        ):
            yield is_named(page), shlex.split(line, comments=True)


def test_commands_have_options_and_keys_that_there_are() -> None:
    group = program()
    assert isinstance(group, click.Group)
    keys = {
        name: {k.name for k in keys_of(load_case(SHIPPED[name]).parameters)} for name in SHIPPED
    }
    seen = 0
    for page, (_, name, *rest) in commands():
        assert name in group.commands, f"{page}: softehl {name}"
        known = {o for option in group.commands[name].params for o in option.opts}
        for word in rest:
            option = word.split("=")[0].strip("[]")
            assert not option.startswith("--") or option in known, f"{page}: {name} {option}"
        case = rest[0] if rest else ""
        for flag, value in pairwise(rest):
            if flag == "--set" and case in keys:
                key = re.split(r"[=.]", value)[0]
                assert key in keys[case], f"{page}: --set {key}"
                seen += 1
    assert seen > 50


def row(page: str, start: str) -> str:
    """The line of a page that begins so."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    (line,) = [line for line in text.splitlines() if line.startswith(start)]
    return line


def test_limits_of_verdicts_are_those_of_the_code() -> None:
    low, high = 1.0 - 0.01 * verdict.LARGEST_ERROR, 1.0 + 0.01 * verdict.LARGEST_ERROR
    fewest, lobes = (f"{verdict.fewest_inlet_segments('fe', 4, n):g}" for n in (1, 2))
    for start, said in (
        ("| `clipped` |", f"below {verdict.EXIT_FILMS:g} h\\* and below {verdict.END_GAP:g} mm"),
        ("| `under-resolved` too | graded", f"`inlet_ratio` outside {low:g} to {high:g}"),
        ("| `under-resolved` | inlet", f"< {fewest} (two lobes: {lobes}"),
        (
            "| `under-resolved` too | the second",
            f"outside {1 - verdict.NEXT_RATIO:g} to {1 + verdict.NEXT_RATIO:g}",
        ),
        ("| `uncertain` |", f"above {verdict.LARGEST_ERROR:g} %"),
        ("| `oscillating` |", f"index > {verdict.STRONG_OSCILLATION:g}"),
        ("| `collapsed` |", f"U^{verdict.LARGEST_EXPONENT:g}"),
    ):
        assert said in row("film-resolution.md", start), said
    assert f"is above {verdict.LARGEST_ERROR:g} %" in row("limits.md", "| the estimated error")


def test_a_hardness_has_one_modulus_on_all_pages() -> None:
    """Gent's; the default rubber is named by its modulus."""
    default = Seal().rubber("").shear_modulus
    found = 0
    for page in TIMELESS:
        text = " ".join(page.read_text(encoding="utf-8").split())
        assert not re.search(rf"NBR 70[^.|]*\b{default:g}", text), is_named(page)
        named = re.findall(r"(\d\d) Shore A(?: has)?(?: a shear modulus of)? (\d+\.\d+)", text)
        for shore, modulus in named:
            mine = youngs_modulus(float(shore)) / 3.0
            assert float(modulus) == pytest.approx(mine, rel=5e-3), is_named(page)
            found += 1
    assert found >= 4
