"""The engine `petsc` on 1, 2 and 3 processes against the serial one, and how it ends."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.io import read_arrays
from tests.mpi.problems import tied

MARKS = [
    pytest.mark.mpi,
    pytest.mark.skipif(
        importlib.util.find_spec("petsc4py") is None, reason="PETSc is not installed"
    ),
]
pytestmark = MARKS
ROOT = Path(__file__).parents[2]
MPIEXEC = Path(sys.executable).with_name("mpiexec")
PROCESSES = (1, 2, 3)


def mpiexec(processes: int) -> list[str]:
    """What starts a command on so many processes."""
    found = str(MPIEXEC) if MPIEXEC.exists() else shutil.which("mpiexec")
    assert found, "mpiexec is missing"
    return [found, "-n", str(processes)]


def command(name: str, processes: int, folder: Path) -> list[str]:
    script = [sys.executable, "-m", "tests.mpi.problems", name, "petsc", str(folder)]
    return [*mpiexec(processes), *script]


def run(name: str, processes: int, folder: Path) -> dict[str, Any]:
    """What a problem gives on so many processes."""
    done = subprocess.run(
        command(name, processes, folder), cwd=ROOT, capture_output=True, text=True, timeout=280
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@cache
def serially(name: str) -> dict[str, Any]:
    with TemporaryDirectory() as folder:
        script = [sys.executable, "-m", "tests.mpi.problems", name, "serial", folder]
        done = subprocess.run(script, cwd=ROOT, capture_output=True, text=True, check=True)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def assert_equal(found: dict[str, Any], expected: dict[str, Any], limit: float = 1e-10) -> None:
    """All numbers, relative to the largest of their kind."""
    assert found.keys() == expected.keys()
    size = max(abs(value) for name, value in expected.items() if "force" in name)
    for name, value in expected.items():
        scale = max(size if "force" in name else abs(value), 1e-3)
        assert abs(found[name] - value) <= limit * scale, (name, found[name], value)


@pytest.mark.parametrize("processes", PROCESSES)
def test_the_cube_has_the_published_norm(processes: int, tmp_path: Path) -> None:
    found = run("cube8", processes, tmp_path)
    assert found["norm"] == pytest.approx(6.693706974286, rel=1e-12)
    assert found["largest"] == pytest.approx(0.369653429243, rel=1e-11)


def test_the_serial_cube_too() -> None:
    found = serially("cube8")
    assert found["norm"] == pytest.approx(6.693706974286, rel=1e-12)


@pytest.mark.parametrize("processes", PROCESSES)
@pytest.mark.parametrize("name", ["contact", "tied", "yielding", "adaptive", "condensed", "jumps"])
def test_any_number_of_processes_gives_what_one_gives(
    name: str, processes: int, tmp_path: Path
) -> None:
    assert_equal(run(name, processes, tmp_path), serially(name))


@pytest.mark.parametrize("processes", PROCESSES)
def test_motions(processes: int, tmp_path: Path) -> None:
    """By all methods, tied, with densities and with inertia of a page; the stable step comes from
    Lanczos' method, which ends at 1e-3 and begins differently.
    """
    found, wanted = run("swinging", processes, tmp_path), dict(serially("swinging"))
    for name in [name for name in wanted if name.endswith("stable")]:
        assert found.pop(name) == pytest.approx(wanted.pop(name), rel=2e-3)
    assert_equal(found, wanted, limit=1e-8)


@pytest.mark.parametrize("processes", PROCESSES)
def test_modes_and_buckling(processes: int, tmp_path: Path) -> None:
    """With springs, ties, pressures as unknowns; shapes are as good as they are far apart."""
    found, wanted = run("vibrating", processes, tmp_path), serially("vibrating")
    assert_equal(found, wanted, limit=1e-7)


def test_another_problem_is_seen() -> None:
    with pytest.raises(AssertionError):
        assert_equal(serially("contact"), {**serially("contact"), "norm": 1.0})


def test_multigrid_by_options(tmp_path: Path) -> None:
    found = run("gamg", 2, tmp_path)
    assert found.pop("krylov") > 40
    assert_equal(found, serially("cube4"), limit=1e-8)


@pytest.mark.parametrize("processes", PROCESSES)
def test_multigrid_sees_no_internal_unknowns(processes: int, tmp_path: Path) -> None:
    """In the matrix they take 96 iterations."""
    found, wanted = run("thick", processes, tmp_path), dict(serially("thick"))
    assert wanted.pop("krylov") == 0
    assert 20 < found.pop("krylov") < 70
    assert_equal(found, wanted, limit=1e-8)


@pytest.mark.parametrize("processes", PROCESSES)
def test_shell_matrices(processes: int, tmp_path: Path) -> None:
    found, wanted = run("pushed", processes, tmp_path), dict(serially("pushed"))
    assert 20 < found.pop("krylov") < 120
    for name in ("krylov", "iterations"):
        wanted.pop(name)
    found.pop("iterations")
    assert_equal(found, wanted, limit=1e-9)


def test_shell_matrices_with_ties_are_refused() -> None:
    with pytest.raises(StudyError, match="ties are taken in one process, leave engine out"):
        tied().solve(linear="matrix-free", engine="petsc")


def test_fields_are_split_by_the_names_of_the_page(tmp_path: Path) -> None:
    assert_equal(run("split", 2, tmp_path), serially("contact"), limit=1e-8)


def test_pieces_are_the_whole(tmp_path: Path) -> None:
    import meshio

    run("contact", 2, tmp_path)
    whole = meshio.read(tmp_path / "whole.vtu")
    index = (tmp_path / "parts.pvtu").read_text(encoding="utf-8")
    pieces = [meshio.read(tmp_path / f"parts_{k:04d}.vtu") for k in (0, 1)]
    assert all(f"parts_{k:04d}.vtu" in index for k in (0, 1))
    assert all(f'Name="{name}"' in index for name in (*whole.point_data, *whole.cell_data))
    assert sum(len(p.cells[0].data) for p in pieces) == len(whole.cells[0].data)
    for piece in pieces:
        for place, moved in zip(piece.points, piece.point_data["u"], strict=True):
            row = int(np.abs(whole.points - place).sum(axis=1).argmin())
            np.testing.assert_allclose(moved, whole.point_data["u"][row], atol=1e-12)
    total = sum(p.cell_data["body.sigma_zz"][0].sum() for p in pieces)
    assert total == pytest.approx(whole.cell_data["body.sigma_zz"][0].sum(), rel=1e-10)


def test_progress_is_told_once(tmp_path: Path) -> None:
    done = subprocess.run(
        command("tied", 2, tmp_path), cwd=ROOT, capture_output=True, text=True, timeout=60
    )
    steps = [line for line in done.stderr.splitlines() if line.startswith("step")]
    assert [line.split()[4] for line in steps] == ["0.25", "0.5", "0.75", "1"]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("all fail", "not held: nothing prevents a motion of"),
        ("one fails", "1 of 2 failed, all end: no value for the"),
    ],
)
def test_an_error_is_one_line_and_the_end_of_all(name: str, words: str, tmp_path: Path) -> None:
    done = subprocess.run(
        command(name, 2, tmp_path), cwd=ROOT, capture_output=True, text=True, timeout=120
    )
    assert done.returncode != 0
    ours = [line for line in done.stderr.splitlines() if line.startswith("softehl:")]
    assert len(ours) == 1
    assert words in ours[0]
    assert "Traceback" not in done.stderr


def children(pid: int) -> list[int]:
    """Processes that a process started, and theirs."""
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in map(int, task.read_text(encoding="ascii").split()):
            found += [child, *children(child)]
    return found


def command_line(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_text(encoding="utf-8")
    except OSError:
        return ""


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="reads /proc")
def test_a_killed_process_ends_all_and_loses_nothing(tmp_path: Path) -> None:
    """On 2 processes until one is killed, then on 3: the same end as without a break."""
    expected = serially("march")
    with subprocess.Popen(
        command("slow", 2, tmp_path),
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    ) as started:
        assert started.stderr is not None
        while not started.stderr.readline().startswith("step 6:"):
            pass
        ranks = [p for p in children(started.pid) if "tests.mpi.problems" in command_line(p)]
        workers = [p for p in ranks if "python" in os.readlink(f"/proc/{p}/exe")]
        assert len(workers) == 2
        began = time.monotonic()
        os.kill(workers[1], signal.SIGKILL)
        started.wait(60.0)
        while any(Path(f"/proc/{pid}").exists() for pid in workers):
            assert time.monotonic() - began < 60.0
            time.sleep(0.05)
    saved = read_arrays(tmp_path / "march.npz")
    assert saved is not None
    assert 0.2 < saved["times"][0] < 1.0
    assert_equal(run("restart", 3, tmp_path), expected)
