"""Target `abaqus` of an element: its host in Fortran, and the same patch by a study."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given

import softehl
from softehl.codegen.abi import TargetError
from softehl.codegen.elements import quadrature
from softehl.codegen.hosts import patch_mesh
from softehl.codegen.hosts.element_interface import ElementInterface
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.model import Model
from softehl.codegen.models import ALL
from softehl.codegen.tools import host_files, model_loader
from tests.codegen.hosts.random_pages import FEW, A, B, page, pages
from tests.codegen.hosts.workshop import errors, folder, made

ROOT = Path(__file__).parents[3]
MODELS, GALLERY = ROOT / "docs" / "models", ROOT / "docs" / "gallery" / "models"
TIGHT = softehl.Newton(tolerance=1e-12)
needs_fortran = pytest.mark.skipif(shutil.which("gfortran") is None, reason="no gfortran")


def definition(path: Path) -> Definition:
    (found,) = model_loader.definitions(path)
    return found


def patched(place: Path, pull: float, increments: int = 4, **properties: float) -> None:
    """Pull the patch further, and give some properties by their place."""
    lines = (place / "patch.txt").read_text().splitlines()
    lines[0] = " ".join([*lines[0].split()[:-2], str(increments), lines[0].split()[-1]])
    nodes, _, cells = (int(v) for v in lines[0].split()[:3])
    words = lines[1 + nodes + cells].split()
    for k, value in properties.items():
        words[int(k[1:])] = repr(value)
    lines[1 + nodes + cells] = " ".join(words)
    for n, line in enumerate(lines):
        equation, *rest = line.split()
        if n > nodes + cells + 3 and rest == [repr(patch_mesh.PULL)]:
            lines[n] = f"{equation} {pull!r}"
    (place / "patch.txt").write_text("\n".join(lines) + "\n")


def study(d: Definition, pull: float, **settings: Any) -> softehl.Study:
    """The same patch."""
    kind = ElementInterface.of(d, "abaqus").cell
    assert kind is not None
    mesh = patch_mesh.patch(kind)
    cells = {kind.name: np.array(mesh.cells)}
    problem = softehl.Study(softehl.Mesh(np.array(mesh.points), cells))
    problem.add("body", d, **settings)
    problem.fix(np.array(mesh.left), u_x=0, u_y=0)
    problem.fix(np.array(mesh.right), u_x=lambda x, t: np.full(len(x), pull * t), u_y=0)
    return problem


def off(d: Definition, result: softehl.Result, place: Path) -> float:
    """Largest difference between the solutions, by the largest value."""
    seen = ElementInterface.of(d, "abaqus")
    assert seen.cell is not None
    number = patch_mesh.numbers(seen, patch_mesh.patch(seen.cell))
    found = np.loadtxt(place / "solution.txt")[: len(number)]
    values = [result.values(f.name) for f in seen.nodal]
    expected = np.array([values[k][node] for node, k in number])
    return float(np.abs(found - expected).max() / np.abs(expected).max())


@needs_fortran
def test_a_large_compression_is_cut_and_ends_as_a_study_does(tmp_path: Path) -> None:
    """Increments that turn a cell inside out have no stress: they are cut."""
    d = definition(MODELS / "neo_hooke.py")
    folder(d, "abaqus", tmp_path)
    patched(tmp_path, -0.9, increments=1, p0=0.4, p1=1.2)
    done = made(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert max(errors(done.stdout)[:3]) < 1e-13
    assert "increment cut" in done.stdout
    assert "the patch is solved" in done.stdout
    assert off(d, study(d, -0.9, mu=0.4, lame=1.2).solve(steps=6, newton=TIGHT), tmp_path) < 1e-12


@needs_fortran
def test_history_is_committed_and_rolled_back(tmp_path: Path) -> None:
    """Plastic flow: equal to a study's, also where each increment is tried in vain before."""
    d = definition(GALLERY / "j2.py")
    folder(d, "abaqus", tmp_path)
    patched(tmp_path, 0.05, p0=80.0, p1=170.0, p2=0.5, p3=10.0)
    done = made(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert max(errors(done.stdout)[:3]) < 1e-13
    assert "the patch is solved" in done.stdout
    once = np.loadtxt(tmp_path / "solution.txt")
    result = study(d, 0.05, G=80.0, K=170.0, sy=0.5, H=10.0).solve(steps=4, newton=TIGHT)
    assert off(d, result, tmp_path) < 1e-12
    assert once[-1] != 0.0
    subprocess.run([tmp_path / "host", "again"], cwd=tmp_path, check=True, capture_output=True)
    np.testing.assert_array_equal(np.loadtxt(tmp_path / "solution.txt"), once)


@needs_fortran
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("amatrx[i + UNKNOWNS * j]", "amatrx[j + UNKNOWNS * i]"),
        ("*pnewdt = 0.25;", "*pnewdt = 1.0;"),
        ("data[1] = U[0] - du[0]", "data[1] = U[0]"),
    ],
)
def test_the_host_sees_a_fault(old: str, new: str, tmp_path: Path) -> None:
    folder(page("line2", A**2, A * B, conservative=False), "abaqus", tmp_path)
    text = (tmp_path / "uel.c").read_text()
    assert old in text
    (tmp_path / "uel.c").write_text(text.replace(old, new))
    done = made(tmp_path)
    assert done.returncode != 0
    assert "FAILED" in done.stdout


