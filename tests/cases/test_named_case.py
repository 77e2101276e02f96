"""Cases of a user's module, by module and attribute: run, resumed, swept, reported, refused."""

import csv
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import softehl
from softehl.runtime.io import read_json

MODEL = Path(__file__).parents[2] / "docs" / "models" / "bending.py"
BROKEN = "from bending import Bending\n\nCASE = Bending()\nNUMBER = 3\n"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A working directory with two modules, which are forgotten afterwards."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    shutil.copy(MODEL, tmp_path)
    Path("mine.py").write_text(BROKEN)
    Path("fails.py").write_text("1 / 0\n")
    yield tmp_path
    for name in ("bending", "mine", "fails"):
        sys.modules.pop(name, None)


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def run(*words: str) -> int:
    return softehl.main(["run", *words, "--quiet", "--out", "tips"])


def test_a_case_of_a_module_is_run_and_resumed(folder: Path) -> None:
    assert run("bending:Bending", "--set", "forces=[0.01]") == 0
    (tip,) = rows(folder / "tips" / "curve.csv")
    assert float(tip["tip_mm"]) == pytest.approx(4.0 * 0.01 * 10.0**3 / 1000.0, rel=0.02)
    assert read_json(folder / "tips" / "run.json")["case"] == "bending:Bending"
    Path("case.toml").write_text('case = "bending:Bending"\nforces = [0.01, 0.02]\n')
    assert run("case.toml", "--resume", "--jobs", "2") == 0
    assert [row["force_N"] for row in rows(folder / "tips" / "curve.csv")] == ["0.02", "0.01"]
    assert softehl.main(["report", "tips"]) == 0
    assert "ip of a beam" in Path("tips/report.html").read_text(encoding="utf-8")


def test_an_instance_is_run_too() -> None:
    assert run("mine:CASE") == 0


def test_its_keys_are_listed_and_swept(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert softehl.main(["keys", "bending:Bending"]) == 0
    assert "Young's modulus" in capsys.readouterr().out
    Path("study.toml").write_text('case = "bending:Bending"\n[grid]\nE = [500, 1000]\n')
    assert softehl.main(["sweep", "study.toml", "--out", "swept", "--quiet"]) == 0
    assert len(rows(folder / "swept" / "sweep.csv")) == 4


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("nowhere.cases:Case", "there is no module 'nowhere' here or in PYTHONPATH"),
        ("fails:Case", "fails cannot be imported, ZeroDivisionError: division by zero"),
        ("mine:Case", "mine has no 'Case'; allowed: a case, class or instance"),
        ("mine:NUMBER", "'NUMBER' is no case; allowed: a subclass of Case, or an instance"),
        ("bending:TipRow", "TipRow() failed, TypeError: "),
        ("softehl.cases.harness.case:Case", "'Case' is no case; allowed: a subclass of Case"),
    ],
)
def test_what_is_no_case_is_refused_in_one_line(
    name: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(name) == 2
    error = capsys.readouterr().err
    assert f"{name}: {words}" in error
    assert error.count("\n") == 1
    assert not Path("tips").exists()
