"""Elements with any number of coordinate components: bar, triangle, hexahedron."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

from softehl.codegen.elements import quadrature, shapes
from softehl.codegen.graph.evaluation import State
from softehl.codegen.language import kinematics as kin
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.model import Model
from softehl.codegen.verify.graph_oracle import Oracle
from softehl.runtime.kernels.kernel import ArgumentError, Kernel
from tests.codegen.workshop import compiled

CUBE = (np.array(shapes.HEX_NODES) + 1.0) / 2
MATERIAL = {"mu": 0.8, "kappa": 3.0}


def hexahedron() -> Definition:
    """8-node neo-Hookean solid."""
    m = Model("hexahedron", nodes=8, rule=quadrature.gauss(2, 3))
    X = m.coordinates("X", "Y", "Z")
    u = m.nodal_unknowns("u", "v", "w")
    mu, kappa = m.parameters(mu="shear modulus [MPa]", kappa="bulk modulus [MPa]")
    e = kin.isoparametric(m, X, shapes.hex8_gradient(*m.point()))
    F = kin.deformation_gradient(m, e.dN, u)
    J = m.define("J", F.det())
    W = mu / 2 * ((F.T * F).trace() - 3 - 2 * sp.log(J)) + kappa / 2 * (J - 1) ** 2
    m.potential(m.integral("Pi", W * e.detJ))
    m.fields(J=J)
    return m.finish()


def bar() -> Definition:
    """2-node bar in one dimension: potential k/2 (u_2 - u_1)^2 / (X_2 - X_1)."""
    m = Model("bar", nodes=2, rule=quadrature.gauss(1, 1))
    X = m.coordinates("X")
    u = m.nodal_unknowns("u")
    (k,) = m.parameters(k="stiffness [N]")
    (xi,) = m.point()
    e = kin.isoparametric(m, X, [(sp.diff(n, xi),) for n in shapes.line2(xi)])
    strain = kin.deformation_gradient(m, e.dN, u)[0, 0] - 1
    m.potential(m.integral("Pi", k / 2 * strain**2 * e.detJ))
    return m.finish()


@pytest.fixture(scope="module")
def hexa(tmp_path_factory: pytest.TempPathFactory) -> Kernel:
    return compiled(hexahedron(), tmp_path_factory.mktemp("hexahedron"), "-O0")


def state(kernel: Kernel, X: Any, u: Any, parameters: Any) -> State:
    rule = kernel.default_rule
    points = np.column_stack([rule.points.reshape(len(rule.weights), -1), rule.weights])
    return State(X.ravel().tolist(), u.ravel().tolist(), (), parameters, points.tolist())


def test_shape_functions_of_the_hexahedron() -> None:
    xi = sp.symbols("xi eta zeta", real=True)
    N = shapes.hex8(*xi)
    for a, corner in enumerate(shapes.HEX_NODES):
        assert [n.subs(dict(zip(xi, corner, strict=True))) for n in N] == [a == b for b in range(8)]
    assert sp.expand(sum(N)) == 1
    for n, gradient in zip(N, shapes.hex8_gradient(*xi), strict=True):
        assert all(sp.expand(sp.diff(n, s) - g) == 0 for s, g in zip(xi, gradient, strict=True))


@pytest.mark.slow
def test_hexahedron_against_the_oracle(hexa: Kernel, rng: np.random.Generator) -> None:
    X = CUBE + rng.uniform(-0.1, 0.1, (8, 3))
    u, v = rng.uniform(-0.1, 0.1, (2, 8, 3))
    at = state(hexa, X, u, list(MATERIAL.values()))
    R, K = hexa.tangent(X.reshape(1, 24), u.reshape(1, 24), parameters=MATERIAL)
    oracle = Oracle(hexahedron())
    for found, exact in (
        (R[0], oracle.residual(at)),
        (K[0] @ v.ravel(), oracle.product(at, v.ravel().tolist())),
    ):
        expected = np.array(exact, dtype=np.float64)
        assert np.abs(found - expected).max() <= 1e-13 * np.abs(expected).max()
    assert np.abs(K[0] - K[0].T).max() <= 1e-13 * np.abs(K).max()


def test_hexahedron_knows_rigid_motions_and_volume(hexa: Kernel, rng: np.random.Generator) -> None:
    X = CUBE + rng.uniform(-0.1, 0.1, (8, 3))
    Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    Q *= np.linalg.det(Q)
    rigid = X @ Q.T + rng.normal(size=3) - X
    arguments = (X.reshape(1, 24), rigid.reshape(1, 24))
    assert np.abs(hexa.residual(*arguments, parameters=MATERIAL)).max() < 1e-14
    stretched = (X @ np.diag([1.2, 0.9, 1.1]) - X).reshape(1, 24)
    J = hexa.fields_at(arguments[0], stretched, parameters=MATERIAL)
    np.testing.assert_allclose(J, 1.2 * 0.9 * 1.1, rtol=1e-13)
    F = np.diag([1.2, 0.9, 1.1])
    J0 = np.linalg.det(F)
    W = 0.4 * (np.sum(F**2) - 3 - 2 * np.log(J0)) + 1.5 * (J0 - 1) ** 2
    cube = (CUBE.reshape(1, 24), (CUBE @ F - CUBE).reshape(1, 24))
    np.testing.assert_allclose(hexa.energy(*cube, parameters=MATERIAL), W, rtol=1e-14)


def test_coordinates_are_checked_by_their_number(hexa: Kernel) -> None:
    assert hexa.coordinates == ("X", "Y", "Z")
    u = np.zeros((2, 24))
    with pytest.raises(ArgumentError, match=r"coordinates has shape \(2, 16\), must be \(2, 24\)"):
        hexa.residual(np.zeros((2, 16)), u, parameters=MATERIAL)


def test_a_bar_has_one_coordinate(tmp_path: Path) -> None:
    kernel = compiled(bar(), tmp_path)
    assert kernel.coordinates == ("X",)
    R, K = kernel.tangent(np.array([[0.2, 0.7]]), np.array([[0.1, 0.3]]), parameters={"k": 5.0})
    np.testing.assert_allclose(R, [[-2.0, 2.0]], rtol=1e-14)
    np.testing.assert_allclose(K, [[[10.0, -10.0], [-10.0, 10.0]]], rtol=1e-14)


@pytest.mark.parametrize("unroll", [False, True])
def test_an_element_without_coordinates(unroll: bool, tmp_path: Path) -> None:
    m = Model("placeless", nodes=1, rule=quadrature.gauss(1, 1), unroll=unroll)
    u = m.unknown("u")
    m.potential(m.integral("Pi", u**2))
    kernel = compiled(m.finish(), tmp_path)
    assert kernel.coordinates == ()
    for nothing in (np.empty((2, 0)), np.zeros((2, 2))):
        np.testing.assert_allclose(kernel.residual(nothing, np.array([[1.0], [2.0]])), [[4], [8]])


def test_coordinates_are_declared_once() -> None:
    m = Model("twice", nodes=2, rule=quadrature.gauss(1, 1))
    X = m.coordinates("X", "Y")
    assert m.coordinates("X", "Y") == X
    with pytest.raises(ModelError, match="the coordinates are X, Y already"):
        m.coordinates("X", "Y", "Z")