@needs_fortran
@FEW
@given(d=pages())
def test_random_pages(d: Definition, tmp_path_factory: pytest.TempPathFactory) -> None:
    place = folder(d, "abaqus", tmp_path_factory.mktemp("uel"))
    (place / "patch.txt").unlink()  # a random energy need not have a minimum
    done = made(place)
    rhs, matrix, state, differences, cut = errors(done.stdout)
    assert max(rhs, matrix, state) < 1e-13
    assert differences < 1e-5
    assert cut == 0


@needs_fortran
@pytest.mark.parametrize(
    ("d", "said"),
    [
        (definition(MODELS / "spring.py"), "not-a-number cuts the increment      0.0E+00  ok"),
        (ALL["axial_spring"](), "left out: the patch has no solution"),
    ],
    ids=["a branch without a value", "nothing across"],
)
def test_pages_that_hold_little(d: Definition, said: str, tmp_path: Path) -> None:
    done = made(folder(d, "abaqus", tmp_path))
    assert done.returncode == 0, done.stdout
    assert said in done.stdout


def test_an_unknown_of_the_element_is_refused() -> None:
    m = Model("enhanced", nodes=2, rule=quadrature.gauss(1, 1))
    (X,), (u,) = m.coordinates("X"), m.nodal_unknowns("u")
    a = m.unknown("a")
    m.potential((u[1] - u[0] + a) ** 2 / (X[1] - X[0]) + a**2)
    with pytest.raises(TargetError, match=r"unknowns of the element alone \(a\): target abaqus"):
        host_files.files(m.finish(), "abaqus")


@needs_fortran
def test_a_property_that_the_page_does_not_allow_ends_the_analysis(tmp_path: Path) -> None:
    m = Model("link", nodes=2, rule=quadrature.gauss(1, 1))
    (X,), (u,) = m.coordinates("X"), m.nodal_unknowns("u")
    (k,) = m.parameters(k="stiffness [N]")
    m.require(k > 0)
    m.potential(k * (u[1] - u[0]) ** 2 / (X[1] - X[0]))
    folder(m.finish(), "abaqus", tmp_path)
    assert made(tmp_path).returncode == 0
    patched(tmp_path, 0.05, p0=-1.0)
    done = subprocess.run([tmp_path / "host"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 2
    assert "link, element 1: k > 0 is required" in done.stderr


def test_the_deck_has_what_the_page_needs() -> None:
    deck = host_files.files(page("tri6", A**2, A**3, conservative=False), "abaqus")[
        "random_tri6.inp"
    ]
    assert "TYPE=U1, NODES=6, COORDINATES=2, PROPERTIES=2, VARIABLES=9, UNSYMM\n" in deck
    assert "UNSYMM\n11, 12\n4, 11\n*ELEMENT" in deck
    assert "*HEAT TRANSFER" in deck
