"""Materials for `abaqus` and `calculix`: closed forms, and a cell that calls them."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import given

import softehl
from softehl.codegen.abi import TargetError
from softehl.codegen.elements import quadrature
from softehl.codegen.graph.evaluation import EvaluationState, Walk
from softehl.codegen.hosts.material_response import (
    VOIGT,
    MaterialResponse,
    Measure,
    response,
    solid,
)
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.material import Law, Material
from softehl.codegen.language.model import Model
from softehl.codegen.tools import cli, host_files
from softehl.codegen.tools.model_loader import definitions
from softehl.codegen.tools.model_text import ModelFileError
from softehl.runtime.arrays import Array
from tests.codegen.hosts.materials import fluid, hencky, hooke, neo, ogden_1, turned
from tests.codegen.hosts.random_pages import FEW, laws
from tests.codegen.hosts.workshop import errors, folder, made

MU, BULK = 0.4, 1.7
F = np.array([[1.1, 0.2, -0.1], [0.05, 0.9, 0.15], [-0.2, 0.1, 1.3]])
needs_fortran = pytest.mark.skipif(shutil.which("gfortran") is None, reason="no gfortran")


def values(r: MaterialResponse, parameters: list[float]) -> tuple[float, Array, Array]:
    """Energy, stress and modulus at F."""
    with mpmath.workdps(30):
        walk = Walk(EvaluationState((), F.ravel().tolist(), (), parameters), {})
        found = [float(walk.value(n)) for _, n in r.definition.fields]
    moduli = [[found[r.modulus(i, j)] for j in range(6)] for i in range(6)]
    return found[0], np.array(found[1:7]), np.array(moduli)


def voigt(C: Array) -> Array:
    """Rows and columns of a tensor (3, 3, 3, 3) with both minor symmetries."""
    return np.array([[C[i, j, k, m] for k, m in VOIGT] for i, j in VOIGT])


def second() -> tuple[Array, Array]:
    """Second Piola-Kirchhoff stress of neo-Hooke and its derivative by the Green strain."""
    J, inverse = np.linalg.det(F), np.linalg.inv(F.T @ F)
    S = MU * (np.eye(3) - inverse) + BULK * J * (J - 1) * inverse
    swapped = np.einsum("ik,jl->ijkl", inverse, inverse)
    swapped = swapped + swapped.transpose(0, 1, 3, 2)
    outer = np.einsum("ij,kl->ijkl", inverse, inverse)
    return S, BULK * J * (2 * J - 1) * outer + (MU - BULK * J * (J - 1)) * swapped


def test_the_second_measure_is_the_closed_form() -> None:
    S, C = second()
    energy, stress, moduli = values(response(neo, Measure.SECOND), [MU, BULK])
    J = np.linalg.det(F)
    by_hand = MU / 2 * (np.trace(F.T @ F) - 3 - 2 * np.log(J)) + BULK / 2 * (J - 1) ** 2
    assert energy == pytest.approx(by_hand, rel=1e-14)
    np.testing.assert_allclose(stress, [S[p] for p in VOIGT], atol=1e-14)
    np.testing.assert_allclose(moduli, voigt(C), atol=1e-13)


def test_the_cauchy_measure_is_its_push_forward() -> None:
    """With the terms of Jaumann's rate of the Kirchhoff stress."""
    S, C = second()
    J, one = np.linalg.det(F), np.eye(3)
    tau = F @ S @ F.T
    pushed = np.einsum("iI,jJ,kK,lL,IJKL->ijkl", F, F, F, F, C)
    turning = np.einsum("ik,jl->ijkl", one, tau)
    for order in ((1, 0, 2, 3), (0, 1, 3, 2), (1, 0, 3, 2)):
        turning = turning + np.einsum("ik,jl->ijkl", one, tau).transpose(order)
    _, stress, moduli = values(response(neo, Measure.CAUCHY), [MU, BULK])
    np.testing.assert_allclose(stress, [tau[p] / J for p in VOIGT], atol=1e-14)
    np.testing.assert_allclose(moduli, voigt(pushed + turning / 2) / J, atol=1e-13)


