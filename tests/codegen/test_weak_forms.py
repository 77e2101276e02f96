"""The pages of `tests/codegen/pages`: tangents in every branch, rigid motions, closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from softehl.codegen.elements import shapes
from softehl.codegen.language.definition import Definition
from softehl.runtime.arrays import Array
from softehl.runtime.kernels.kernel import Kernel
from tests.codegen.pages.gent import gent
from tests.codegen.pages.maxwell import maxwell
from tests.codegen.pages.ogden_hex8 import ogden
from tests.codegen.pages.penalty_spring import penalty_spring
from tests.codegen.workshop import compiled, tangent_errors

SQUARE = np.array(shapes.QUAD_NODES) / 2.0
CUBE = np.array(shapes.HEX_NODES) / 2.0
OGDEN = {"mu_1": 1.0, "alpha_1": 1.3, "mu_2": -0.2, "alpha_2": -2.0, "kappa": 10.0}
GENT = {"mu": 1.2, "Jm": 5.0, "kappa": 10.0}
MAXWELL = {"mu": 1.0, "kappa": 10.0, "mu_v": 2.0, "tau": 3.0, "dt": 0.5}
AT_REST = np.array([[1.0, 1.0, 1.0, 0.0]] * 4)
TURN = np.array([[0.8, -0.6], [0.6, 0.8]])
Made = tuple[Definition, Kernel]


def made(factory: pytest.TempPathFactory, d: Definition) -> Made:
    return d, compiled(d, factory.mktemp(d.name), "-O0")


@pytest.fixture(scope="module")
def a_gent(tmp_path_factory: pytest.TempPathFactory) -> Made:
    return made(tmp_path_factory, gent())


@pytest.fixture(scope="module")
def a_maxwell(tmp_path_factory: pytest.TempPathFactory) -> Made:
    return made(tmp_path_factory, maxwell())


@pytest.fixture(scope="module")
def an_ogden(tmp_path_factory: pytest.TempPathFactory) -> Made:
    return made(tmp_path_factory, ogden())


@pytest.fixture(scope="module")
def a_spring(tmp_path_factory: pytest.TempPathFactory) -> Made:
    return made(tmp_path_factory, penalty_spring())


def moved(X: Array, F: Array) -> Array:
    """Displacements (1, n) of the motion x = F X."""
    return (X @ F.T - X).reshape(1, -1)


# ------------------------------------------------------------------------------------------- Gent


def test_gent_closed_forms(a_gent: Made) -> None:
    """Simple shear g: sigma_xy = mu g / (1 - g^2/Jm); a rigid motion; beyond the limit."""
    _, kernel = a_gent
    X, g = SQUARE.reshape(1, 8), 0.4
    shear = moved(SQUARE, np.array([[1.0, g], [0.0, 1.0]]))
    sigma = kernel.fields_at(X, shear, parameters=GENT)[0, :, 3]
    np.testing.assert_allclose(sigma, 1.2 * g / (1 - g**2 / 5), rtol=1e-14)
    assert np.abs(kernel.residual(X, moved(SQUARE, TURN), parameters=GENT)).max() < 1e-14
    far = moved(SQUARE, np.array([[1.0, 3.0], [0.0, 1.0]]))
    assert np.isnan(kernel.energy(X, far, parameters=GENT)).all()


# ------------------------------------------------------------------------------------------ Ogden


def test_ogden_in_tension(an_ogden: Made) -> None:
    """Force on a face of the unit cube: dW/dl_1 at stretches l_1, l_2 = l_3."""
    _, kernel = an_ogden
    l1, l2 = 1.6, 0.8
    J, bar = l1 * l2 * l2, np.array([l1, l2, l2]) / (l1 * l2 * l2) ** (1 / 3)
    terms = [(OGDEN["mu_1"], OGDEN["alpha_1"]), (OGDEN["mu_2"], OGDEN["alpha_2"])]
    force = sum(mu * (bar[0] ** a - np.mean(bar**a)) / l1 for mu, a in terms)
    force += OGDEN["kappa"] * (J - 1) * l2 * l2
    u = moved(CUBE, np.diag([l1, l2, l2]))
    R = kernel.residual(CUBE.reshape(1, 24), u, parameters=OGDEN).reshape(8, 3)
    assert R[CUBE[:, 0] > 0, 0].sum() == pytest.approx(force, rel=1e-13)


# ----------------------------------------------------------------------------------------- spring


@pytest.mark.parametrize(("u", "closed"), [((0.1, 0.2), True), ((1.5, 0.2), False)])
def test_spring_in_both_branches(u: tuple[float, float], closed: bool, a_spring: Made) -> None:
    d, kernel = a_spring
    parameters = [3.0, 0.0, 0.1, 1.0]
    X, at = np.array([[0.3, 0.2]]), np.array([u])
    _, K = kernel.tangent(X, at, parameters=parameters)
    assert K.any() == closed
    if closed:
        assert max(tangent_errors(d, kernel, X, u, parameters=parameters)) <= 1e-14
    x = X[0] + u - [0.0, 0.1]
    gap = np.hypot(*x) - 1
    R = kernel.residual(X, at, parameters=parameters)[0]
    np.testing.assert_allclose(R, 3 * min(gap, 0) * x / np.hypot(*x), rtol=1e-14)
    v = np.array([[0.3, -0.7]])
    np.testing.assert_allclose(
        kernel.product(X, at, v, parameters=parameters)[0], K[0] @ v[0], rtol=1e-14
    )
    slope = kernel.derivative("r", X, at, parameters=parameters)[0]
    np.testing.assert_allclose(slope, -3 * closed * x / np.hypot(*x), rtol=1e-14)


# ---------------------------------------------------------------------------------------- Maxwell


def test_maxwell_in_closed_form(a_maxwell: Made, rng: np.random.Generator) -> None:
    """C_v is the unimodular part of C_v,old + dt/tau Cbar (Shutov et al. 2013)."""
    _, kernel = a_maxwell
    F, old = np.eye(3), AT_REST + rng.uniform(-0.1, 0.1, (4, 4))
    F[:2, :2] += rng.uniform(-0.3, 0.3, (2, 2))
    C = F.T @ F * np.linalg.det(F) ** (-2 / 3)
    found = kernel.fields_at(
        SQUARE.reshape(1, 8),
        moved(SQUARE, F[:2, :2]),
        parameters=MAXWELL,
        point_data=old[None],
    )
    for (a, b, c, d), now in zip(old, found[0], strict=True):
        step = np.array([[a, d, 0], [d, b, 0], [0, 0, c]]) + 0.5 / 3.0 * C
        step /= np.linalg.det(step) ** (1 / 3)
        np.testing.assert_allclose(now, step[[0, 1, 2, 0], [0, 1, 2, 1]], rtol=0, atol=1e-14)
