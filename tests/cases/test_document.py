"""Tables of the documentation that follow from declarations."""

import re
from pathlib import Path

import pytest

from softehl.cases.document import DOCS, renewed
from softehl.cases.harness.case import load_case
from softehl.cases.harness.parameters import keys_of
from softehl.cases.shipped import SHIPPED


def test_tables_are_current() -> None:
    pages: list[Path] = sorted(DOCS.glob("*.md"))
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert renewed(text) == text, f"{page}: run `python -m softehl.cases.document`"


def table_of(what: str, name: str) -> str:
    """The table of a case on the one page that has it."""
    (table,) = [
        found
        for page in DOCS.glob("*.md")
        for found in re.findall(
            rf"<!-- {what} {name}(?: beyond \w+)? -->(.*?)<!-- end -->", page.read_text(), re.DOTALL
        )
    ]
    return str(table)


@pytest.mark.parametrize("name", SHIPPED)
def test_columns_and_keys_of_every_case_are_documented(name: str) -> None:
    case = load_case(SHIPPED[name])
    columns, keys = table_of("columns", name), table_of("keys", name)
    known = [*keys_of(load_case(SHIPPED["oring"]).parameters)] if name == "cycle" else []
    for column in case.row.columns():
        assert columns.count(f"| `{column.name}` |") == 1
        assert column.meaning
    for key in keys_of(case.parameters):
        assert keys.count(f"| `{key.name}` |") == (key not in known)


@pytest.mark.parametrize("name", SHIPPED)
def test_every_key_has_a_meaning_and_bounds(name: str) -> None:
    case = load_case(SHIPPED[name])
    assert case.parameters()  # every key has a default
    for key in keys_of(case.parameters):
        assert key.meaning
        assert key.bounds
        assert not re.search(r"\(\d+\)", f"{key.meaning} {key.bounds}"), "the number of an equation"


def test_an_old_table_is_noticed() -> None:
    stale = "# O-ring\n\n<!-- columns oring -->\n| column |\n<!-- end -->\n"
    assert "| `h_star_um` | um |" in renewed(stale)
    assert renewed(renewed(stale)) == renewed(stale)
