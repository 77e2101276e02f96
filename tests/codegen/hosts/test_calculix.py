"""CalculiX itself, where SOFTEHL_CCX names one with external behaviours (`make hosts`)."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

import softehl
from softehl.codegen.elements import cells
from softehl.codegen.hosts import calculix, patch_mesh
from softehl.codegen.hosts.material_common import PULL, TWIST
from softehl.codegen.hosts.material_response import Measure, response, solid
from softehl.codegen.language.material import Material
from softehl.runtime.arrays import Array
from tests.codegen.hosts.test_material_history import creeping
from tests.codegen.hosts.workshop import folder, made

CCX = os.environ.get("SOFTEHL_CCX", "")


@softehl.material
def rubber(m: Material) -> None:
    """The neo-Hooke of CalculiX."""
    C10, D1 = m.parameters(C10="half the shear modulus [MPa]", D1="2 / bulk modulus [1/MPa]")
    J = m.define("J", m.F.det())
    m.energy(C10 * (J ** sp.Rational(-2, 3) * (m.F.T * m.F).trace() - 3) + (J - 1) ** 2 / D1)


def run(place: Path, name: str, deck: str) -> tuple[Array, list[int]]:
    """Numbers of the last displacements and stresses, and iterations of each increment."""
    (place / f"{name}.inp").write_text(deck)
    given = {**os.environ, "LD_LIBRARY_PATH": ".", "OMP_NUM_THREADS": "1"}
    subprocess.run([CCX, name], cwd=place, env=given, check=True, capture_output=True)
    last = (place / f"{name}.dat").read_text().rpartition("displacements")[2]
    rows = [line.split() for line in last.splitlines() if re.fullmatch(r"[\s\d.eE+-]+", line)]
    numbers = [float(v) for row in rows for v in row[-6:] if "E" in v]
    steps = (place / f"{name}.sta").read_text().splitlines()[2:]
    return np.array(numbers), [int(line.split()[3]) for line in steps]


@pytest.mark.slow
@pytest.mark.skipif(not CCX, reason="SOFTEHL_CCX names no CalculiX with external behaviours")
def test_a_twisted_block_is_that_of_its_own_law(tmp_path: Path) -> None:
    place = folder(rubber, "calculix", tmp_path)
    assert made(place, "libRUBBER.so").returncode == 0
    ours = calculix.deck(response(rubber, Measure.SECOND), [0.5, 2.0], 8)
    own = re.sub(r"\*USER MATERIAL.*\n", "*HYPERELASTIC, NEO HOOKE\n", ours)
    own = own.replace("@RUBBER_RUBBER", "OWN")
    found, iterations = run(place, "ours", ours)
    expected, own_iterations = run(place, "own", own)
    assert len(expected) == 3 * 9**3 + 6 * 8 * 8**3
    assert np.abs(found - expected).max() <= 1e-6 * np.abs(expected).max()
    assert sum(iterations) <= sum(own_iterations)


@pytest.mark.slow
@pytest.mark.skipif(not CCX, reason="SOFTEHL_CCX names no CalculiX with external behaviours")
def test_history_in_calculix_is_that_of_a_study(tmp_path: Path) -> None:
    """A block that creeps while it is stretched and twisted, in four increments."""
    values = {"mu": 0.4, "K": 2.0, "G": 0.6, "tau": 2.0}
    place = folder(creeping, "calculix", tmp_path)
    assert made(place, "libCREEPING.so").returncode == 0
    text = calculix.deck(response(creeping, Measure.SECOND), list(values.values()))
    direct = text.replace("*STATIC\n0.25", "*STATIC, DIRECT\n0.25")
    found, iterations = run(place, "creeping", direct)
    assert len(iterations) == 4
    d = solid(creeping, "hex8")
    mesh = patch_mesh.patch(cells.element("hex8"), 2)
    points = np.array(mesh.points)
    study = softehl.Study(softehl.Mesh(points, {"hex8": np.array(mesh.cells)}))
    study.add("body", d, **values)  # type: ignore[arg-type]
    study.fix(np.array(mesh.left), u_x=0, u_y=0, u_z=0)
    right = np.array(mesh.right)
    y, z = points[right, 1] - 1.5, points[right, 2] - 1.5
    study.fix(right, u_x=lambda x, t: PULL * t)
    study.fix(right, u_y=lambda x, t: -TWIST * z * t, u_z=lambda x, t: TWIST * y * t)
    *_, last = study.march(dt=0.25, until=1)
    expected = np.stack([last.values(n) for n in ("u_x", "u_y", "u_z")], 1).ravel()
    assert np.abs(found[: len(expected)] - expected).max() <= 2e-6 * np.abs(expected).max()
