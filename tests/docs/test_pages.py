"""Pages with blocks that run do what they say, in order; their tables count and compute."""

from __future__ import annotations

import csv
import json
import logging
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.docs.pages import Block, Reader, blocks

DOCS = Path(__file__).parents[2] / "docs"
GALLERY = DOCS / "gallery"
AGREE = 0.01


def text_of(page: str) -> str:
    return (DOCS / f"{page}.md").read_text(encoding="utf-8")


def chapters(*pages: str) -> dict[str, str]:
    """Title -> text of the chapters of some pages."""
    text = "\n".join(map(text_of, pages))
    return dict(re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL))


TUTORIAL = (
    *("tutorial", "study", "fields", "contact", "modes", "dynamics"),
    *("matrix-free", "facets", "umat", "how-to", "learned-law"),
)
ENTRIES = sorted(page.stem for page in GALLERY.glob("*.md") if page.stem != "index")
PARTS = {
    **{f"first-seal: {title}": ("", text) for title, text in chapters("first-seal").items()},
    **{title: ("", text) for title, text in chapters(*TUTORIAL).items()},
    **{f"gallery/{entry}": ("gallery/", text_of(f"gallery/{entry}")) for entry in ENTRIES},
    "compare": ("models/compare", text_of("compare")),
    "derivatives": ("models/derivatives", text_of("derivatives")),
    "library": ("", text_of("library")),
    "report": ("", text_of("report")),
}
"""Name -> folder of the models that it shows ("" for docs/models), and the text that runs."""
LONG = {
    *(
        "A rubber on any cell",
        "Cook's membrane",
        "Two bodies",
        "Two scales",
        "A page with products",
        "report",
    ),
    *("Ogden: principal stretches in three dimensions", "A viscoplastic steel"),
    *("Gent: a rubber that locks", "A beam that swings", "Interior penalty"),
    *("Heat: weak forms and rates", "Unknowns of one element", "A law of your own"),
    *("Press a rigid sphere into a body?", "A convex network of two invariants"),
    *(name for name in PARTS if "first-seal" in name),
    *(f"gallery/{entry}" for entry in ("contact", "cook", "enhanced", "fbar", "fit", "fracture")),
    *(f"gallery/{entry}" for entry in ("jumps", "stick-slip", "swing", "cahn-hilliard", "column")),
    *(
        "gallery/finite-plasticity",
        "gallery/maxwell",
        "gallery/two-scales",
        "gallery/adhesion",
        "gallery/impact",
    ),
}
"""Those that take 1.5 s and more."""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty folder, a window of 100 columns and a log as at first."""
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.chdir(tmp_path)
    log = logging.getLogger("softehl")
    level, handlers = log.level, list(log.handlers)
    yield tmp_path
    log.setLevel(level)
    for handler in set(log.handlers) - set(handlers):
        log.removeHandler(handler)
        handler.close()


def read(part: str) -> Reader:
    """The reader of a part, after its last block."""
    folder, text = PARTS[part]
    reader = Reader(GALLERY / "models" if folder == "gallery/" else DOCS / (folder or "models"))
    for block in blocks(text):
        reader.read(block)
    return reader


def marks_of(part: str) -> list[pytest.MarkDecorator]:
    """Of a part: whole seals take the longest."""
    seal = part == "report" or part.startswith("first-seal")
    return [pytest.mark.slow] * (part in LONG) + [pytest.mark.first] * seal


@pytest.mark.parametrize("part", [pytest.param(p, marks=marks_of(p)) for p in PARTS])
def test_a_part_runs_in_order_and_prints_what_it_shows(part: str, here: Path) -> None:
    if part == "report" or part.startswith("first-seal"):
        pytest.importorskip("bokeh", reason="the extra `report` is not installed")
    read(part)
    assert_shown(PARTS[part][1])
    if part == "report":
        for name in ("results/soft/report.html", "results/hard/report.html", "both.html"):
            assert (here / name).stat().st_size < 5e6
        assert (here / "both.xlsx").is_file()


def test_the_parts_hold_whole_pages_and_every_model() -> None:
    assert set(PARTS) > LONG
    for pages in (TUTORIAL, ("first-seal",)):
        inside = [b for text in chapters(*pages).values() for b in blocks(text)]
        whole = "\n".join(map(text_of, pages))
        assert len(inside) == len(blocks(whole))
        assert whole.count("\n```") == 2 * len(inside)
        shown = {b.name for b in inside if b.kind == "python" and b.name}
        models = {p.name for p in (DOCS / "models").glob("*.py")}
        assert shown == (models if pages is TUTORIAL else set())
    counts = {name: len(list(numbers(text))) for name, text in chapters("first-seal").items()}
    expected = {"Run it": 10, "A cylinder rod at 10 MPa": 24, "Other sections": 16}
    assert {name: n for name, n in counts.items() if n} == expected


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
def test_a_page_that_is_wrong_is_noticed(wrong: list[Block], here: Path) -> None:
    *before, last = wrong
    reader = Reader(DOCS / "models")
    for block in before:
        reader.read(block)
    with pytest.raises(AssertionError, match="line "):
        reader.read(last)


# --- tables of numbers ----------------------------------------------------------------------------

_TABLE = re.compile(r"<!-- numbers (.+?) -->\n.*?\n\|[-|]+\n(.*?)<!-- end -->", re.DOTALL)
_LINE = re.compile(r"^ +([-+]\d+) +(\S+) .*ok$", re.MULTILINE)


def curve(folder: str) -> dict[float, dict[str, str]]:
    """The states of a run by rod speed."""
    with (Path(folder) / "curve.csv").open(encoding="utf-8") as file:
        return {float(row["rod_speed_mm_s"]): row for row in csv.DictReader(file)}


def numbers(text: str) -> Iterator[tuple[str, float, str, float, str]]:
    """Every number of the tables of a chapter: folder, speed, column, value, verdict.

    The friction of a state that is `uncertain`, or nearly so, is in italics.
    """
    for folders, lines in _TABLE.findall(text):
        for line in lines.splitlines():
            speed, *cells = (cell.strip() for cell in line.strip("|").split("|"))
            for i, folder in enumerate(folders.split()):
                pair = cells[2 * i : 2 * i + 2]
                verdict = "uncertain" if pair[1].startswith("*") else "ok"
                for column, cell in zip(("h_star_um", "rod_friction_N"), pair, strict=True):
                    yield folder, float(speed), column, float(cell.strip("*")), verdict
    for speed, h_star in _LINE.findall(text):
        yield "results/oring", float(speed), "h_star_um", float(h_star), "ok"


def assert_shown(text: str) -> None:
    """`AssertionError` where a run has another number, or a verdict that the page does not say."""
    for folder, speed, column, value, verdict in numbers(text):
        row = curve(folder)[speed]
        close = 0.04 if verdict != "ok" and column == "rod_friction_N" else AGREE
        assert float(row[column]) == pytest.approx(value, rel=close), f"{folder}, {speed}: {column}"
        assert row["verdict"] in ("ok", verdict), f"{folder}, {speed}"


def test_a_number_that_is_wrong_is_noticed(here: Path) -> None:
    (here / "results/a").mkdir(parents=True)
    head = "rod_speed_mm_s,h_star_um,rod_friction_N,verdict\n"
    table = "<!-- numbers results/a -->\n| U | h | F |\n|---|---|---|\n| 50 | 2 | 3 |\n<!-- end -->"
    (here / "results/a/curve.csv").write_text(head + "50,2.001,3.001,ok\n")
    assert_shown(table)
    for wrong in ("50,2.1,3,ok\n", "50,2,3.1,ok\n", "50,2,3,uncertain\n"):
        (here / "results/a/curve.csv").write_text(head + wrong)
        with pytest.raises(AssertionError):
            assert_shown(table)


def lines_of(block: Block) -> int:
    """Lines that are neither blank nor a comment."""
    return sum(bool(line.strip()) for line in block.text.splitlines())


def test_the_gallery_counts_lines_and_has_all_parts() -> None:
    index = text_of("gallery/index")
    rows = re.findall(r"\]\(([\w-]+)\.md\) \|.*\| (\d+) \| (\d+) \|$", index, re.MULTILINE)
    tree = re.findall(r"^([\w-]+)$", index.partition("{toctree}")[2], re.MULTILINE)
    assert {entry for entry, _, _ in rows} == set(ENTRIES)
    assert sorted(tree) == ENTRIES
    shown = set()
    for entry, page, driver in rows:
        text = text_of(f"gallery/{entry}")
        code = [b for b in blocks(text) if b.kind == "python"]
        first = [next(b for b in code if bool(b.name) is named) for named in (True, False)]
        assert [lines_of(b) for b in first] == [int(page), int(driver)], entry
        shown |= {b.name for b in blocks(text) if b.name}
        assert f"](pictures/{entry}.png)" in text
        assert (GALLERY / "pictures" / f"{entry}.png").stat().st_size < 80_000
        for heading in ("Comparison with published results", "Differences and limits"):
            assert f"\n## {heading}\n" in text, entry
    assert shown == {page.name for page in (GALLERY / "models").glob("*.py")}


def test_seven_problems_take_at_most_half_of_the_lines_by_hand() -> None:
    section = text_of("compare").partition("## Seven problems in full")[2].partition("\n## ")[0]
    code = [block.text.splitlines() for block in blocks(section) if block.kind == "python"]
    counted = [sum(bool(line.partition("#")[0].strip()) for line in lines) for lines in code]
    rows = re.findall(r"^\| (.+) \| (\d+) \| (\d+) \|$", section, re.MULTILINE)
    assert [name for name, _, _ in rows] == re.findall(
        r"^\*\*(.+?)\.?:?\*\*", section, re.MULTILINE
    )
    assert [int(here) for _, _, here in rows] == counted
    assert len(rows) == 7
    assert all(2 * int(here) <= int(by_hand) for _, by_hand, here in rows)


# free out of its plane, as deal.II's panel is, where it would buckle
@pytest.mark.filterwarnings("ignore::softehl.runtime.equations.stability.UnstableState")
@pytest.mark.slow
def test_cook_with_quadratic_elements(here: Path) -> None:
    from softehl import Mesh, Study

    space = read("gallery/cook").namespace
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
        table = re.search(rf"^\| 3-D, `{kind}` \|(.*)$", text_of("gallery/cook"), re.MULTILINE)
        assert table is not None
        shown = [float(value) for value in table[1].split("|") if value.strip()]
        np.testing.assert_allclose(found, shown, atol=6e-4)


# --- notebooks ------------------------------------------------------------------------------------

NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))

# in a process of its own: a kernel, its sockets and its warnings are not this suite's
RUN = """
import sys, nbclient, nbformat
notebook = nbformat.read(sys.argv[1], as_version=4)
nbclient.NotebookClient(notebook, timeout=300).execute()
nbformat.write(notebook, sys.argv[1])
"""


def run(path: Path) -> subprocess.CompletedProcess[str]:
    """Run a notebook where it stands, and write its outputs into it."""
    command = [sys.executable, "-c", RUN, str(path)]
    # the command line, which other tests call, sends pictures to files
    environment = {name: value for name, value in os.environ.items() if name != "MPLBACKEND"}
    return subprocess.run(
        command, cwd=path.parent, env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_prints_what_its_page_shows(path: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copy(path, tmp_path))
    done = run(copy)
    assert done.returncode == 0, done.stderr[-2000:]
    cells = json.loads(copy.read_text(encoding="utf-8"))["cells"]
    outputs = [c["outputs"] for c in cells if c["cell_type"] == "code"]
    streams = [[o["text"] for o in out if o["output_type"] == "stream"] for out in outputs]
    printed = ["".join(line for text in out for line in text) for out in streams]
    shown = [b.text for b in blocks(text_of(f"gallery/{path.stem}")) if b.kind == "text"]
    assert [p for p in printed if p and not p.startswith("Writing")] == shown
    (drawn,) = (o["data"] for o in outputs[-1] if o["output_type"] == "display_data")
    assert "image/png" in drawn


def test_a_notebook_that_fails_is_seen(tmp_path: Path) -> None:
    path = Path(shutil.copy(NOTEBOOKS[0], tmp_path))
    broken = json.loads(path.read_text(encoding="utf-8"))
    code = next(c for c in broken["cells"] if c["cell_type"] == "code")
    code["source"] = ["assert 1 == 2"]
    path.write_text(json.dumps(broken), encoding="utf-8")
    done = run(path)
    assert done.returncode != 0
    assert "AssertionError" in done.stderr


def test_notebooks_are_those_of_the_pages() -> None:
    space: dict[str, object] = {"__file__": str(DOCS / "notebooks" / "make.py"), "__name__": "make"}
    exec((DOCS / "notebooks" / "make.py").read_text(encoding="utf-8"), space)
    assert {path.stem for path in NOTEBOOKS} == set(space["DRAWN"])  # type: ignore[call-overload]
    assert len(NOTEBOOKS) == 3
    for path in NOTEBOOKS:
        text = space["notebook"](path.stem)  # type: ignore[operator]
        assert path.read_text(encoding="utf-8") == text, "run python docs/notebooks/make.py"
        assert f"../notebooks/{path.name}" in text_of(f"gallery/{path.stem}")
