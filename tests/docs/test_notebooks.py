"""Notebooks: what the pages of the gallery make of them, and run to their end."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
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
    shown = {name: value for name, value in os.environ.items() if name != "MPLBACKEND"}
    return subprocess.run(
        command, cwd=path.parent, env=shown, capture_output=True, text=True, check=False
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
    page = (DOCS / "gallery" / f"{path.stem}.md").read_text(encoding="utf-8")
    shown = re.findall(r"^```text\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
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
    assert len(NOTEBOOKS) == 2
    for path in NOTEBOOKS:
        text = space["notebook"](path.stem)  # type: ignore[operator]
        assert path.read_text(encoding="utf-8") == text, "run python docs/notebooks/make.py"
        assert f"../notebooks/{path.name}" in (DOCS / "gallery" / f"{path.stem}.md").read_text()
