"""Meshes in parts: their solution is that of the whole, on any number of processes."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.mpi.test_engine import MARKS, PROCESSES, ROOT, mpiexec

pytestmark = MARKS


def started(name: str, processes: int, folder: Path) -> subprocess.CompletedProcess[str]:
    script = [sys.executable, "-m", "tests.mpi.parts", name, str(folder)]
    words = [*mpiexec(processes), *script]
    return subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=120)


def run(name: str, processes: int, folder: Path) -> dict[str, Any]:
    done = started(name, processes, folder)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize(
    ("name", "processes"),
    [
        *(("hex", n) for n in PROCESSES),
        *(("serendipity", 2), ("wedge", 3), ("tetrahedron", 2), ("line", 3), ("inner", 3)),
        *((name, n) for name in ("motion", "files", "gmsh") for n in (2, 3)),
    ],
)
def test_parts_give_what_the_whole_gives(name: str, processes: int, tmp_path: Path) -> None:
    found = run(name, processes, tmp_path)
    assert max(found["apart"].values()) < 1e-10, found
    assert found["largest part"] < {1: 1.01, 2: 0.75, 3: 0.65}[processes]


def test_another_load_is_seen(tmp_path: Path) -> None:
    assert run("wrong", 2, tmp_path)["apart"]["u_x"] > 1e-7


def test_a_march_is_written_in_parts(tmp_path: Path) -> None:
    """With history, on two processes; every file that the series names is there."""
    import meshio

    assert max(run("march", 2, tmp_path)["apart"].values()) < 1e-10
    steps = (tmp_path / "steps.pvd").read_text(encoding="utf-8")
    assert 'file="steps_0002.pvtu"' in steps
    index = (tmp_path / "steps_0002.pvtu").read_text(encoding="utf-8")
    pieces = [f"steps_0002_{k:04d}.vtu" for k in (0, 1)]
    assert all(f'Source="{piece}"' in index for piece in pieces)
    cells = [len(meshio.read(tmp_path / piece).cells[0].data) for piece in pieces]
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
def test_what_parts_cannot_is_one_line(name: str, words: str, tmp_path: Path) -> None:
    done = started(name, 2, tmp_path)
    assert done.returncode != 0
    ours = [line for line in done.stderr.splitlines() if line.startswith("softehl:")]
    assert len(ours) == 1, done.stderr
    assert words in ours[0]
