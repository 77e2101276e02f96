"""Target `matlab`: the folder's own test in Octave, a patch with history, faults."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from softehl.codegen.abi import TargetError
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.material import Law
from softehl.codegen.tools import host_files
from tests.codegen.hosts.materials import fluid, j2
from tests.codegen.hosts.random_pages import A, B, page
from tests.codegen.hosts.test_abaqus_element import (
    GALLERY,
    MODELS,
    TIGHT,
    definition,
    off,
    patched,
    study,
)
from tests.codegen.hosts.test_fortran import bar, branches, named
from tests.codegen.hosts.workshop import errors, folder, made

needs_octave = pytest.mark.skipif(
    shutil.which("octave") is None or shutil.which("mkoctfile") is None, reason="no Octave"
)
STRICT = "-O1 -Wall -Wextra -Werror -Wno-psabi"


@needs_octave
@pytest.mark.parametrize(
    ("page_or_law", "checks"),
    [
        pytest.param(fluid, 5, marks=pytest.mark.slow, id="a modulus that is not symmetric"),
        pytest.param(j2, 8, marks=pytest.mark.slow, id="branches, history"),
        pytest.param(definition(MODELS / "heat.py"), 6, marks=pytest.mark.slow, id="rates"),
        pytest.param(bar(), 7, marks=pytest.mark.slow, id="bar"),
        pytest.param(branches(), 7, marks=pytest.mark.slow, id="arrays of run time"),
        pytest.param(page("line2", A**2, A * B, conservative=False), 8, id="line2"),
    ],
)
def test_a_folder_tests_itself(page_or_law: Definition | Law, checks: int, tmp_path: Path) -> None:
    done = made(folder(page_or_law, "matlab", tmp_path), CFLAGS=STRICT)
    assert done.returncode == 0, done.stdout + done.stderr
    found = errors(done.stdout)
    assert len(found) >= checks
    assert max(e for e in found if e < 1e-13 or e > 1e-6) < 1e-13
    assert max(found) < 1e-6


@needs_octave
@pytest.mark.slow
def test_a_patch_with_plastic_flow_is_that_of_a_study(tmp_path: Path) -> None:
    """History is committed, and rolled back where each increment is tried in vain before."""
    d = definition(GALLERY / "j2.py")
    folder(d, "matlab", tmp_path)
    patched(tmp_path, 0.05, p0=80.0, p1=170.0, p2=0.5, p3=10.0)
    done = made(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "the patch is solved" in done.stdout
    result = study(d, 0.05, G=80.0, K=170.0, sy=0.5, H=10.0).solve(steps=4, newton=TIGHT)
    assert off(d, result, tmp_path) < 1e-12
    once = np.loadtxt(tmp_path / "solution.txt")
    again = ["octave", "--no-gui", "--norc", "--quiet", "--eval", "solve_patch('again');"]
    subprocess.run(again, cwd=tmp_path, check=True, capture_output=True)
    np.testing.assert_array_equal(np.loadtxt(tmp_path / "solution.txt"), once)


@needs_octave
@pytest.mark.slow
def test_a_large_compression_is_cut(tmp_path: Path) -> None:
    d = definition(MODELS / "neo_hooke.py")
    folder(d, "matlab", tmp_path)
    patched(tmp_path, -0.9, increments=1, p0=0.4, p1=1.2)
    done = made(tmp_path)
    assert "increment cut" in done.stdout
    assert "the patch is solved" in done.stdout
    result = study(d, -0.9, mu=0.4, lame=1.2).solve(steps=6, newton=TIGHT)
    assert off(d, result, tmp_path) < 1e-12


@needs_octave
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("random_line2_mex.c", "        transpose(tangent", "        if (0) transpose(tangent"),
        ("random_line2.c", "state[0] = fields[1]", "state[0] = fields[0]"),
        ("random_line2_mex.c", "if (!fits)", "if (0)"),
    ],
)
def test_the_test_of_a_folder_sees_a_fault(name: str, old: str, new: str, tmp_path: Path) -> None:
    folder(page("line2", A**2, A * B, conservative=False), "matlab", tmp_path)
    text = (tmp_path / name).read_text()
    assert old in text
    (tmp_path / name).write_text(text.replace(old, new))
    done = made(tmp_path)
    assert done.returncode != 0
    assert "FAILED" in done.stdout


def test_names_that_matlab_does_not_have_are_refused() -> None:
    with pytest.raises(TargetError, match=r"target matlab has no name a{60}_mex"):
        host_files.files(named("a" * 60, "k"), "matlab")
