"""Target `ansys`: a cell that calls USERMAT, the turned axes in closed form, history, faults."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from scipy.linalg import polar

from softehl.codegen.hosts.ansys import ORDER
from softehl.codegen.hosts.material_response import VOIGT, Measure, response
from softehl.codegen.language.material import Law
from softehl.runtime.arrays import Array
from tests.codegen.hosts.materials import fluid, hencky, hooke, j2, neo, ogden_1
from tests.codegen.hosts.random_pages import FEW, laws
from tests.codegen.hosts.test_material_history import by_study, creeping, settled
from tests.codegen.hosts.test_materials import BULK, MU, F, values
from tests.codegen.hosts.workshop import errors, folder, made

needs_fortran = pytest.mark.skipif(shutil.which("gfortran") is None, reason="no gfortran")
STRICT = "-O1 -Wall -Wextra -Werror -Wno-psabi"


@needs_fortran
@pytest.mark.parametrize(
    "law",
    [
        neo,
        pytest.param(fluid, marks=pytest.mark.slow),
        pytest.param(hooke, marks=pytest.mark.slow),
        pytest.param(ogden_1, marks=pytest.mark.slow),
        pytest.param(hencky, marks=pytest.mark.slow),
    ],
    ids=lambda law: law.name,
)
def test_a_cell_of_usermat_is_the_page(law: Law, tmp_path: Path) -> None:
    done = made(folder(law, "ansys", tmp_path), CFLAGS=STRICT)
    assert done.returncode == 0, done.stdout + done.stderr
    forces, matrix, _, differences, cut = errors(done.stdout)
    assert max(forces, matrix) < 1e-13
    assert differences < 1e-7
    assert cut == 0
    assert "the patch is solved" in done.stdout
    assert " 7 iterations" not in done.stdout


@needs_fortran
@pytest.mark.slow
@FEW
@given(law=laws())
def test_random_laws(law: Law, tmp_path_factory: pytest.TempPathFactory) -> None:
    place = folder(law, "ansys", tmp_path_factory.mktemp("ansys"))
    (place / "patch.txt").unlink()  # a random energy need not have a minimum
    forces, matrix, state, differences, cut = errors(made(place).stdout)
    assert max(forces, matrix, state) < 1e-13
    assert differences < 1e-5
    assert cut == 0


@needs_fortran
@pytest.mark.slow
@pytest.mark.parametrize("law", [j2, creeping], ids=lambda law: law.name)
def test_history_is_committed_and_rolled_back(law: Law, tmp_path: Path) -> None:
    settled(law, folder(law, "ansys", tmp_path))
    done = made(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert max(errors(done.stdout)[:3]) < 1e-13
    once, expected = np.loadtxt(tmp_path / "solution.txt"), by_study(law)
    assert np.abs(once[: len(expected)] - expected).max() < 1e-12 * np.abs(expected).max()
    assert np.abs(once[len(expected) :]).max() > 1e-3
    subprocess.run([tmp_path / "host", "again"], cwd=tmp_path, check=True, capture_output=True)
    np.testing.assert_array_equal(np.loadtxt(tmp_path / "solution.txt"), once)


@needs_fortran
@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("{1, 2, 3, 4, 6, 5}", "{1, 2, 3, 4, 5, 6}"),
        ("U[3 * i + j] = sum", "U[3 * i + j] = F[i + 3 * j]"),
        ("*cutFactor = 0.25", "*cutFactor = 0.5"),
    ],
)
def test_the_cell_sees_a_fault(old: str, new: str, tmp_path: Path) -> None:
    text = (folder(neo, "ansys", tmp_path) / "usermat.c").read_text()
    assert old in text
    (tmp_path / "usermat.c").write_text(text.replace(old, new))
    done = made(tmp_path)
    assert done.returncode != 0
    assert "FAILED" in done.stdout


@pytest.fixture(scope="module")
def usermat(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """USERMAT of neo as the library for ANSYS; the end of the program is counted."""
    place = folder(neo, "ansys", tmp_path_factory.mktemp("usermat"))
    text = (place / "usermat.c").read_text().replace("exit(2)", "++ended")
    (place / "usermat.c").write_text(text.replace("enum {", "int ended;\nenum {", 1))
    assert made(place, "usermatLib.so").returncode == 0
    return ctypes.CDLL(str(place / "usermatLib.so"))


def asked(
    library: ctypes.CDLL, F: Array, shears: int = 3, strained: float = 0.1
) -> tuple[Array, Array, tuple[int, float]]:
    """Stress, dsdePl, and (keycut, cutFactor)."""
    count = 3 + shears
    stress, moduli, cut = np.full(count, 7.0), np.full((count, count), 7.0), np.array([0.0])
    keycut = ctypes.c_int(7)
    number, array = ctypes.byref, np.ctypeslib.as_ctypes
    ones = [number(ctypes.c_int(1)) for _ in range(7)]
    sizes = [number(ctypes.c_int(v)) for v in (3, shears, count, 0, 2)]
    zeros = [array(np.zeros(9)) for _ in range(20)]
    strain = array(np.full(6, strained))
    library.usermat_(
        *ones,
        number(keycut),
        *sizes,
        *zeros[:4],
        *(stress.ctypes.data_as(ctypes.c_void_p), zeros[4]),
        *(moduli.ctypes.data_as(ctypes.c_void_p), *zeros[5:8]),
        *(array(np.zeros(6)), strain, zeros[8], array(np.array([MU, BULK]))),
        *(*zeros[9:11], array(np.eye(3).ravel()), array(F.T.ravel().copy())),
        *(*zeros[11:13], cut.ctypes.data_as(ctypes.c_void_p), *zeros[13:20]),
    )
    return stress, moduli.T, (keycut.value, float(cut[0]))


def test_stress_and_modulus_stand_in_the_turned_axes(usermat: ctypes.CDLL) -> None:
    """Those of space (whose closed form is tested for UMAT), turned by R of F = R U."""
    R, _ = polar(F)
    _, sigma, C = values(response(neo, Measure.CAUCHY), [MU, BULK])
    place = {pair: k for k, pair in enumerate(VOIGT)}
    at = np.array([[place[min(i, j), max(i, j)] for j in range(3)] for i in range(3)])
    tensor = R.T @ sigma[at] @ R
    moduli = np.einsum("ai,bj,ck,dl,abcd->ijkl", R, R, R, R, C[at][:, :, at])
    pairs = [VOIGT[k] for k in ORDER]
    stress, found, cut = asked(usermat, F)
    np.testing.assert_allclose(stress, [tensor[p] for p in pairs], atol=1e-14)
    expected = [[moduli[i, j, k, m] for k, m in pairs] for i, j in pairs]
    np.testing.assert_allclose(found, expected, atol=1e-13)
    assert cut == (0, 0.0)


def test_a_turn_alone_changes_nothing(usermat: ctypes.CDLL) -> None:
    R, U = polar(F)
    far = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    far *= np.linalg.det(far)
    for Q in (R.T, far, np.diag([-1.0, -1.0, 1.0])):
        np.testing.assert_allclose(asked(usermat, Q @ F)[0], asked(usermat, U)[0], atol=1e-13)
    wide = np.diag([1e4, 1e-3, 1.0])
    turned, straight = asked(usermat, far @ wide)[0], asked(usermat, wide)[0]
    np.testing.assert_allclose(turned, straight, rtol=1e-8, atol=1e-8)


def test_plane_strain_has_the_first_components(usermat: ctypes.CDLL) -> None:
    plane = np.array([[1.1, 0.2, 0], [-0.1, 0.9, 0], [0, 0, 1]])
    stress, moduli, _ = asked(usermat, plane)
    less, fewer, _ = asked(usermat, plane, shears=1)
    np.testing.assert_array_equal(less, stress[:4])
    np.testing.assert_array_equal(fewer, moduli[:4, :4])
    assert stress[3] != 0.0


def test_what_has_no_value_is_cut(usermat: ctypes.CDLL) -> None:
    for lost in (np.diag([1.0, 1.0, -1.0]), np.zeros((3, 3)), np.full((3, 3), np.nan)):
        stress, moduli, cut = asked(usermat, lost)
        assert cut == (1, 0.25)
        assert (stress == 7.0).all()
        np.testing.assert_array_equal(moduli, np.eye(6))


def test_large_strains_need_nlgeom(usermat: ctypes.CDLL) -> None:
    ended = ctypes.c_int.in_dll(usermat, "ended")
    before = ended.value
    asked(usermat, np.eye(3), strained=0.0)
    assert ended.value == before
    asked(usermat, np.eye(3), strained=0.1)
    assert ended.value == before + 1


@pytest.mark.slow
def test_the_deck_has_what_the_law_needs(tmp_path: Path) -> None:
    deck = (folder(j2, "ansys", tmp_path) / "j2.dat").read_text()
    assert "TB,USER,1,1,4\n! give your values: G, K, sy, H\nTBDATA,1,80.0,170.0,0.5,10.0" in deck
    assert "TB,STATE,1,,7\n" in deck
    assert "NLGEOM,OFF\nNROPT,UNSYM\n" in deck
