"""The gallery does what it says: blocks are run in order, lines counted, tables computed."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.docs.pages import Reader, blocks

GALLERY = Path(__file__).parents[2] / "docs" / "gallery"
ENTRIES = sorted(page.stem for page in GALLERY.glob("*.md") if page.stem != "index")


def written(entry: str) -> str:
    return (GALLERY / f"{entry}.md").read_text(encoding="utf-8")


def read(entry: str, monkeypatch: pytest.MonkeyPatch, folder: Path) -> Reader:
    """The reader of an entry, after its last block."""
    monkeypatch.chdir(folder)
    reader = Reader(GALLERY / "models")
    for block in blocks(written(entry)):
        reader.read(block)
    return reader


LONG = (
    *("contact", "cook", "enhanced", "fbar", "fit", "fracture", "jumps", "stick-slip", "swing"),
    *("cahn-hilliard", "column", "finite-plasticity", "maxwell"),
)
"""Entries that take a second and more."""


@pytest.mark.parametrize(
    "entry", [pytest.param(e, marks=[pytest.mark.slow] * (e in LONG)) for e in ENTRIES]
)
def test_an_entry_runs_and_prints_what_it_shows(
    entry: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read(entry, monkeypatch, tmp_path)


def counted(entry: str) -> tuple[int, int]:
    """Lines that are not blank of the page and of the driver."""
    code = [b for b in blocks(written(entry)) if b.kind == "python"]
    page = next(b for b in code if b.name)
    driver = next(b for b in code if not b.name)
    return tuple(sum(bool(x.strip()) for x in b.text.splitlines()) for b in (page, driver))  # type: ignore[return-value]


def test_the_table_counts_lines() -> None:
    rows = re.findall(
        r"\]\(([\w-]+)\.md\) \|.*\| (\d+) \| (\d+) \|$", written("index"), re.MULTILINE
    )
    assert {entry for entry, _, _ in rows} == set(ENTRIES)
    for entry, page, driver in rows:
        assert counted(entry) == (int(page), int(driver)), entry


def test_every_entry_has_its_parts() -> None:
    tree = re.findall(r"^([\w-]+)$", written("index").partition("{toctree}")[2], re.MULTILINE)
    assert sorted(tree) == ENTRIES
    shown = {b.name for entry in ENTRIES for b in blocks(written(entry)) if b.name}
    assert shown == {page.name for page in (GALLERY / "models").glob("*.py")}
    for entry in ENTRIES:
        assert f"](pictures/{entry}.png)" in written(entry)
        assert (GALLERY / "pictures" / f"{entry}.png").stat().st_size < 80_000
        for heading in ("Comparison with published results", "Differences and limits"):
            assert f"\n## {heading}\n" in written(entry), entry


# free out of its plane, as deal.II's panel is, where it would buckle
@pytest.mark.filterwarnings("ignore::softehl.runtime.equations.stability.UnstableState")
@pytest.mark.slow
def test_cook_with_quadratic_elements(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from softehl import Mesh, Study

    space = read("cook", monkeypatch, tmp_path).namespace
    page: dict[str, object] = {}
    exec((GALLERY / "models" / "cook.py").read_text(), page)
    for kind in ("hex20", "hex27"):
        given = {"shape": "serendipity"} if kind == "hex20" else {}
        found = []
        for n in (1, 2, 4, 8):
            mesh = Mesh.box((48, 44, 1), cells=(n, n, 1), order=2, **given)  # type: ignore[arg-type]
            study = Study(mesh.map(space["tapered"]))
            study.add("rubber", page["rubber"](kind), mu=space["mu"], kappa=space["kappa"])  # type: ignore[operator]
            study.fix("left", u_x=0, u_y=0, u_z=0)
            study.load("right", u_y=1 / 16)
            found.append(study.solve(steps=10).at((48, 60, 0))["u_y"])
        table = re.search(rf"^\| 3-D, `{kind}` \|(.*)$", written("cook"), re.MULTILINE)
        assert table is not None
        shown = [float(value) for value in table[1].split("|") if value.strip()]
        np.testing.assert_allclose(found, shown, atol=6e-4)
