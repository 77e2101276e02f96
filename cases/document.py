"""Tables of docs/ that follow from declarations: `python -m softehl.cases.document` renews them.

A table stands between the lines `<!-- columns CASE -->` or `<!-- keys CASE -->` and `<!-- end -->`.
"""

import re
from pathlib import Path

from softehl.cases.harness.case import load_case
from softehl.cases.harness.table import column_lines, key_lines
from softehl.cases.shipped import SHIPPED
from softehl.runtime.io import write_text

DOCS = Path(__file__).resolve().parents[1] / "docs"
_TABLE = re.compile(r"<!-- (columns|keys) (\w+) -->\n.*?<!-- end -->", re.DOTALL)


def renewed(text: str) -> str:
    """A page with its tables as they should be."""
    return _TABLE.sub(_table, text)


def _table(found: re.Match[str]) -> str:
    what, name = found.groups()
    case = load_case(SHIPPED[name])
    lines = key_lines(case.parameters) if what == "keys" else column_lines(case.row)
    return "\n".join([f"<!-- {what} {name} -->", *lines, "<!-- end -->"])


def main() -> None:
    """Rewrite the pages whose tables are not current."""
    for path in sorted(DOCS.glob("*.md")):
        text = path.read_text(encoding="utf-8")
        if renewed(text) != text:
            write_text(path, renewed(text))
            print(f"renewed {path}")


if __name__ == "__main__":
    main()
