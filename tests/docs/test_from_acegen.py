"""The page for users of AceGen: its code runs, each command has a counterpart, names exist."""

import re
from pathlib import Path

import pytest

import softehl
from softehl.codegen.language.boundary_model import BoundaryModel, FacetModel
from softehl.codegen.language.cell_model import CellModel
from tests.docs.pages import Reader, blocks

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "from-acegen.md").read_text(encoding="utf-8")
OWNERS = {
    "m": (CellModel, BoundaryModel, FacetModel, softehl.Material),
    "softehl": (softehl,),
    "study": (softehl.Study,),
    "result": (softehl.Result,),
    "mesh": (softehl.Mesh,),
    "kernel": (softehl.Kernel,),
    "kinematics": (softehl.kinematics,),
    "quadrature": (softehl.quadrature,),
}
"""Objects by the names of the page."""
_NAME = re.compile(rf"`(?:[^`]*[ (])?({'|'.join(OWNERS)})\.(\w+)")


def rows(page: str) -> list[list[str]]:
    """Cells of each row of the tables, without their heads."""
    lines = [line for line in page.splitlines() if line.startswith("| ")]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [row for row in cells if row[1] != "here"]


def missing(page: str) -> list[str]:
    """Names of the page that the program does not have."""
    named = {match.groups() for match in _NAME.finditer(page)}
    return [
        f"{owner}.{name}"
        for owner, name in sorted(named)
        if not any(hasattr(place, name) for place in OWNERS[owner])
    ]


def test_what_is_shown_is_printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    reader = Reader(DOCS / "models")
    for block in blocks(PAGE):
        reader.read(block)


def test_every_command_has_a_counterpart_or_a_reason() -> None:
    found = rows(PAGE)
    assert len(found) > 100
    for command, here, remark in found:
        assert here, command
        assert here != "none" or remark, command
    commands = [row[0] for row in found]
    assert sorted(set(commands)) == sorted(commands)


def test_every_name_exists() -> None:
    assert missing(PAGE) == []
    assert missing("`m.nonsense`, `m.define`") == ["m.nonsense"]
