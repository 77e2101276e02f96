"""Series of results on disk and steps on the terminal."""

from __future__ import annotations

import io
import logging
import os
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from softehl import Mesh, Study
from softehl.runtime.analyses.callbacks import Series, read_series
from softehl.runtime.results.result import Result
from softehl.runtime.study import StudyError
from tests.runtime import solid_page as pages


def pulled() -> Study:
    study = Study(Mesh.rectangle(2.0, 1.0, cells=(4, 2)))
    study.add("body", pages.solid(), mu=0.4, lame=2.0, thickness=1.0)
    study.fix("left", u_x=0.0, u_y=0.0)
    study.fix("right", u_x=0.4)
    return study


def whole(path: Path) -> list[tuple[float, meshio.Mesh]]:
    """Everything that a series names, read."""
    return [(t, meshio.read(path.with_name(name))) for t, name in read_series(path)]


def test_a_series_is_whole_after_every_step(tmp_path: Path) -> None:
    path, seen = tmp_path / "part.pvd", []

    def look(result: Result) -> None:
        seen.append(whole(path)[-1])
        assert seen[-1][0] == result.t
        np.testing.assert_array_equal(seen[-1][1].point_data["u_x"], result.values("u_x"))

    pulled().solve(steps=4, write=path, on_step=look)
    assert [t for t, _ in seen] == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert len(whole(path)) == 5
    assert sorted(os.listdir(tmp_path)) == ["part.pvd", *(f"part_000{k}.vtu" for k in range(1, 6))]


def test_a_run_that_is_killed_leaves_a_whole_series(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Wherever the writing stops, what the .pvd names is there and can be read."""
    path, moves, replace = tmp_path / "part.pvd", [0], os.replace

    def killed(*given: Any) -> None:
        moves[0] += 1
        if moves[0] > allowed:
            raise KeyboardInterrupt
        replace(*given)

    monkeypatch.setattr(os, "replace", killed)
    for allowed in range(9):
        moves[0] = 0
        path.unlink(missing_ok=True)
        with pytest.raises(KeyboardInterrupt):
            pulled().solve(steps=4, write=path)
        assert len(whole(path) if path.exists() else []) == allowed // 2


def test_a_march_that_goes_on_continues_its_series(tmp_path: Path) -> None:
    path, kept = tmp_path / "part.pvd", tmp_path / "march.npz"
    march = pulled().march(dt=0.25, until=1.0, checkpoint=kept, write=path)
    next(march), next(march)
    del march
    assert [t for t, _ in whole(path)] == [0.25, 0.5]
    for _ in pulled().march(dt=0.25, until=1.0, restart=kept, write=path):
        pass
    assert [t for t, _ in whole(path)] == [0.25, 0.5, 0.75, 1.0]
    for _ in pulled().march(dt=0.5, until=1.0, write=path):  # another one begins anew
        pass
    assert [t for t, _ in whole(path)] == [0.5, 1.0]


def test_what_cannot_be_written_is_refused(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match=r"write = '.*part.vtu': a series .* is written as .pvd"):
        pulled().solve(write=tmp_path / "part.vtu")
    (tmp_path / "part.pvd").write_text("no series")
    with pytest.raises(StudyError, match=r"part.pvd' is no series of results; remove it"):
        Series(tmp_path / "part.pvd", since=0.5)


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_terminal_has_one_line_and_a_pipe_none(monkeypatch: pytest.MonkeyPatch) -> None:
    for stream, wanted, lines in (
        (io.StringIO(), None, 0),
        (io.StringIO(), True, 2),
        (Terminal(), None, 1),
        (Terminal(), False, 0),
    ):
        monkeypatch.setattr("sys.stderr", stream)
        result = pulled().solve(steps=2, progress=wanted)
        said = stream.getvalue()
        assert said.count("\n") == lines
        if lines:
            last = f"step 2: load factor 1 of 1, {result.iterations} iterations, "
            assert last in said


def test_steps_go_to_the_log_whether_they_are_shown_or_not(
    caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
) -> None:
    pulled().solve(steps=2)
    assert caplog.messages == []
    with caplog.at_level(logging.INFO, logger="softehl"):
        pulled().solve(steps=2)
        pulled().solve(steps=2, progress=True)
    steps = [message.partition(",")[0] for message in caplog.messages]
    assert steps == 2 * ["step 1: load factor 0.5 of 1", "step 2: load factor 1 of 1"]
    assert len(capsys.readouterr().err.splitlines()) == 2
