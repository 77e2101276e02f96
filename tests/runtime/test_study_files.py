"""Files of a study: places that cannot be written to are named before anything is solved."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from softehl import Mesh, Newton, Study
from softehl.runtime.definition.problem_definition import StudyError


def bar() -> Study:
    study = Study(Mesh.rectangle(2, 1, cells=(2, 1)))
    study.add("bar", material="hooke", E=10.0, nu=0.0)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_x=0.1)
    return study


MASS = {"bar": {"rho": 1.0}}
PATHS: dict[str, Callable[..., Any]] = {
    "solve": lambda s, **a: s.solve(**a),
    "march": lambda s, **a: list(s.march(dt=1.0, until=1.0, **a)),
    "motion": lambda s, **a: list(s.march(dt=1.0, until=1.0, method="newmark", mass=MASS, **a)),
    "follow": lambda s, **a: s.follow(step=1.0, until=lambda r: True, **a),
}


@pytest.mark.parametrize("path", PATHS)
def test_folders_of_results_are_made(path: str, tmp_path: Path) -> None:
    PATHS[path](bar(), write=tmp_path / "new" / path / "part.pvd")
    assert len(list((tmp_path / "new" / path).glob("part_*.vtu"))) >= 1
    assert (tmp_path / "new" / path / "part.pvd").is_file()


@pytest.mark.parametrize(
    ("path", "word", "name", "message"),
    [
        *((path, "write", "file/part.pvd", "file'?: Not a directory") for path in PATHS),
        ("solve", "write", "folder.pvd", "folder.pvd'?: Is a directory"),
        ("solve", "write", "part.vtu", "a series of results is written as .pvd"),
        ("march", "checkpoint", "file/last.npz", "file'?: Not a directory"),
        ("march", "checkpoint", "folder.pvd", "folder.pvd'?: Is a directory"),
        ("march", "restart", "none.npz", "none.npz' is missing or damaged"),
        ("march", "restart", "folder.pvd", "folder.pvd' is missing or damaged"),
    ],
)
def test_nothing_is_solved_for_a_place_that_cannot_be_written(
    path: str,
    word: str,
    name: str,
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.pvd").mkdir()
    monkeypatch.setattr(Newton, "solve", lambda *a: pytest.fail("it was solved"))
    with pytest.raises(StudyError, match=message) as caught:
        PATHS[path](bar(), **{word: tmp_path / name})
    assert str(caught.value).startswith(f"{word} = ") or word == "restart"
    assert "\n" not in str(caught.value)


def test_folders_of_checkpoints_and_single_results_are_made(tmp_path: Path) -> None:
    (result,) = PATHS["march"](bar(), checkpoint=tmp_path / "a" / "b" / "last.npz")
    assert (tmp_path / "a" / "b" / "last.npz").is_file()
    for name in ("one.vtu", "all.pvtu"):
        result.write(tmp_path / name[:3] / name)
        assert (tmp_path / name[:3] / name).is_file()
