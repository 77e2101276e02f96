"""Target `ngsolve`: what it takes, and the test of its folder where NGSolve is installed."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given

from softehl.codegen.abi import TargetError
from softehl.codegen.elements.cells import element
from softehl.codegen.language import kinematics
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model
from softehl.codegen.tools import host_files, model_loader
from tests.codegen.hosts.random_pages import FEW, A, B, page, pages
from tests.codegen.hosts.workshop import errors, folder, made, off_python

ROOT = Path(__file__).parents[3]
PYTHON = os.environ.get("SOFTEHL_NGSOLVE", sys.executable)
"""A Python that has NGSolve; its ngscxx must be on the PATH."""


def has_ngsolve() -> bool:
    if shutil.which("ngscxx") is None:
        return False
    found = subprocess.run([PYTHON, "-c", "import ngsolve"], capture_output=True, check=False)
    return found.returncode == 0


def field(cell: str) -> Definition:
    """A scalar and its values at the corners, in any cell."""
    kind = element(cell)
    corner = {"tri6": "tri3", "quad8": "quad4"}[cell]
    m = Model(f"field_{cell}", nodes=len(kind.nodes), rule=kind.rule)
    X, (u,) = m.coordinates("X", "Y"), m.nodal_unknowns("u")
    (p,) = m.nodal_unknowns("p", nodes=len(element(corner).nodes))
    (k,), (c,) = m.parameters(k="stiffness"), m.data(c="a datum")
    e = kinematics.isoparametric(m, X, kind.gradient(*m.point()))
    slope = [m.define(f"g{i}", sum(d[i] * v for d, v in zip(e.dN, u, strict=True))) for i in (0, 1)]
    low = sum(N * v for N, v in zip(element(corner).shape(*m.point()), p, strict=True))
    m.potential(m.integral("Pi", (k * (slope[0] ** 4 + slope[1] ** 2) + c * low**2) * e.detJ))
    m.weak_form([(slope[0] * low * e.detJ, low)])
    return m.finish()


@pytest.mark.slow
@pytest.mark.skipif(not has_ngsolve(), reason="no NGSolve, or no ngscxx on the PATH")
def test_a_form_is_that_of_the_page(tmp_path: Path) -> None:
    """Quadratic triangles: the functions of NGSolve are other ones, the work is the same."""
    done = made(folder(field("tri6"), "ngsolve", tmp_path), PYTHON=PYTHON)
    assert done.returncode == 0, done.stdout + done.stderr
    found = errors(done.stdout)
    assert len(found) == 6
    assert max(found) < 1e-13


@pytest.mark.slow
@FEW
@given(d=pages(cells=("line2", "tri3", "tri6"), memory=False))
def test_random_pages(d: Definition, tmp_path_factory: pytest.TempPathFactory) -> None:
    """The kernel of a folder is that of Python; NGSolve's forms are those of the kernel."""
    place = folder(d, "ngsolve", tmp_path_factory.mktemp("ngsolve"))
    assert made(place, f"lib{d.name}.so").returncode == 0
    assert off_python(d, place) < 1e-13
    if has_ngsolve():
        done = made(place, PYTHON=PYTHON)
        assert done.returncode == 0, done.stdout + done.stderr
        assert max(errors(done.stdout)) < 1e-13


def test_the_space_has_a_function_for_each_name() -> None:
    (d,) = model_loader.definitions(ROOT / "docs" / "models" / "neo_hooke.py")
    assert "space = ng.VectorH1(mesh, order=1)\n" in host_files.files(d, "ngsolve")["NOTES.md"]
    notes = host_files.files(field("tri6"), "ngsolve")["NOTES.md"]
    assert "space = ng.H1(mesh, order=2) * ng.H1(mesh, order=1)\n" in notes
    assert "ng.BilinearForm(space)\n" in notes


def test_what_ngsolve_cannot_hold_is_refused() -> None:
    with pytest.raises(TargetError, match="field_quad8 has 8 nodes in 2 coordinates: target ngs"):
        host_files.files(field("quad8"), "ngsolve")
    with pytest.raises(TargetError, match="random_tri3 has data of points, which target ngsolve"):
        host_files.files(page("tri3", A**2, A * B, conservative=True), "ngsolve")
    (heat,) = model_loader.definitions(ROOT / "docs" / "models" / "heat.py")
    with pytest.raises(TargetError, match="heat has values of a step in time, which target ngs"):
        host_files.files(heat, "ngsolve")
