"""Materials with history and local unknowns: drivers of `abaqus` and `calculix`, and a study."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import softehl
from softehl.codegen.abi import TargetError
from softehl.codegen.hosts import patch_mesh
from softehl.codegen.hosts.element_interface import ElementInterface
from softehl.codegen.hosts.material_response import solid
from softehl.codegen.language.material import Law, Material
from softehl.codegen.tools import host_files, model_loader
from softehl.runtime.arrays import Array
from tests.codegen.hosts.materials import j2
from tests.codegen.hosts.workshop import errors, folder, made

ROOT = Path(__file__).parents[3]


def read(file: str) -> Law:
    """The material of a page of the documentation."""
    (law,) = model_loader.pages(ROOT / "docs" / file)
    assert isinstance(law, Law)
    return law


creeping = read("models/creep_law.py")
hencky_j2 = read("gallery/models/hencky_j2.py")
VALUES = {
    "j2": {"G": 80.0, "K": 170.0, "sy": 0.5, "H": 10.0},
    "hencky_j2": {"G": 80.0, "K": 170.0, "sy": 0.5, "H": 10.0},
    "creeping": {"mu": 0.4, "K": 2.0, "G": 0.6, "tau": 2.0},
}
PULL, INCREMENTS = 0.05, 4
needs_fortran = pytest.mark.skipif(shutil.which("gfortran") is None, reason="no gfortran")


def settled(law: Law, place: Path) -> None:
    """Give the patch the constants above."""
    lines = (place / "patch.txt").read_text().splitlines()
    nodes, _, cells = (int(v) for v in lines[0].split()[:3])
    lines[1 + nodes + cells] = " ".join(map(repr, VALUES[law.name].values()))
    (place / "patch.txt").write_text("\n".join(lines) + "\n")


def by_study(law: Law) -> Array:
    """The same patch in increments of one second, node by node."""
    d = solid(law)
    kind = ElementInterface.of(d, "abaqus").cell
    assert kind is not None
    mesh = patch_mesh.patch(kind)
    study = softehl.Study(softehl.Mesh(np.array(mesh.points), {kind.name: np.array(mesh.cells)}))
    study.add("body", d, **VALUES[law.name])  # type: ignore[arg-type]
    study.fix(np.array(mesh.left), u_x=0, u_y=0, u_z=0)
    study.fix(np.array(mesh.right), u_x=lambda x, t: PULL * t / INCREMENTS, u_y=0, u_z=0)
    tight = softehl.Newton(tolerance=1e-12)
    *_, last = study.march(dt=1, until=INCREMENTS, newton=tight)
    return np.stack([last.values(n) for n in ("u_x", "u_y", "u_z")], 1).ravel()


@needs_fortran
@pytest.mark.parametrize(
    ("law", "host"),
    [
        (j2, "abaqus"),
        (creeping, "calculix"),
        pytest.param(j2, "calculix", marks=pytest.mark.slow),
        pytest.param(hencky_j2, "abaqus", marks=pytest.mark.slow),
        pytest.param(hencky_j2, "calculix", marks=pytest.mark.slow),
        pytest.param(creeping, "abaqus", marks=pytest.mark.slow),
    ],
    ids=lambda v: v if isinstance(v, str) else v.name,
)
def test_history_is_committed_and_rolled_back(law: Law, host: str, tmp_path: Path) -> None:
    """The driver's solution is that of a study, also where each increment is tried in vain."""
    settled(law, folder(law, host, tmp_path))
    done = made(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    rhs, matrix, state, differences, cut = errors(done.stdout)
    assert max(rhs, matrix, state) < 1e-13
    assert differences < 1e-8
    assert cut == 0
    assert "the patch is solved" in done.stdout
    assert " 7 iterations" not in done.stdout
    once, expected = np.loadtxt(tmp_path / "solution.txt"), by_study(law)
    assert np.abs(once[: len(expected)] - expected).max() < 1e-12 * np.abs(expected).max()
    assert np.abs(once[len(expected) :]).max() > 1e-3
    subprocess.run([tmp_path / "host", "again"], cwd=tmp_path, check=True, capture_output=True)
    np.testing.assert_array_equal(np.loadtxt(tmp_path / "solution.txt"), once)


@needs_fortran
@pytest.mark.parametrize(
    ("host", "name", "old", "new"),
    [
        ("calculix", "calculix.c", "after[0] = fields[", "after[1] = fields["),
        ("calculix", "calculix.c", "p[4] = *dtime", "p[4] = 2 * *dtime"),
        ("calculix", "calculix.c", "*mi * (*iel - 1)", "*iel - 1"),
    ],
)
def test_the_driver_sees_a_fault(host: str, name: str, old: str, new: str, tmp_path: Path) -> None:
    text = (folder(creeping, host, tmp_path) / name).read_text()
    assert old in text
    (tmp_path / name).write_text(text.replace(old, new))
    done = made(tmp_path)
    assert done.returncode != 0
    assert "FAILED" in done.stdout


@softehl.material
def sliding(m: Material) -> None:
    """A stress whose modulus is not symmetric."""
    (k,) = m.parameters(k="stiffness [MPa]")
    m.stress(k * m.strain + k * m.strain[0, 0] * m.strain)


def test_calculix_refuses_a_modulus_that_is_not_symmetric() -> None:
    with pytest.raises(TargetError, match="the modulus of sliding is not symmetric at a random"):
        host_files.files(sliding, "calculix")
