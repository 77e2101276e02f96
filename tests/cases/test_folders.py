"""Where a run goes that names no folder: the README's lines can be pasted again and again."""

import contextlib
import io
import os
import re
import shlex
from pathlib import Path

import pytest

import softehl
from softehl.cases.harness.output_dir import unnamed_folder
from tests.docs.pages import Reader, blocks

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
FAST = ("speeds=[1600]", "stroke=out", "density=1", "error_estimate=false")


def first_block() -> list[list[str]]:
    """The commands of softehl at the top of the README, as a shell reads them."""
    top = README.partition("```python")[0]
    lines = re.findall(r"^ *(softehl (?:run|sweep|report|keys) .+)$", top, re.MULTILINE)
    return [shlex.split(line, comments=True)[1:] for line in lines]


def hold(folder: Path, second: int) -> Path:
    """A folder that holds a run which was written at this time."""
    folder.mkdir(parents=True)
    (folder / "run.json").write_text("{}")
    os.utime(folder / "run.json", (second, second))
    return folder


def test_a_new_run_takes_the_first_free_folder(tmp_path: Path) -> None:
    first = tmp_path / "oring"
    assert unnamed_folder(first, "refuse") == (first, "")
    hold(first, 1)
    second = first.with_name("oring-2")
    assert unnamed_folder(first, "refuse") == (
        second,
        f"{first} is taken; this run goes to {second}",
    )
    second.mkdir()
    (second / ".lock").touch()
    assert unnamed_folder(first, "refuse")[0] == first.with_name("oring-3")


def test_a_run_that_is_resumed_is_the_last_one(tmp_path: Path) -> None:
    first = tmp_path / "oring"
    assert unnamed_folder(first, "resume") == (first, "")
    hold(first, 3)
    newest = hold(tmp_path / "oring-2", 5)
    hold(tmp_path / "oring-3", 4)
    hold(tmp_path / "oring-2-b", 9)
    assert unnamed_folder(first, "resume") == (newest, f"--resume: {newest}")
    assert unnamed_folder(first, "overwrite") == (newest, f"--overwrite: {newest}")


def pasted(arguments: list[str], more: tuple[str, ...] = ()) -> int:
    """Exit code of a command; more: keys that make a run cheap."""
    settings = [word for pair in more for word in ("--set", pair)]
    run = arguments[0] == "run"
    with contextlib.redirect_stdout(io.StringIO()):
        return softehl.main([*arguments, *settings, "--pictures", "none"] if run else arguments)


def test_the_readmes_first_block_runs_in_one_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two of its lines name no folder: the second finds results there."""
    monkeypatch.chdir(tmp_path)
    lines = first_block()
    assert [pasted(line, FAST) for line in lines] == [0] * len(lines)
    assert {path.name for path in Path("results").iterdir()} == {"oring", "oring-2"}


def test_the_readmes_python_prints_what_it_shows_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    found = blocks(README)
    assert [block.kind for block in found[:2]] == ["python", "text"]
    for _ in range(2):
        reader = Reader(tmp_path)
        for block in found[:2]:
            reader.read(block)
