"""`softehl run --engine petsc`, and sweeps by mpi4py.futures."""

from __future__ import annotations

import csv
import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from tests.mpi.test_engine import MPIEXEC, ROOT

pytestmark = [
    pytest.mark.mpi,
    pytest.mark.skipif(
        importlib.util.find_spec("petsc4py") is None, reason="PETSc is not installed"
    ),
]
DIFFERENCES = (
    *("flux_variation", "oscillation_index"),
    *("h_star_error_percent", "rod_friction_error_percent"),
)
"""Columns that are differences of near numbers: compared absolutely."""


def oring(folder: Path, processes: int, *options: str) -> subprocess.CompletedProcess[str]:
    launch = [str(MPIEXEC), "-n", str(processes)] if processes > 1 else []
    run = [sys.executable, "-m", "softehl", "run", "oring", "--set", "density=1", "--quiet"]
    words = [*launch, *run, "--out", str(folder), *options]
    return subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=280)


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "curve.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def apart(a: str, b: str, name: str) -> float:
    """How far two entries are apart, relatively."""
    try:
        x, y = float(a), float(b)
    except ValueError:
        return 0.0 if a == b else 1.0
    return abs(x - y) / (1.0 if name in DIFFERENCES else max(abs(x), 1e-300))


def largest(one: list[dict[str, str]], other: list[dict[str, str]]) -> float:
    pairs = zip(one, other, strict=True)
    return max(apart(a[name], b[name], name) for a, b in pairs for name in a)


def test_the_oring_has_the_same_curve_by_mumps(tmp_path: Path) -> None:
    for processes in (0, 1, 2):
        done = oring(
            tmp_path / str(processes), processes, *(["--engine", "petsc"] * (processes > 0))
        )
        assert done.returncode == 0, done.stderr
        assert not done.stderr
    serial = rows(tmp_path / "0")
    assert len(serial) > 5
    for processes in (1, 2):
        assert largest(serial, rows(tmp_path / str(processes))) < 1e-9
    assert largest(serial, [{**r, "h_star_um": "1"} for r in serial]) > 1e-3


def test_what_is_wrong_is_told_once_and_ends_all(tmp_path: Path) -> None:
    done = oring(tmp_path, 2, "--engine", "petsc", "--jobs", "2")
    assert done.returncode != 0
    assert "--jobs 2 with --engine petsc" in done.stderr
    done = oring(tmp_path, 2, "--engine", "petsc", "--set", "youngs_modlus=3")
    assert done.returncode == 2
    assert done.stderr.count("youngs_modlus") == 1


SWEEP = """
import sys
from mpi4py.futures import MPIPoolExecutor
import softehl

if __name__ == "__main__":
    given = {"density": 1, "stroke": "out", "speeds": (1600.0,)}
    cases = [softehl.Seal(sealed_pressure=p, **given) for p in (0.5, 1.0)]
    with MPIPoolExecutor() as executor:
        curves = softehl.solve_cases(cases, sys.argv[1] + "/mpi", executor)
    here = softehl.solve_cases(cases, sys.argv[1] + "/here")
    same = [repr(a.rows) == repr(b.rows) for a, b in zip(curves, here)]  # rows may have nan
    print(*(equal and len(a.rows) for equal, a in zip(same, curves)))
"""


def test_a_sweep_by_the_processes_of_mpi(tmp_path: Path) -> None:
    """mpi4py's executor is one more of those that the harness takes."""
    script = tmp_path / "sweep.py"
    script.write_text(SWEEP, encoding="utf-8")
    launch = [str(MPIEXEC), "-n", "2", sys.executable, "-m", "mpi4py.futures"]
    words = [*launch, str(script), str(tmp_path)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["1", "1"]


def test_a_case_without_factors_is_refused(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "softehl", "run", "slider", "--engine", "petsc"]
    done = subprocess.run([*words, "--out", str(tmp_path / "no")], capture_output=True, text=True)
    assert done.returncode == 2
    assert "slider has no linear systems worth several processes" in done.stderr
    assert not (tmp_path / "no").exists()
