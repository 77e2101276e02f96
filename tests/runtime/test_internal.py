"""Internal unknowns of elements: against elements written out by hand, and what they are for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csc_array

from softehl import Mesh, Study, load_kernel
from softehl.runtime.arrays import Array
from softehl.runtime.results.result import Result
from softehl.runtime.solve.linear.linear_solver import SingularMatrix
from softehl.runtime.solve.linear.static_condensation import CondensingSolver
from softehl.runtime.solve.linear.superlu import SuperLU

MODELS = Path(__file__).parents[2] / "docs" / "models"
SHEAR, LAME, BULK = 1.0, 30.0, 200.0
CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
PLACES = np.array([[0.0, 0.0], [2.0, 0.1], [1.8, 1.2], [-0.1, 0.9]])


def stress(F: Array) -> tuple[Array, Array]:
    """P (4,) and dP/dF (4, 4) of neo-Hooke in plane strain, row by row."""
    f, inverse, J = F.ravel(), np.linalg.inv(F).T.ravel(), np.linalg.det(F)
    pressure = LAME * np.log(J) - SHEAR
    # d F^-T_ij / d F_kl = - F^-1_jk F^-1_li
    slope = -np.einsum("jk,li->ijkl", np.linalg.inv(F), np.linalg.inv(F)).reshape(4, 4)
    A = SHEAR * np.eye(4) + LAME * np.outer(inverse, inverse) + pressure * slope
    return SHEAR * f + pressure * inverse, A


def points() -> list[tuple[Array, Array, float]]:
    """Parent place, slopes of the shape functions (4, 2), and volume of each Gauss point."""
    found, g = [], 1 / np.sqrt(3)
    for xi, eta in ((-g, -g), (g, -g), (-g, g), (g, g)):
        parent = np.stack(
            [CORNERS[:, 0] * (1 + CORNERS[:, 1] * eta), CORNERS[:, 1] * (1 + CORNERS[:, 0] * xi)]
        ).T
        J = PLACES.T @ (parent / 4)
        slopes = parent / 4 @ np.linalg.inv(J)
        found.append((np.array([xi, eta]), slopes, float(np.linalg.det(J))))
    return found


def q1e4(u: Array, a: Array) -> tuple[Array, Array]:
    """Residual (12,) and tangent (12, 12) in displacements and modes."""
    J0 = PLACES.T @ (CORNERS / 4)
    r, K = np.zeros(12), np.zeros((12, 12))
    for at, slopes, volume in points():
        B = np.zeros((2, 2, 12))
        for i in (0, 1):
            B[i, :, i:8:2] = slopes.T
            for k in (0, 1):
                B[i, :, 8 + 2 * i + k] = np.linalg.det(J0) / volume * at[k] * np.linalg.inv(J0)[k]
        F = np.eye(2) + B @ np.append(u, a)
        P, A = stress(F)
        flat = B.reshape(4, 12)
        r += flat.T @ P * volume
        K += flat.T @ A @ flat * volume
    return r, K


def q1p0(u: Array, p: Array) -> tuple[Array, Array]:
    """Residual (9,) and tangent (9, 9) in displacements and the pressure."""
    r, K = np.zeros(9), np.zeros((9, 9))
    for _, slopes, volume in points():
        B = np.zeros((4, 8))
        B[0:2, 0::2] = B[2:4, 1::2] = slopes.T
        f = np.eye(2).ravel() + B @ u
        J, cofactor = f[0] * f[3] - f[1] * f[2], np.array([f[3], -f[2], -f[1], f[0]])
        mixed = np.zeros((4, 4))
        mixed[0, 3] = mixed[3, 0] = 1.0
        mixed[1, 2] = mixed[2, 1] = -1.0
        P = SHEAR * (f - cofactor / J) + p[0] * cofactor
        A = SHEAR * (np.eye(4) - mixed / J + np.outer(cofactor, cofactor) / J**2) + p[0] * mixed
        r += volume * np.append(B.T @ P, J - 1 - p[0] / BULK)
        K[:8, :8] += volume * B.T @ A @ B
        K[:8, 8] += volume * B.T @ cofactor
        K[8, :8] += volume * B.T @ cofactor
        K[8, 8] -= volume / BULK
    return r, K


Element = Callable[[Array, Array], tuple[Array, Array]]
CASES: list[tuple[str, Element, int, dict[str, Any], list[str]]] = [
    ("enhanced.py", q1e4, 4, {"lame": LAME}, ["a_0", "a_1", "a_2", "a_3"]),
    ("mean_pressure.py", q1p0, 1, {"K": BULK}, ["p"]),
]


def condensed(element: Element, u: Array, count: int) -> tuple[Array, Array]:
    """Internal unknowns and residual (8,) of an element by hand."""
    a = np.zeros(count)
    for _ in range(30):
        r, K = element(u, a)
        a = a - np.linalg.solve(K[8:, 8:], r[8:])
    return a, element(u, a)[0][:8]


@pytest.mark.parametrize(("page", "element", "count", "given", "names"), CASES)
def test_an_element_is_that_written_by_hand(
    page: str, element: Element, count: int, given: dict[str, Any], names: list[str]
) -> None:
    """Kernel, step of the condensed matrix, and what a study recovers, to 1e-12."""
    kernel = load_kernel(MODELS / page, cell="quad4")
    assert list(kernel.internal) == names
    random = np.random.default_rng(1)
    u, a = 0.1 * random.uniform(-1, 1, 8), 0.1 * random.uniform(-1, 1, count)
    r, K = element(u, a)
    parameters = {"mu": SHEAR, **given}
    found = kernel.tangent(PLACES.reshape(1, 8), np.append(u, a)[None], parameters=parameters)
    np.testing.assert_allclose(found[0][0], r, atol=1e-12 * np.abs(K).max())
    np.testing.assert_allclose(found[1][0], K, atol=1e-12 * np.abs(K).max())

    study = Study(Mesh(PLACES, {"quad4": np.arange(4)[None]}))
    study.add("body", MODELS / page, mu=SHEAR, **given)
    study.fix((0.0, 0.0), u_x=0, u_y=0)
    study.fix((-0.1, 0.9), u_x=0)
    study.load((1.8, 1.2), u_x=0.3, u_y=0.4)
    result = study.solve(steps=2)
    moved = np.stack([result.values("u_x"), result.values("u_y")], axis=1).ravel()
    inner, forces = condensed(element, moved, count)
    assert np.abs(inner).min() > 1e-4
    for k, name in enumerate(names):
        np.testing.assert_allclose(result.fields("body")[name], inner[k], atol=1e-10)
    np.testing.assert_allclose(forces[[2, 3, 4, 5, 7]], [0, 0, 0.3, 0.4, 0], atol=1e-9)


def test_a_condensed_step_is_that_of_the_whole_matrix() -> None:
    random = np.random.default_rng(2)
    groups = np.array([[0, 5], [2, 7], [8, 3]])
    K = random.uniform(-1, 1, (9, 9)) + np.diag([4.0, 4, 4, -4, 4, 4, -4, 4, 4])
    K = K + K.T
    for k, one in enumerate(groups):
        for other in np.delete(groups, k, axis=0):
            K[np.ix_(one, other)] = 0.0
    factors = CondensingSolver(SuperLU(), (groups,)).factorise(csc_array(K))
    b = random.uniform(-1, 1, 9)
    np.testing.assert_allclose(factors.solve(b), np.linalg.solve(K, b), rtol=1e-12)
    inner, others = groups.ravel(), factors.external
    rest = K[np.ix_(others, others)] - K[np.ix_(others, inner)] @ np.linalg.solve(
        K[np.ix_(inner, inner)], K[np.ix_(inner, others)]
    )
    pivots = factors.pivots()
    assert pivots is None or (pivots < 0).sum() == (np.linalg.eigvalsh(rest) < 0).sum()
    assert factors.sign() == np.sign(np.linalg.det(K))
    K[2, 2] = K[2, 7] = K[7, 2] = 0.0
    with pytest.raises(SingularMatrix, match="internal unknowns of element 1") as raised:
        CondensingSolver(SuperLU(), (groups,)).factorise(csc_array(K))
    assert raised.value.row == 2


def beam(page: str | Path, **given: Any) -> Result:
    """A cantilever of 20 x 1, two cells high, bent by 0.01 if it bends as a beam does."""
    study = Study(Mesh.rectangle(20.0, 1.0, cells=(20, 2)))
    study.add("body", page, **given)
    study.fix("left", u_x=0)
    study.fix((0.0, 0.5), u_y=0)
    study.load("right", u_y=0.01 * 3 * MODULUS / 12 / 20**3)
    return study.solve()


MODULUS = 4.0 * SHEAR / (1.0 + SHEAR / (LAME + SHEAR))  # E / (1 - nu^2)


def test_modes_neither_lock_in_bending_nor_when_nothing_can_be_compressed() -> None:
    shear = 1 + 0.75 * MODULUS / SHEAR * 1.2 / 3 / 20**2  # what shear adds, 0.3 %
    found = beam(MODELS / "enhanced.py", mu=SHEAR, lame=LAME).at((20.0, 0.5))["u_y"]
    assert found == pytest.approx(0.01 * shear, rel=5e-3)
    stiff = beam(MODELS / "enhanced.py", mu=SHEAR, lame=1e6).at((20.0, 0.5))["u_y"]
    assert stiff == pytest.approx(0.01 * MODULUS / (4 * SHEAR), rel=1e-2)
    locked = beam(MODELS / "mean_pressure.py", mu=SHEAR, K=1e6).at((20.0, 0.5))["u_y"]
    assert locked < 0.95 * stiff


def test_a_step_that_is_cut_begins_anew_and_other_paths_keep_internal_unknowns() -> None:
    study = Study(Mesh.rectangle(2.0, 1.0, cells=(4, 2)))
    study.add("body", MODELS / "enhanced.py", mu=SHEAR, lame=1e3)
    study.fix("left", u_x=0, u_y=0)
    study.fix("right", u_x=lambda x, t: 1.6 * t + 0 * x[:, 0], u_y=lambda x, t: 0.8 * t)
    seen: list[float] = []
    cut = study.solve(on_step=lambda r: seen.append(r.t))
    assert len(seen) > 1
    many = study.solve(steps=8)
    np.testing.assert_allclose(cut.x, many.x, atol=1e-7)
    *_, last = study.march(dt=0.125, until=1.0)
    np.testing.assert_allclose(last.x, many.x, atol=1e-7)
    path = study.follow(step=0.02, until=lambda r: r.t >= 0.06)
    assert np.abs(path.results[-1].fields("body")["a_0"]).max() > 1e-3


def bent(page: str, points: Array | None = None, **changes: float) -> Study:
    """Skew cells, bent far."""
    given = {"mu": SHEAR, "second": LAME, "lift": 0.02} | changes
    mesh = Mesh.rectangle(4.0, 1.0, cells=(4, 1))
    places = mesh.points + 0.1 * np.sin(3.0 * mesh.points[:, ::-1]) if points is None else points
    study = Study(mesh.map(lambda _: places))
    second = {"enhanced.py": "lame", "mean_pressure.py": "K"}[page]
    arguments: dict[str, Any] = {"mu": given["mu"], second: given["second"]}
    study.add("body", MODELS / page, **arguments)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_y=given["lift"])
    return study
