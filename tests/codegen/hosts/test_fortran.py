"""Target `fortran`: the module's own test, a patch with history, faults, refused names."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from softehl.codegen.abi import TargetError
from softehl.codegen.elements import quadrature
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.material import Law
from softehl.codegen.language.model import Model
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
from tests.codegen.hosts.workshop import errors, folder, made

needs_fortran = pytest.mark.skipif(shutil.which("gfortran") is None, reason="no gfortran")
STRICT = "-O1 -fcheck=all -std=f2018 -Wall -Wno-unused-dummy-argument -Werror"


def bar() -> Definition:
    """A bar with an unknown of its own, a product, and derivatives of the residual."""
    m = Model("bar", nodes=2, rule=quadrature.gauss(1, 1))
    (X,), (u,) = m.coordinates("X"), m.nodal_unknowns("u")
    (k,) = m.parameters(k="stiffness [N]")
    a = m.unknown("a")
    m.potential(k * (u[1] - u[0] + a) ** 2 / (X[1] - X[0]) + a**2 + sp.exp(a * u[0]))
    m.offer(product=True, derivatives=[k, X[1]])
    return m.finish()


def branches() -> Definition:
    """Springs in parallel, as many as their stiffnesses, and a curve."""
    m = Model("branches", nodes=2, rule=quadrature.gauss(1, 1))
    (X,), (u,) = m.coordinates("X"), m.nodal_unknowns("u")
    (c,) = m.parameters(c="factor")
    e = m.define("e", (u[1] - u[0]) / (X[1] - X[0]))
    k = m.array("k", "stiffness [N]")
    m.potential(c * m.sum(k, lambda each: each * e**2) + m.table("w", e))
    return m.finish()


@needs_fortran
@pytest.mark.parametrize(
    ("page_or_law", "checks"),
    [
        pytest.param(fluid, 4, marks=pytest.mark.slow, id="a modulus that is not symmetric"),
        pytest.param(j2, 6, id="branches, history"),
        pytest.param(definition(MODELS / "heat.py"), 7, marks=pytest.mark.slow, id="rates"),
        pytest.param(bar(), 7, id="bar"),
        pytest.param(branches(), 7, marks=pytest.mark.slow, id="arrays of run time"),
        pytest.param(page("tri6", A**2, A * B, conservative=False), 10, id="tri6"),
    ],
)
def test_a_folder_tests_itself(page_or_law: Definition | Law, checks: int, tmp_path: Path) -> None:
    done = made(folder(page_or_law, "fortran", tmp_path), FFLAGS=STRICT)
    assert done.returncode == 0, done.stdout + done.stderr
    found = errors(done.stdout)
    assert len(found) >= checks
    assert max(e for e in found if e < 1e-13 or e > 1e-6) < 1e-13
    assert max(found) < 1e-6


@needs_fortran
@pytest.mark.slow
def test_a_patch_with_plastic_flow_is_that_of_a_study(tmp_path: Path) -> None:
    """History is committed, and rolled back where each increment is tried in vain before."""
    d = definition(GALLERY / "j2.py")
    folder(d, "fortran", tmp_path)
    patched(tmp_path, 0.05, p0=80.0, p1=170.0, p2=0.5, p3=10.0)
    done = made(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "the patch is solved" in done.stdout
    result = study(d, 0.05, G=80.0, K=170.0, sy=0.5, H=10.0).solve(steps=4, newton=TIGHT)
    assert off(d, result, tmp_path) < 1e-12
    once = np.loadtxt(tmp_path / "solution.txt")
    subprocess.run([tmp_path / "host", "again"], cwd=tmp_path, check=True, capture_output=True)
    np.testing.assert_array_equal(np.loadtxt(tmp_path / "solution.txt"), once)


@needs_fortran
@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("random_line2.f90", "transpose(tangent(:, :, e))", "tangent(:, :, e)"),
        pytest.param(
            "random_line2.c",
            "state[0] = fields[1]",
            "state[0] = fields[0]",
            marks=pytest.mark.slow,
        ),
        pytest.param("element.f90", "pnewdt = 0.25d0", "pnewdt = 1", marks=pytest.mark.slow),
    ],
)
def test_the_test_of_a_folder_sees_a_fault(name: str, old: str, new: str, tmp_path: Path) -> None:
    folder(page("line2", A**2, A * B, conservative=False), "fortran", tmp_path)
    text = (tmp_path / name).read_text()
    assert old in text
    (tmp_path / name).write_text(text.replace(old, new))
    done = made(tmp_path)
    assert done.returncode != 0
    assert "FAILED" in done.stdout


@needs_fortran
def test_a_wrong_shape_ends_the_program(tmp_path: Path) -> None:
    folder(bar(), "fortran", tmp_path)
    text = (tmp_path / "example.f90").read_text()
    assert "real(real8) :: residual(3, 1)" in text
    (tmp_path / "example.f90").write_text(text.replace("residual(3, 1)", "residual(2, 1)"))
    assert made(tmp_path, "example").returncode == 0
    done = subprocess.run([tmp_path / "example"], capture_output=True, text=True)
    assert done.returncode != 0
    assert "bar_tangent: the shape of residual is 2, 1, must be 3, 1" in done.stderr


def named(name: str, *parameters: str) -> Definition:
    m = Model(name, nodes=1, rule=quadrature.point_rule())
    u, given = m.unknown("u"), m.parameters(**dict.fromkeys(parameters, "stiffness"))
    m.potential(sum(k * u**2 for k in given))
    m.offer(derivatives=given)
    return m.finish()


def test_names_that_fortran_does_not_have_are_refused() -> None:
    with pytest.raises(TargetError, match=r"spring offers d_K and d_k, which are one name in"):
        host_files.files(named("spring", "k", "K"), "fortran")
    with pytest.raises(TargetError, match=r"target fortran has no name a{60}_energy"):
        host_files.files(named("a" * 60, "k"), "fortran")
