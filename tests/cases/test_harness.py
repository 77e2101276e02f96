"""Folders, names and faults of runs; tables of the documentation."""

from __future__ import annotations

import contextlib
import io
import json
import multiprocessing
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import softehl
from softehl.cases import oring
from softehl.cases.cli import unnamed_folder
from softehl.cases.document import DOCS, renewed
from softehl.cases.harness.case import load_case
from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.observer import Observer
from softehl.cases.harness.parameters import keys_of
from softehl.cases.harness.report.page import read_finished
from softehl.cases.harness.run_record import table_digests
from softehl.cases.oring import CASE
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.states.state_files import report_film
from softehl.cases.shipped import SHIPPED
from softehl.folder_lock import FolderLock
from tests.cases.test_cli import FAST as QUICK
from tests.cases.test_cli import Fake, film_state, solve
from tests.docs.pages import Reader, blocks
from tests.test_walls import imports_of

# --- The harness knows no physics: no word of it, no import of a case -----------------------------


HARNESS = Path(__file__).parents[2] / "cases" / "harness"
PHYSICS = (
    *("seal", "sealed", "sealing", "rod", "ring", "oring", "groove", "gland", "housing", "arc"),
    *("pressure", "film", "stroke", "outstroke", "instroke", "contact", "speed", "density"),
    *("leak", "leakage", "friction", "viscosity", "lubricant", "oil", "inlet", "wedge", "slider"),
)
CASES = ("cases.seal", "cases.paper", "cases.oring", "cases.slider", "cases.shipped", "cases.cli")
QUANTITIES = {"units.py": {"viscosity", "density", "oil"}}
"""What a table of units has to say of cSt: that a density is missing."""
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")


def physics(source: str) -> set[str]:
    """Words of physics in a file: parts of identifiers, strings, comments; also in the plural."""
    words = {word.lower() for word in _WORD.findall(source)}
    return {word for word in words if re.sub("(ies|s)$", _singular, word) in PHYSICS}


def _singular(ending: re.Match[str]) -> str:
    return "y" if ending[0] == "ies" else ""


def test_the_harness_mentions_no_physics() -> None:
    for path in HARNESS.glob("*.py"):
        source = path.read_text(encoding="utf-8")
        assert physics(source) <= QUANTITIES.get(path.name, set()), path
        names = {name.removeprefix("softehl.") for name in imports_of(source)}
        assert {name for name in names if name.startswith(CASES)} == set(), path


@pytest.mark.parametrize(
    ("source", "word"),
    [
        ("sealed_pressure: float", "pressure"),
        ("class FilmRow:", "film"),
        ('"""Both strokes of the rod."""', "strokes"),
        ("density # of the mesh", "density"),
        ("DENSITIES = ()", "densities"),
        ("from softehl.cases import oring", "oring"),
    ],
)
def test_a_word_of_physics_is_found(source: str, word: str) -> None:
    assert word in physics(source)


# --- Where a run goes that names no folder: the README's lines can be pasted again and again ------


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


# --- Faults from outside: edited and damaged files, shared folders, killed processes, odd ---------


FOLDER = ("run", "oring", *QUICK, "--out", "a")


@pytest.fixture
def done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of a finished run; `asked` of its solver counts what is computed afterwards."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(oring, "CASE", Fake(solve))
    monkeypatch.setattr(Fake, "draw", lambda *_: None)
    assert softehl.main([*FOLDER, "--quiet"]) == 0
    return tmp_path / "a"


def resumed(monkeypatch: pytest.MonkeyPatch, *more: str) -> tuple[int, list[tuple[str, float]]]:
    """Exit code of a resumed run, and the states that it computed."""
    computed: list[tuple[str, float]] = []

    def counting(parameters: Seal, observer: Observer) -> Any:
        computed.extend((parameters.stroke, u) for u in parameters.speeds)
        return solve(parameters, observer)

    monkeypatch.setattr(oring, "CASE", Fake(counting))
    return softehl.main([*FOLDER, "--resume", "--quiet", *more]), computed


