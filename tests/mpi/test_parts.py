"""Meshes in parts: their solution is that of the whole, on any number of processes."""

from __future__ import annotations

import json
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from tests.mpi.test_engine import MARKS, ROOT, mpiexec

pytestmark = MARKS


BY_PROCESSES = {
    1: ("hex",),
    2: (
        "hex",
        "serendipity",
        "tetrahedron",
        "motion",
        "files",
        "gmsh",
        "march",
        "wrong",
        "refused",
    ),
    3: ("hex", "wedge", "line", "inner", "files", "gmsh"),
}
"""Problems that are solved by so many processes, all in one start of them."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of all starts."""
    return tmp_path_factory.mktemp("parts")


@cache
def found(processes: int, folder: Path) -> dict[str, Any]:
    """What the problems of so many processes give, by name."""
    place = folder / str(processes)
    place.mkdir(exist_ok=True)
    script = [sys.executable, "-m", "tests.mpi.parts", str(place), *BY_PROCESSES[processes]]
    words = [*mpiexec(processes), *script]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr
    told: dict[str, Any] = json.loads(done.stdout)
    return told


@pytest.mark.parametrize(
    ("name", "processes"),
    [
        (name, processes)
        for processes, names in BY_PROCESSES.items()
        for name in names
        if name not in ("wrong", "refused")
    ],
)
def test_parts_give_what_the_whole_gives(name: str, processes: int, folder: Path) -> None:
    told = found(processes, folder)[name]
    assert max(told["apart"].values()) < 1e-10, told
    assert told["largest part"] < {1: 1.01, 2: 0.75, 3: 0.65}[processes]


def test_another_load_is_seen(folder: Path) -> None:
    assert found(2, folder)["wrong"]["apart"]["u_x"] > 1e-7


def test_a_march_is_written_in_parts(folder: Path) -> None:
    """With history, on two processes; every file that the series names is there."""
    import meshio

    assert "march" in found(2, folder)
    place = folder / "2" / "march"
    steps = (place / "steps.pvd").read_text(encoding="utf-8")
    assert 'file="steps_0002.pvtu"' in steps
    index = (place / "steps_0002.pvtu").read_text(encoding="utf-8")
    pieces = [f"steps_0002_{k:04d}.vtu" for k in (0, 1)]
    assert all(f'Source="{piece}"' in index for piece in pieces)
    cells = [len(meshio.read(place / piece).cells[0].data) for piece in pieces]
    assert sum(cells) == 6 * 8


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("serial", 'engine = "serial": not for a mesh in parts; leave out spread=True'),
        ("tie", "tie('left', 'right'): not for a mesh in parts; leave out spread=True"),
        ("contact", "contact('left', 'right'): not for a mesh in parts; leave out spread=True"),
        ("split", "split: not for a mesh in parts; leave out spread=True"),
        ("checkpoint", "checkpoint and restart: not for a mesh in parts; leave out spread=True"),
        ("nowhere", "the predicate chooses no node"),
        ("no place", "no node at (3, 3, 3), in any part of the mesh"),
        ("outside", "(3, 3, 3) lies outside the mesh"),
        ("whole file", "of a mesh in parts results are .pvtu"),
        ("too many", "cells = (1,): too few to be cut for 2 processes"),
        ("no file", "none_1.msh: there is no such file, and each of 2 processes reads one"),
    ],
)
def test_what_parts_cannot_is_refused_by_all(name: str, words: str, folder: Path) -> None:
    assert words in found(2, folder)["refused"][name]
