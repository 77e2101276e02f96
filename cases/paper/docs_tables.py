"""Tables and pictures of the documentation from the files that `softehl reproduce` wrote.

`python -m softehl.cases.paper.docs_tables DIR [PAGE ...]` replaces the lines between
`<!-- table NAME -->` (or `<!-- table NAME: column, column -->`, `<!-- caption NAME -->`) and
`<!-- end -->` and copies the pictures that a page shows. The other lines are written by hand.
"""

import csv
import re
import shutil
import sys
from pathlib import Path

from softehl.runtime.io import write_text

_BLOCK = re.compile(r"(<!-- (table|caption) ([\w]+)(?:: ([^>]*?))? -->\n)(.*?)(<!-- end -->)", re.S)
_PICTURE = re.compile(r"\]\((reproduction/[\w]+\.png)\)")


def renewed(text: str, folder: Path) -> str:
    """The page with its blocks from the files in `folder`.  Raises OSError, ValueError."""

    def block(match: re.Match[str]) -> str:
        begin, kind, name, columns, _, end = match.groups()
        if kind == "caption":
            body = (folder / f"{name}.txt").read_text(encoding="utf-8").strip()
        else:
            selection = [c.strip() for c in columns.split(",")] if columns else []
            body = markdown(folder / f"{name}.csv", selection)
        return f"{begin}\n{body}\n\n{end}"

    return _BLOCK.sub(block, text)


def markdown(path: Path, columns: list[str]) -> str:
    """A CSV file as a table, numbers to four digits; some of its columns or all."""
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = list(csv.reader(file))
    for name in columns:
        if name not in header:
            raise ValueError(f"{path}: no column {name!r}; allowed: {', '.join(header)}")
    indices = [header.index(name) for name in columns or header]
    lines = [
        "| " + " | ".join(header[i] for i in indices) + " |",
        "|" + "---|" * len(indices),
        *("| " + " | ".join(_cell(header[i], row[i]) for i in indices) + " |" for row in rows),
    ]
    return "\n".join(lines)


def _cell(name: str, text: str) -> str:
    if name in _LETTERS:
        return f"`{text}`"
    try:
        value = float(text)
    except ValueError:
        return text.replace("|", "\\|")
    if value != value:
        return "-"
    return text if value.is_integer() and "." not in text and "e" not in text else f"{value:.4g}"


PAGES = ("docs/reproduction.md", "docs/validation/paper.md")

_LETTERS = ("verdicts", "outstroke", "instroke")
"""Columns of verdict letters, which are no words."""


def main(arguments: list[str]) -> None:
    """Renew the pages and copy their pictures."""
    folder = Path(arguments[0])
    for page in map(Path, arguments[1:] or PAGES):
        text = renewed(page.read_text(encoding="utf-8"), folder)
        write_text(page, text)
        for picture in _PICTURE.findall(text):
            target = page.parent / picture
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(folder / target.name, target)


if __name__ == "__main__":
    main(sys.argv[1:])
