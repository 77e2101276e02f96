"""Target `feap`: its stand-in in Fortran, the same patch by a study, faults, what ends FEAP."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from softehl.codegen.abi import TargetError
from softehl.codegen.language.definition import Definition
from softehl.codegen.tools import host_files
from tests.codegen.hosts.materials import neo
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
from tests.codegen.hosts.test_fortran import bar, named
from tests.codegen.hosts.workshop import errors, folder, made

needs_fortran = pytest.mark.skipif(shutil.which("gfortran") is None, reason="no gfortran")
STRICT = "-O1 -fcheck=bounds -Wall -Wno-unused-dummy-argument -Wno-zerotrip -Werror"


@needs_fortran
@pytest.mark.parametrize(
    "d",
    [
        pytest.param(page("tri6", A**2, A * B, conservative=False), id="tri6"),
        pytest.param(definition(MODELS / "heat.py"), marks=pytest.mark.slow, id="rates"),
        pytest.param(definition(MODELS / "spring.py"), marks=pytest.mark.slow, id="no fields"),
    ],
)
def test_a_folder_tests_itself(d: Definition, tmp_path: Path) -> None:
    place = folder(d, "feap", tmp_path)
    strict = {"CFLAGS": "-O1 -Wall -Wextra -Werror", "FFLAGS": STRICT}
    done = made(place, **strict)
    assert done.returncode == 0, done.stdout + done.stderr
    forces, matrix, state, differences, cut = errors(done.stdout)
    assert max(forces, matrix, state) < 1e-13
    assert differences < 1e-6
    assert cut == 0
    assert max(map(len, (place / "elmt01.f").read_text().splitlines())) <= 72


@needs_fortran
@pytest.mark.slow
def test_a_patch_with_plastic_flow_is_that_of_a_study(tmp_path: Path) -> None:
    d = definition(GALLERY / "j2.py")
    folder(d, "feap", tmp_path)
    patched(tmp_path, 0.05, p0=80.0, p1=170.0, p2=0.5, p3=10.0)
    done = made(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    result = study(d, 0.05, G=80.0, K=170.0, sy=0.5, H=10.0).solve(steps=4, newton=TIGHT)
    assert off(d, result, tmp_path) < 1e-12
    once = np.loadtxt(tmp_path / "solution.txt")
    subprocess.run([tmp_path / "host", "again"], cwd=tmp_path, check=True, capture_output=True)
    np.testing.assert_array_equal(np.loadtxt(tmp_path / "solution.txt"), once)


@needs_fortran
@pytest.mark.parametrize(
    ("name", "old", "new", "said"),
    [
        pytest.param(
            "random_line2_feap.c",
            "s[row + *nst * (*ndf * at_node[j] + freedom[j])]",
            "s[*nst * row + (*ndf * at_node[j] + freedom[j])]",
            "AMATRX",
            marks=pytest.mark.slow,
        ),
        ("elmt01.f", "hr(nh1),hr(nh2)", "hr(nh1),hr(nh1)", "the state before the step"),
        pytest.param("elmt01.f", "p(i) + weight", "p(i)", "isw = 8", marks=pytest.mark.slow),
    ],
)
def test_the_stand_in_sees_a_fault(
    name: str, old: str, new: str, said: str, tmp_path: Path
) -> None:
    folder(page("line2", A**2, A * B, conservative=False), "feap", tmp_path)
    text = (tmp_path / name).read_text()
    assert old in text
    (tmp_path / name).write_text(text.replace(old, new))
    done = made(tmp_path)
    assert done.returncode != 0
    assert any("FAILED" in line and said in line for line in done.stdout.splitlines())


@needs_fortran
@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("rvalu = 1", "rvalu = 0", "no value here: use AUTO,MATErial to cut the step"),
        ("ndf, mcrd, nst, 8)", "ndf, mcrd, nst, 5)", "has no mass: no MASS, no EIGEn"),
        ("record = props\n", "record = props(2:)\n", "needs 2 properties"),
    ],
)
def test_what_ends_the_program(old: str, new: str, said: str, tmp_path: Path) -> None:
    folder(page("line2", A**2, A * B, conservative=False), "feap", tmp_path)
    text = (tmp_path / "mock" / "element.f90").read_text()
    assert old in text
    (tmp_path / "mock" / "element.f90").write_text(text.replace(old, new))
    done = made(tmp_path)
    assert done.returncode != 0
    assert f"*ERROR* elmt01 {said}" in done.stdout


def test_what_is_refused() -> None:
    with pytest.raises(TargetError, match=r"unknowns of the element alone \(a\): target feap has"):
        host_files.files(bar(), "feap")
    with pytest.raises(TargetError, match="neo is a material: target feap takes elements"):
        host_files.files(neo, "feap")
    with pytest.raises(TargetError, match="spring has unknowns of the element alone"):
        host_files.files(named("spring", "k"), "feap")