def edited(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


def row_of(folder: Path, speed: str) -> str:
    lines = (folder / "curve.csv").read_text().splitlines()
    return next(line for line in lines if line.split(",")[1] == speed)


DAMAGES: dict[str, Callable[[Path], object]] = {
    "another h*": lambda f: edited(f / "curve.csv", "-400,2,", "-400,99,"),
    "nan": lambda f: edited(f / "curve.csv", "-400,2,", "-400,nan,"),
    "no number": lambda f: edited(f / "curve.csv", "-400,2,", "-400,two,"),
    "another verdict": lambda f: edited(
        f / "curve.csv", row_of(f, "-400"), row_of(f, "-400") + "k"
    ),
    "no verdict": lambda f: edited(f / "curve.csv", row_of(f, "-400"), row_of(f, "-400")[:-2]),
    "another density": lambda f: edited(
        f / "curve.csv", row_of(f, "-400"), row_of(f, "-400").replace(",2,ok", ",4,ok")
    ),
    "a row twice": lambda f: edited(
        f / "curve.csv", row_of(f, "-400"), row_of(f, "-400") + "\n" + row_of(f, "-400")
    ),
    "a row less": lambda f: edited(f / "curve.csv", row_of(f, "-400") + "\n", ""),
    "a profile edited": lambda f: edited(f / "profile_1MPa_in_400mm_s.csv", "4", "5"),
    "a profile cut": lambda f: (f / "profile_1MPa_in_400mm_s.csv").write_bytes(
        (f / "profile_1MPa_in_400mm_s.csv").read_bytes()[:-2]
    ),
    "a profile lost": lambda f: (f / "profile_1MPa_in_400mm_s.csv").unlink(),
    "a section lost": lambda f: (f / "section_1MPa_in_400mm_s.vtu").unlink(),
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_a_row_that_cannot_be_believed_is_computed_again(
    damage: Callable[[Path], object], done: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = (done / "curve.csv").read_bytes()
    damage(done)
    code, computed = resumed(monkeypatch)
    assert code == 0
    assert computed == [("in", 400.0)]
    assert (done / "curve.csv").read_bytes() == before


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_a_row_that_cannot_be_believed_is_not_reported(
    damage: Callable[[Path], object], done: Path
) -> None:
    assert len(read_finished(done, SHIPPED).rows) == 4
    damage(done)
    with pytest.raises(BadInput, match=r"holds no run that can be read|--resume computes"):
        read_finished(done, SHIPPED)


def test_a_table_of_sensitivities_that_was_edited_is_not_believed(
    done: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its state is computed again, and no report has it."""
    slopes = done / "sensitivity_1MPa_in_400mm_s.csv"
    slopes.write_text("a,b\n1,2\n")
    content = json.loads((done / "run.json").read_text())
    content["tables"] = table_digests(done, CASE)
    assert set(content["tables"]) >= {slopes.name, "leakage.csv"}
    (done / "run.json").write_text(json.dumps(content))
    assert len(read_finished(done, SHIPPED).rows) == 4
    slopes.write_text("a,b\n1,3\n")
    with pytest.raises(BadInput, match=r"sensitivity_1MPa_in_400mm_s\.csv is not what was written"):
        read_finished(done, SHIPPED)
    assert resumed(monkeypatch) == (0, [("in", 400.0)])


def test_of_a_run_that_is_under_way_complete_rows_are_reported(done: Path) -> None:
    content = json.loads((done / "run.json").read_text())
    content["states"], content["status"] = content["states"][:-1], "running"
    (done / "run.json").write_text(json.dumps(content))
    assert len(read_finished(done, SHIPPED).rows) == 3


@pytest.mark.parametrize("cut", [1, 2, 40, 100_000])
def test_a_curve_that_is_cut_is_mended(
    cut: int, done: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = (done / "curve.csv").read_bytes()
    (done / "curve.csv").write_bytes(before[:-cut])
    code, computed = resumed(monkeypatch)
    assert code == 0
    assert 0 <= len(computed) <= 4
    assert (done / "curve.csv").read_bytes() == before


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: c["versions"].update(softehl="0.0.1"), "another version: softehl 0.0.1, now"),
        (lambda c: c["kernels"].update(film="0123"), "other kernels: film"),
        (lambda c: c.update(kernels=None), "unknown kernels"),
        (lambda c: c.update(parameters=[1]), "run.json has none"),
        (lambda c: c.update(case="slider"), "case = 'slider'"),
        (lambda c: c.update(states={"a": 1}), "is damaged"),
        (lambda c: c.pop("states"), "is damaged"),
    ],
)
def test_rows_of_another_run_are_refused(
    change: Callable[[dict[str, Any]], object],
    words: str,
    done: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    content = json.loads((done / "run.json").read_text())
    change(content)
    (done / "run.json").write_text(json.dumps(content))
    files = {path.name: path.read_bytes() for path in done.iterdir()}
    assert resumed(monkeypatch) == (2, [])
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line
    assert files == {path.name: path.read_bytes() for path in done.iterdir()}


def test_any_bytes_in_any_file_end_in_no_traceback(
    done: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = sorted(path.name for path in done.iterdir() if path.suffix in (".json", ".csv"))
    for name in names:
        good = (done / name).read_bytes()
        for bad in (b"", b"\xff\xfe", b"{}", b"null", b"a,b\n1,2\n", good[: len(good) // 2]):
            (done / name).write_bytes(bad)
            code, _ = resumed(monkeypatch)
            assert code in (0, 2), (name, bad)
            if code == 2:
                (done / name).write_bytes(good)
        assert resumed(monkeypatch)[0] == 0


# --- folders and processes ---------------------------------------------------------------------


def test_a_folder_in_use_is_refused_and_a_killed_owner_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(oring, "CASE", Fake(solve))
    monkeypatch.setattr(Fake, "draw", lambda *_: None)
    (tmp_path / "a").mkdir()
    owner = subprocess.Popen(
        [
            *(sys.executable, "-c"),
            "import sys, time; from pathlib import Path\n"
            "from softehl.folder_lock import FolderLock\n"
            "lock = FolderLock(Path('a')); lock.take(); print('taken', flush=True)\n"
            "time.sleep(60)",
        ],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert owner.stdout is not None
    assert owner.stdout.readline() == "taken\n"
    assert softehl.main([*FOLDER, "--quiet"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"in use by a run that is under way (process {owner.pid} on " in line
    owner.kill()
    owner.wait()
    owner.stdout.close()
    assert softehl.main([*FOLDER, "--quiet"]) == 0
    assert not (tmp_path / "a" / ".lock").exists()


def test_a_lock_is_for_one(tmp_path: Path) -> None:
    with FolderLock(tmp_path) as first:
        first.take()
        first.take()
        with pytest.raises(BadInput, match=f"in use .* \\(process {os.getpid()} on "):
            FolderLock(tmp_path, error=BadInput).take()
    assert not list(tmp_path.iterdir())
    second = FolderLock(tmp_path)
    second.take()
    second.release()


def run_slowly(folder: str) -> None:
    """A state, then a long silence."""

    def slowly(parameters: Seal, observer: Observer) -> Any:
        report_film(observer, film_state(parameters, max(parameters.speeds)))
        Path(folder).with_name("there").touch()
        time.sleep(300)

    # ignored where the tests themselves run in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)
    oring.CASE = Fake(slowly)
    sys.exit(softehl.main(["run", "oring", *QUICK, "--quiet", "--out", folder]))


@pytest.mark.parametrize(
    "number",
    [
        signal.SIGTERM,
        *(pytest.param(n, marks=pytest.mark.slow) for n in (signal.SIGHUP, signal.SIGINT)),
    ],
)
def test_a_signal_ends_a_run_with_a_word(number: signal.Signals, tmp_path: Path) -> None:
    folder = tmp_path / "a"
    process = multiprocessing.get_context("spawn").Process(target=run_slowly, args=(str(folder),))
    process.start()
    while not (tmp_path / "there").exists() and process.is_alive():
        time.sleep(0.02)
    assert process.pid is not None
    os.kill(process.pid, number)
    process.join(120)
    assert process.exitcode == 128 + number
    content = json.loads((folder / "run.json").read_text())
    assert content["status"] == "interrupted"
    assert len(content["states"]) == 1
    assert not (folder / ".lock").exists()


def test_a_reader_that_leaves_does_not_end_a_run(tmp_path: Path) -> None:
    command = (
        f"{sys.executable} -m softehl run slider --set segments=20 --set 'speeds=[800]' --out a "
        "| head -1; exit ${PIPESTATUS[0]}"
    )
    ended = subprocess.run(
        ["bash", "-c", command], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stderr
    assert json.loads((tmp_path / "a" / "run.json").read_text())["status"] == "converged"


def test_a_file_without_end_is_no_case(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert softehl.main(["run", "/dev/zero"]) == 2
    assert "longer than" in capsys.readouterr().err


# --- the terminal ------------------------------------------------------------------------------


# --- Tables of the documentation that follow from declarations ------------------------------------


def test_tables_are_current() -> None:
    pages: list[Path] = sorted(DOCS.glob("*.md"))
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert renewed(text) == text, f"{page}: run `python -m softehl.cases.document`"


def table_of(what: str, name: str) -> str:
    """The table of a case on the one page that has it."""
    (table,) = [
        found
        for page in DOCS.glob("*.md")
        for found in re.findall(
            rf"<!-- {what} {name}(?: beyond \w+)? -->(.*?)<!-- end -->", page.read_text(), re.DOTALL
        )
    ]
    return str(table)


@pytest.mark.parametrize("name", SHIPPED)
def test_columns_and_keys_of_every_case_are_documented(name: str) -> None:
    case = load_case(SHIPPED[name])
    columns, keys = table_of("columns", name), table_of("keys", name)
    known = [*keys_of(load_case(SHIPPED["oring"]).parameters)] if name == "cycle" else []
    for column in case.row.columns():
        assert columns.count(f"| `{column.name}` |") == 1
        assert column.meaning
    for key in keys_of(case.parameters):
        assert keys.count(f"| `{key.name}` |") == (key not in known)


@pytest.mark.parametrize("name", SHIPPED)
def test_every_key_has_a_meaning_and_bounds(name: str) -> None:
    case = load_case(SHIPPED[name])
    assert case.parameters()  # every key has a default
    for key in keys_of(case.parameters):
        assert key.meaning
        assert key.bounds
        assert not re.search(r"\(\d+\)", f"{key.meaning} {key.bounds}"), "the number of an equation"


def test_an_old_table_is_noticed() -> None:
    stale = "# O-ring\n\n<!-- columns oring -->\n| column |\n<!-- end -->\n"
    assert "| `h_star_um` | um |" in renewed(stale)
    assert renewed(renewed(stale)) == renewed(stale)
