"""Tables of the documentation that follow from declarations."""

import re
from dataclasses import fields
from pathlib import Path

import pytest

from softehl.cases.document import DOCS, TABLES, renewed
from softehl.cases.harness.case import load_case
from softehl.cases.harness.parameters import keys_of
from softehl.cases.harness.table import print_keys
from softehl.cases.seal.cycle.restart import STEP
from softehl.cases.seal.cycle.transient import Reading
from softehl.cases.shipped import SHIPPED
from softehl.cases.slider.case import CASE as SLIDER
from softehl.cases.slider.case import Slider


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


def test_columns_of_the_other_tables_are_documented() -> None:
    for name, kind in TABLES.items():
        assert all(f"| `{column}` |" in table_of("columns", name) for column in kind.header())
    cycle, slider = ((DOCS / f"{name}.md").read_text() for name in ("cycle", "slider"))
    wanted = [*(field.name for field in fields(Reading)), STEP, "instant_0", "state_N.csv"]
    assert [name for name in wanted if f"`{name}`" not in cycle] == []
    p = Slider(profile="pocket", segments=6)
    profile = SLIDER.state(p, 100.0, *SLIDER.solution(p, 100.0)).contents[0]
    assert isinstance(profile, dict)
    assert [name for name in profile if f"`{name}`" not in slider] == []


@pytest.mark.parametrize("name", SHIPPED)
def test_every_key_has_a_meaning_and_bounds(name: str) -> None:
    case = load_case(SHIPPED[name])
    assert case.parameters()  # every key has a default
    for key in keys_of(case.parameters):
        assert key.meaning
        assert key.bounds
        assert not re.search(r"\(\d+\)", f"{key.meaning} {key.bounds}"), "the number of an equation"


def test_keys_are_listed_from_the_ring_to_the_numerics(capsys: pytest.CaptureFixture[str]) -> None:
    seal = ["ring", "gland", "rubber", "oil", "motion", "film", "mesh", "numerics"]
    for name in SHIPPED:
        case = load_case(SHIPPED[name])
        keys = list(keys_of(case.parameters))
        headings = list(dict.fromkeys(key.heading for key in keys))
        assert headings == (seal if name != "slider" else ["gap", *seal[3:]])
        assert sorted(key.name for key in keys) == sorted(case.parameters.model_fields)
    print_keys(load_case(SHIPPED["oring"]).parameters)
    printed = capsys.readouterr().out
    places = [printed.index(f"{heading.upper()} ") for heading in seal]
    assert places == sorted(places)
    assert printed.index(" ring ") < printed.index(" shear_thinning ")


def test_an_old_table_is_noticed() -> None:
    stale = "# O-ring\n\n<!-- columns oring -->\n| column |\n<!-- end -->\n"
    assert "| `h_star_um` | um |" in renewed(stale)
    assert renewed(renewed(stale)) == renewed(stale)
