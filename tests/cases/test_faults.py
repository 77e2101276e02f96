"""Faults from outside: edited and damaged files, shared folders, killed processes, odd readers."""

from __future__ import annotations

import json
import multiprocessing
import os
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
from softehl.cases.harness.errors import BadInput
from softehl.cases.harness.observer import Observer
from softehl.cases.harness.report.page import read_finished
from softehl.cases.harness.run_record import table_digests
from softehl.cases.oring import CASE
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.states.state_files import report_film
from softehl.cases.shipped import SHIPPED
from softehl.folder_lock import FolderLock
from tests.cases.test_cli import FAST, Fake, film_state, solve

FOLDER = ("run", "oring", *FAST, "--out", "a")


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
    "a profile edited": lambda f: edited(f / "profile_1_-400.csv", "4", "5"),
    "a profile cut": lambda f: (f / "profile_1_-400.csv").write_bytes(
        (f / "profile_1_-400.csv").read_bytes()[:-2]
    ),
    "a profile lost": lambda f: (f / "profile_1_-400.csv").unlink(),
    "a section lost": lambda f: (f / "section_1_-400.vtu").unlink(),
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
    slopes = done / "sensitivity_1_-400.csv"
    slopes.write_text("a,b\n1,2\n")
    content = json.loads((done / "run.json").read_text())
    content["tables"] = table_digests(done, CASE)
    assert set(content["tables"]) >= {slopes.name, "leakage.csv"}
    (done / "run.json").write_text(json.dumps(content))
    assert len(read_finished(done, SHIPPED).rows) == 4
    slopes.write_text("a,b\n1,3\n")
    with pytest.raises(BadInput, match=r"sensitivity_1_-400\.csv is not what was written"):
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
    sys.exit(softehl.main(["run", "oring", *FAST, "--quiet", "--out", folder]))


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
        f"{sys.executable} -m softehl run oring --set density=1 --set 'speeds=[800]' "
        "--set stroke=out --set error_estimate=false --out a | head -1; exit ${PIPESTATUS[0]}"
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