@needs_fortran
@pytest.mark.parametrize(
    "law",
    [
        neo,
        pytest.param(ogden_1, marks=pytest.mark.slow),
        pytest.param(hencky, marks=pytest.mark.slow),
        fluid,
        hooke,
    ],
    ids=lambda law: law.name,
)
def test_a_cell_of_umat_is_the_page(law: Law, tmp_path: Path) -> None:
    folder(law, "abaqus", tmp_path)
    done = made(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    rhs, matrix, _, differences, cut = errors(done.stdout)
    assert max(rhs, matrix) < 1e-13
    assert differences < 1e-7
    assert cut == 0
    assert "the patch is solved" in done.stdout
    assert " 7 iterations" not in done.stdout


@needs_fortran
@pytest.mark.parametrize(
    "law",
    [neo, *(pytest.param(law, marks=pytest.mark.slow) for law in (hooke, hencky))],
    ids=lambda law: law.name,
)
def test_a_cell_of_calculix_is_the_page(law: Law, tmp_path: Path) -> None:
    folder(law, "calculix", tmp_path)
    done = made(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert max(errors(done.stdout)[:2]) < 1e-13
    assert "the patch is solved" in done.stdout


@needs_fortran
@pytest.mark.slow
@pytest.mark.parametrize("host", ["abaqus", "calculix"])
@FEW
@given(law=laws())
def test_random_laws(law: Law, host: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    place = folder(law, host, tmp_path_factory.mktemp(host))
    (place / "patch.txt").unlink()  # a random energy need not have a minimum
    rhs, matrix, state, differences, cut = errors(made(place).stdout)
    assert max(rhs, matrix, state) < 1e-13
    assert differences < 1e-5
    assert cut == 0


@pytest.mark.parametrize("law", [neo, fluid, hooke, hencky], ids=lambda law: law.name)
def test_a_law_in_c_has_stress_and_modulus(law: Law, tmp_path: Path) -> None:
    done = made(folder(law, "c", tmp_path))
    assert done.returncode == 0, done.stdout + done.stderr
    assert max(errors(done.stdout)[:3]) < 1e-13
    assert "tangent by differences of residual" in done.stdout


@needs_fortran
@pytest.mark.parametrize(
    ("host", "name", "old", "new"),
    [
        ("abaqus", "umat.c", "fields[modulus[i][j]]", "1.0001 * fields[modulus[i][j]]"),
        ("abaqus", "umat.c", "dfgrd1[i + 3 * j]", "dfgrd1[3 * i + j]"),
        ("calculix", "calculix.c", "u[2] = 2.0 *", "u[2] = 1.0 *"),
    ],
)
def test_the_cell_sees_a_fault(host: str, name: str, old: str, new: str, tmp_path: Path) -> None:
    folder(neo, host, tmp_path)
    text = (tmp_path / name).read_text()
    assert old in text
    (tmp_path / name).write_text(text.replace(old, new))
    done = made(tmp_path)
    assert done.returncode != 0
    assert "FAILED" in done.stdout


# -------------------------------------------------------------------------------- what is refused


def test_an_energy_that_changes_with_a_rotation_is_refused() -> None:
    with pytest.raises(TargetError, match="turned is not symmetric: its energy must not change"):
        host_files.files(turned, "abaqus")


@softehl.material
def prony(m: Material) -> None:
    """History of each term of an array."""
    K, dt = m.parameters(K="bulk modulus [MPa]", dt="step [s]")
    g = m.array("g", "moduli")
    h = m.point_array("h", g, "their history")
    J = m.define("J", m.F.det())
    m.energy(m.sum(g, h, lambda g, h: (g + h) * (J - 1) ** 2) + K * (J - 1) ** 2)
    m.history(h=m.each(g, h, lambda g, h: (g + h) / (1 + dt)))


@softehl.material
def addressed(m: Material) -> None:
    """A C function that is known at run time only."""
    (K,) = m.parameters(K="bulk modulus [MPa]")
    m.energy(m.external("law", [m.F.det(), K], derivatives=2))


@pytest.mark.parametrize(
    ("law", "host", "message"),
    [
        (prony, "c", "prony has history of each term, h: target c has no place"),
        (prony, "ansys", "prony reads g at run time, which target ansys does not hand over"),
        (addressed, "abaqus", "addressed gets the address of law when it is called: target abaqus"),
    ],
)
def test_what_is_known_at_run_time_only_is_refused(law: Law, host: str, message: str) -> None:
    with pytest.raises(TargetError, match=message):
        host_files.files(law, host)


def test_calculix_needs_an_energy() -> None:
    with pytest.raises(TargetError, match="the modulus of fluid is not symmetric at a random"):
        host_files.files(fluid, "calculix")


def test_a_file_of_materials(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = tmp_path / "laws.py", tmp_path / "out"
    path.write_text("from tests.codegen.hosts.materials import fluid, hooke\n")
    with pytest.raises(ModelFileError, match="materials only, which have no kernel of their own"):
        definitions(path)
    assert cli.generate([path], target="calculix", out=out) == 2
    assert [p.name for p in out.iterdir()] == ["hooke"]
    assert "the modulus of fluid is not symmetric" in capsys.readouterr().err
    assert "*MATERIAL, NAME=@HOOKE_HOOKE\n" in (out / "hooke" / "hooke.inp").read_text()


def on_a_page(function: object) -> Material:
    m = Model("page", nodes=1, rule=quadrature.point_rule())
    return softehl.material(function).on(m, sp.eye(3))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (lambda m: m.energy(m.F[0, 0] + m.strain[0, 0]), r"uses m\.F and m\.strain: use one"),
        (lambda m: m.F, r"has neither m\.energy\(W\) nor m\.stress\(P\)"),
        (lambda m: m.energy(1), r"uses neither m\.F nor m\.strain"),
        (lambda m: [m.energy(m.F[0, 0]), m.stress(m.F)], "has an energy: it cannot have a stress"),
        (lambda m: m.stress(m.F[:, 0]), r"the stress has shape \(3, 1\), must be \(3, 3\)"),
    ],
)
def test_what_a_law_must_say(write: object, message: str) -> None:
    def law(m: Material) -> None:
        write(m)  # type: ignore[operator]

    with pytest.raises(ModelError, match=message):
        on_a_page(law)


@pytest.fixture(scope="module")
def umat(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """UMAT of neo as a library; what would end the analysis is counted."""
    place = folder(neo, "abaqus", tmp_path_factory.mktemp("umat"))
    (place / "end.c").write_text("int ended; void xit_(void) { ++ended; }\n")
    files = ["umat.c", "neo.c", "end.c", "-lm", "-o", "umat.so"]
    subprocess.run(["cc", "-w", "-shared", "-fPIC", "-O1", *files], cwd=place, check=True)
    return ctypes.CDLL(str(place / "umat.so"))


def asked(library: ctypes.CDLL, F: Array, direct: int, shears: int) -> tuple[Array, Array, float]:
    """Stress, DDSDDE and PNEWDT for so many components."""
    count = direct + shears
    stress, moduli, cut = np.full(count, 7.0), np.full((count, count), 7.0), np.array([1.0])
    one, zeros, p = np.array([1.0]), np.zeros(9), np.array([MU, BULK])
    sizes = [ctypes.byref(ctypes.c_int(v)) for v in (direct, shears, count, 0)]
    arrays = [stress, zeros, moduli, *(zeros.copy() for _ in range(15))]
    pointers: list[object] = [a.ctypes.data_as(ctypes.c_void_p) for a in arrays]
    F = np.asfortranarray(F)
    after = [zeros, np.eye(3), cut, one, np.eye(3), F]
    pointers += [b"NEO" + b" " * 77, *sizes, p.ctypes.data_as(ctypes.c_void_p)]
    pointers += [ctypes.byref(ctypes.c_int(2)), *(a.ctypes.data_as(ctypes.c_void_p) for a in after)]
    pointers += [ctypes.byref(ctypes.c_int(1)) for _ in range(6)]
    library.umat_(*pointers, ctypes.c_size_t(80))
    return stress, moduli.T, float(cut[0])


def test_plane_strain_has_the_first_components(umat: ctypes.CDLL) -> None:
    plane = np.array([[1.1, 0.2, 0], [-0.1, 0.9, 0], [0, 0, 1]])
    stress, moduli, cut = asked(umat, plane, 3, 3)
    less, fewer, _ = asked(umat, plane, 3, 1)
    np.testing.assert_array_equal(less, stress[:4])
    np.testing.assert_array_equal(fewer, moduli[:4, :4])
    assert cut == 1.0
    assert stress[3] != 0.0


def test_no_deformation_and_plane_stress_are_told(umat: ctypes.CDLL) -> None:
    stress, moduli, cut = asked(umat, np.diag([1.0, 1.0, -1.0]), 3, 3)
    assert cut == 0.25
    assert (stress == 7.0).all()
    np.testing.assert_array_equal(moduli, np.eye(6))
    before = ctypes.c_int.in_dll(umat, "ended").value
    asked(umat, np.eye(3), 2, 1)
    assert ctypes.c_int.in_dll(umat, "ended").value == before + 1


def test_a_law_in_a_page_of_a_study() -> None:
    """Uniaxial strain: P = mu (l - 1 / l) + K (l - 1)."""
    study = softehl.Study(softehl.Mesh.box((1, 1, 1), cells=(1, 1, 1), shape="tetrahedron"))
    study.add("body", solid(neo), mu=MU, K=BULK)
    study.fix("left", u_x=0)
    study.fix("right", u_x=0.3)
    study.fix(np.arange(8), u_y=0, u_z=0)
    pull = study.solve().reaction("right")["u_x"]
    assert pull == pytest.approx(MU * (1.3 - 1 / 1.3) + BULK * 0.3, rel=1e-12)
