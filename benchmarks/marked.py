"""Tables between marks of a page of the documentation."""

from __future__ import annotations

from pathlib import Path


def renew(page: Path, mark: str, table: str) -> None:
    """Write a table between the lines `<!-- mark -->` and `<!-- end -->` of a page."""
    begin, end = f"<!-- {mark} -->\n", "<!-- end -->"
    before, found, rest = page.read_text(encoding="utf-8").partition(begin)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise SystemExit(f"{page} has no lines {begin.strip()} and {end}: write them first")
    page.write_text(f"{before}{begin}{table}\n{end}{after}", encoding="utf-8")
