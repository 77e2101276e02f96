"""The desk without a browser: what it offers, its case files, its runs, what it needs."""

from __future__ import annotations

import sys
import time
import tomllib
from pathlib import Path

import pytest

from softehl.__main__ import main
from softehl.cases.app.page import CHOICES, rods, slides_on
from softehl.cases.app.runs import Desk, case_text
from softehl.cases.harness.case_file import read_case
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.shipped import SHIPPED

GIVEN = {
    **{"ring": "36x4", "rod": "36 f7", "compound": "NBR 70", "density": 1},
    **{"speeds": [800, 600, 400, 300, 200, 150, 100], "stroke": "out", "error_estimate": False},
}


def wait(desk: Desk, name: str, *, done: int, seconds: float = 240.0) -> None:
    """Wait until a run has so many states."""
    end = time.monotonic() + seconds
    while desk.state(name).done < done:
        assert time.monotonic() < end, desk.state(name)
        assert desk.state(name).running or desk.state(name).done >= done, desk.state(name)
        time.sleep(0.02)


def test_all_that_is_offered_is_understood() -> None:
    usual = {choice.key: choice.value for choice in CHOICES if choice.value != "smooth"}
    for choice in CHOICES:
        for option in (*choice.options, *(rods(usual["ring"]) if choice.key == "rod" else ())):
            given = {**usual, choice.key: option}
            if choice.key == "ring":
                given["rod"] = rods(option)[0]
            if option.startswith("U-cup"):
                del given["gland"]
            if choice.key == "sealed_pressure":
                given["compound"] = "PU 95"  # which bears all of them
            if option == "smooth":
                continue
            key, rod = slides_on(given.pop("rod"))
            p = Seal.model_validate({**given, key: rod})
            assert p.piston == (key == "bore"), option


def test_a_case_file_says_what_was_given(tmp_path: Path) -> None:
    given = {**GIVEN, "oil": 'a "name" in \\ µ', "materials": {"cap": {"mu": 2.0}}}
    assert tomllib.loads(case_text(given)) == {"case": "oring", **given}


def test_a_stopped_run_keeps_what_it_has_and_goes_on(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    name = desk.start(GIVEN)
    try:
        wait(desk, name, done=1)
        desk.stop(name)
        desk.processes[name].wait(30)
        state = desk.state(name)
        assert (state.status, state.requested) == ("stopped", 7)
        assert 1 <= state.done < 7
        first = (tmp_path / name / "profile_1_800.csv").stat().st_mtime_ns
        desk.resume(name)
        desk.processes[name].wait(240)
    finally:
        desk.close()
    state = desk.state(name)
    assert (state.status, state.done, state.requested) == ("done", 7, 7)
    assert (tmp_path / name / "profile_1_800.csv").stat().st_mtime_ns == first
    other = Desk(tmp_path)  # of another session
    assert [s.name for s in other.states()] == [name]
    again = tmp_path / "again.toml"
    again.write_text(other.case_file(name), encoding="utf-8")
    assert state.run is not None
    assert read_case(str(again), SHIPPED).parameters == state.run.parameters


def test_a_run_that_cannot_begin_says_why(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    name = desk.start({**GIVEN, "rod": "nonsense"})
    desk.processes[name].wait(60)
    state = desk.state(name)
    assert state.status == "failed"
    assert "nonsense" in state.line


def test_without_panel_one_line_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delitem(sys.modules, "softehl.cases.app.server", raising=False)
    monkeypatch.setitem(sys.modules, "panel", None)
    assert main(["app", "--folder", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "pip install 'softehl[app]'" in error
