"""CONTRIBUTING.md: the walk that it describes is the one that a run takes."""

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

import pytest

import softehl

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
STEPS = re.findall(r"^\d+\. `([\w/]+\.py)`, `([\w.]+)`: ", PAGE, re.MULTILINE)


@pytest.fixture
def called() -> Iterator[list[tuple[str, str]]]:
    """Steps of the walk in the order in which they are called, each call once more."""
    steps, calls = set(STEPS), list[tuple[str, str]]()
    files = {str(path): name for name, _ in STEPS for path in [ROOT / name]}
    links = {str(ROOT / "src" / "softehl" / name): name for name, _ in STEPS}

    def note(frame: FrameType, event: str, argument: object) -> None:
        code = frame.f_code
        name = files.get(code.co_filename) or links.get(code.co_filename)
        if event == "call" and name and (name, code.co_qualname) in steps:
            calls.append((name, code.co_qualname))

    sys.setprofile(note)
    yield calls
    sys.setprofile(None)


def test_the_walk_has_at_most_twelve_steps_each_in_a_file() -> None:
    assert 8 <= len(STEPS) <= 12
    assert len({file for file, _ in STEPS}) == len(STEPS)


def test_a_speed_walks_as_described(called: list[tuple[str, str]], tmp_path: Path) -> None:
    keys = ("density=1", "stroke=out", "speeds=[800]", "error_estimate=false")
    options = [word for key in keys for word in ("--set", key)]
    assert softehl.main(["run", "oring", *options, "--quiet", "--out", str(tmp_path / "run")]) == 0
    sys.setprofile(None)
    ahead = iter(called)
    assert [step for step in STEPS if step not in ahead] == []  # in this order


FOLDERS = "cases|codegen|runtime|tests|docs|generated|src"
WANTED = {
    *("cell", "time integrator", "linear solver", "constraint", "mesh format", "contact law"),
    *("input of sensitivities", "material", "term of the film", "column of `curve.csv`"),
    *("section", "pass of the compiler", "host", "case", "kind of run-time array"),
}


def test_files_that_are_named_are_there() -> None:
    for name in re.findall(rf"`((?:{FOLDERS})/[\w/.]+)`", PAGE):
        path = ROOT / name
        assert path.exists() or ("NAME" in name and path.parents[name.count("NAME/")].is_dir()), (
            name
        )


def test_recipes_name_what_is_in_their_files() -> None:
    """Words with a capital are names in the files of their recipe, or public."""
    recipes = re.findall(r"^\*\*An? (.*?)\.?\*\*((?:.|\n)*?)(?=^\*\*|^## )", PAGE, re.MULTILINE)
    assert {name for name, _ in recipes} == WANTED
    for recipe, text in recipes:
        files = [ROOT / name for name in re.findall(rf"`((?:{FOLDERS})/[\w/]+\.py)`", text)]
        sources = [file.read_text("utf-8") for file in files if file.exists()]
        inside = {word for source in sources for word in re.findall(r"\b\w+\b", source)}
        named = set(re.findall(r"`([A-Z_]\w+)`", text)) - {*softehl.__all__, "CASE"}
        assert named <= inside, recipe


def test_modules_that_are_named_are_there() -> None:
    for module in re.findall(r"python -m ([\w.]+)", PAGE):
        if module != "pytest":
            path = module.removeprefix("softehl.").replace(".", "/")
            assert (ROOT / f"{path}.py").exists(), module
