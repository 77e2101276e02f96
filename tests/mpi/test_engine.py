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


def mpiexec(processes: int) -> list[str]:
    """What starts a command on so many processes."""
    found = str(MPIEXEC) if MPIEXEC.exists() else shutil.which("mpiexec")
    assert found, "mpiexec is missing"
    return [found, "-n", str(processes)]


ALIKE = ("contact", "tied", "yielding", "adaptive", "condensed", "jumps")
"""Problems of which all numbers are those of one process."""
BY_PROCESSES: dict[int, tuple[tuple[str, ...], ...]] = {
    0: (("cube8", "cube4", *ALIKE, "swinging", "vibrating", "thick", "pushed", "march"),),
    1: (("cube8", "contact"),),
    2: (("split", "gamg", "cube8", *ALIKE, "swinging", "vibrating", "thick", "pushed"),),
    3: (("contact", "tied", "condensed", "jumps"),),
}
"""Problems that are solved by so many processes; a tuple of names is one start of them.

0: the serial engine. The first problems of two processes have options of PETSc, which the others
must not see. Three processes on two processors are slow: they have short problems.
"""


def command(processes: int, folder: Path, *names: str) -> list[str]:
    """Problems on so many processes."""
    launch, engine = (mpiexec(processes), "petsc") if processes else ([], "serial")
    return [*launch, sys.executable, "-m", "tests.mpi.problems", engine, str(folder), *names]


def run(processes: int, folder: Path, *names: str) -> dict[str, Any]:
    """What problems give on so many processes, by name."""
    words = command(processes, folder, *names)
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of all starts."""
    return tmp_path_factory.mktemp("engine")


@cache
def found(processes: int, folder: Path) -> dict[str, Any]:
    """What the problems of so many processes give, by name."""
    place = folder / str(processes)
    place.mkdir(exist_ok=True)
    told = [run(processes, place, *names) for names in BY_PROCESSES[processes]]
    return {name: values for one in told for name, values in one.items()}


def on(*names: str) -> pytest.MarkDecorator:
    """Names, and numbers of processes on which they are solved."""
    starts = [(k, solved) for k, of in BY_PROCESSES.items() for solved in of if k]
    pairs = [(n, k) for n in names for k, solved in starts if n in solved]
    return pytest.mark.parametrize(("name", "processes"), pairs)


def assert_equal(found: dict[str, Any], expected: dict[str, Any], limit: float = 1e-10) -> None:
    """All numbers, relative to the largest of their kind."""
    assert found.keys() == expected.keys()
    size = max(abs(value) for name, value in expected.items() if "force" in name)
    for name, value in expected.items():
        scale = max(size if "force" in name else abs(value), 1e-3)
        assert abs(found[name] - value) <= limit * scale, (name, found[name], value)


@pytest.mark.parametrize("processes", [0, 1, 2])
def test_the_cube_has_the_published_norm(processes: int, folder: Path) -> None:
    cube = found(processes, folder)["cube8"]
    assert cube["norm"] == pytest.approx(6.693706974286, rel=1e-12)
    assert cube["largest"] == pytest.approx(0.369653429243, rel=1e-11)


@on(*ALIKE)
def test_any_number_of_processes_gives_what_one_gives(
    name: str, processes: int, folder: Path
) -> None:
    assert_equal(found(processes, folder)[name], found(0, folder)[name])


def test_motions(folder: Path) -> None:
    """By all methods, tied, with densities and with inertia of a page; the stable step comes from
    Lanczos' method, which ends at 1e-3 and begins differently.
    """
    told, wanted = dict(found(2, folder)["swinging"]), dict(found(0, folder)["swinging"])
    for name in [name for name in wanted if name.endswith("stable")]:
        assert told.pop(name) == pytest.approx(wanted.pop(name), rel=2e-3)
    assert_equal(told, wanted, limit=1e-8)


def test_modes_and_buckling(folder: Path) -> None:
    """With springs, ties, pressures as unknowns; shapes are as good as they are far apart."""
    assert_equal(found(2, folder)["vibrating"], found(0, folder)["vibrating"], limit=1e-7)


def test_another_problem_is_seen(folder: Path) -> None:
    contact = found(0, folder)["contact"]
    with pytest.raises(AssertionError):
        assert_equal(contact, {**contact, "norm": 1.0})


def test_multigrid_by_options(folder: Path) -> None:
    told = dict(found(2, folder)["gamg"])
    assert told.pop("krylov") > 40
    assert_equal(told, found(0, folder)["cube4"], limit=1e-8)


@on("thick")
def test_multigrid_sees_no_internal_unknowns(name: str, processes: int, folder: Path) -> None:
    """In the matrix they take 96 iterations."""
    told, wanted = dict(found(processes, folder)[name]), dict(found(0, folder)[name])
    assert wanted.pop("krylov") == 0
    assert 20 < told.pop("krylov") < 70
    assert_equal(told, wanted, limit=1e-8)


@on("pushed")
def test_shell_matrices(name: str, processes: int, folder: Path) -> None:
    told, wanted = dict(found(processes, folder)[name]), dict(found(0, folder)[name])
    assert 20 < told.pop("krylov") < 120
    for count in ("krylov", "iterations"):
        wanted.pop(count)
    told.pop("iterations")
    assert_equal(told, wanted, limit=1e-9)


def test_shell_matrices_with_ties_are_refused() -> None:
    with pytest.raises(StudyError, match="ties are taken in one process, leave engine out"):
        tied().solve(linear="matrix-free", engine="petsc")


def test_fields_are_split_by_the_names_of_the_page(folder: Path) -> None:
    assert_equal(found(2, folder)["split"], found(0, folder)["contact"], limit=1e-8)


def test_pieces_are_the_whole(folder: Path) -> None:
    import meshio

    assert "contact" in found(2, folder)
    place = folder / "2" / "contact"
    whole = meshio.read(place / "whole.vtu")
    index = (place / "parts.pvtu").read_text(encoding="utf-8")
    pieces = [meshio.read(place / f"parts_{k:04d}.vtu") for k in (0, 1)]
    assert all(f"parts_{k:04d}.vtu" in index for k in (0, 1))
    assert all(f'Name="{name}"' in index for name in (*whole.point_data, *whole.cell_data))
    assert sum(len(p.cells[0].data) for p in pieces) == len(whole.cells[0].data)
    for piece in pieces:
        for point, moved in zip(piece.points, piece.point_data["u"], strict=True):
            row = int(np.abs(whole.points - point).sum(axis=1).argmin())
            np.testing.assert_allclose(moved, whole.point_data["u"][row], atol=1e-12)
    total = sum(p.cell_data["body.sigma_zz"][0].sum() for p in pieces)
    assert total == pytest.approx(whole.cell_data["body.sigma_zz"][0].sum(), rel=1e-10)


def test_progress_is_told_once(tmp_path: Path) -> None:
    done = subprocess.run(
        command(2, tmp_path, "tied"), cwd=ROOT, capture_output=True, text=True, timeout=60
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
        command(2, tmp_path, name), cwd=ROOT, capture_output=True, text=True, timeout=120
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
def test_a_killed_process_ends_all_and_loses_nothing(tmp_path: Path, folder: Path) -> None:
    """On 2 processes until one is killed, then on 3: the same end as without a break."""
    expected = found(0, folder)["march"]
    with subprocess.Popen(
        command(2, tmp_path, "slow"),
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
    assert_equal(run(3, tmp_path, "restart")["restart"], expected)
