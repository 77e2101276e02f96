"""Tables of docs/ that follow from declarations: `python -m softehl.cases.document` renews them.

A table begins with one of these lines and ends with `<!-- end -->`.

`<!-- columns CASE -->`: the columns of a row; of `leakage` and `tolerances`: of these tables.
`<!-- keys CASE -->`: the keys of a case.
`<!-- keys CASE beyond OTHER -->`: its keys that the other case does not have.
`<!-- section NAME -->`: the dimensions of a section of a seal.
"""

import re
from collections.abc import Mapping
from pathlib import Path

from softehl.cases.harness.case import load_case
from softehl.cases.harness.parameters import declared, keys_of
from softehl.cases.harness.row import Record
from softehl.cases.harness.table import column_lines, key_lines
from softehl.cases.seal.gland.sections.section_keys import dimensions
from softehl.cases.seal.gland.sections.shapes import SECTIONS
from softehl.cases.seal.gland.tolerances import ToleranceRow
from softehl.cases.seal.states.leakage import LeakageRow
from softehl.cases.shipped import SHIPPED
from softehl.runtime.io import write_text

DOCS = Path(__file__).resolve().parents[1] / "docs"
TABLES: Mapping[str, type[Record]] = {"leakage": LeakageRow, "tolerances": ToleranceRow}
_TABLE = re.compile(
    r"<!-- (columns|keys|section) (\w+)( beyond (\w+))? -->\n.*?<!-- end -->", re.DOTALL
)


def renewed(text: str) -> str:
    """A page with its tables as they should be."""
    return _TABLE.sub(_table, text)


def _table(match: re.Match[str]) -> str:
    what, name, beyond, other = match.groups()
    if what == "section":
        lines = section_lines(name)
    elif what == "keys":
        excluded = tuple(keys_of(load_case(SHIPPED[other]).parameters)) if other else ()
        lines = key_lines(load_case(SHIPPED[name]).parameters, excluded)
    else:
        lines = column_lines(TABLES.get(name) or load_case(SHIPPED[name]).row)
    return "\n".join([f"<!-- {what} {name}{beyond or ''} -->", *lines, "<!-- end -->"])


def section_lines(name: str) -> list[str]:
    """The dimensions of a section as a table."""
    rows = ["| key | left out | bounds [mm] | what it is |", "|---|---|---|---|"]
    fields = SECTIONS[name].model_fields
    for key, field_name in dimensions(name).items():
        extra = declared(fields[field_name])
        bounds = extra["bounds"].partition(";")[0]
        share = f"{extra['part']:g} section_diameter"
        rows.append(f"| `{key}` | {share} | {bounds} | {extra['meaning']} |")
    return rows


def main() -> None:
    """Rewrite the pages whose tables are not current."""
    for path in sorted(DOCS.glob("*.md")):
        text = path.read_text(encoding="utf-8")
        if renewed(text) != text:
            write_text(path, renewed(text))
            print(f"renewed {path}")


if __name__ == "__main__":
    main()
