"""Elements with any number of coordinate components: bar, triangle, hexahedron."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from softehl.codegen.elements import quadrature, shapes
from softehl.codegen.language import kinematics as kin
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.model import Model
from tests.codegen.workshop import compiled


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


def test_shape_functions_of_the_hexahedron() -> None:
    xi = sp.symbols("xi eta zeta", real=True)
    N = shapes.hex8(*xi)
    for a, corner in enumerate(shapes.HEX_NODES):
        assert [n.subs(dict(zip(xi, corner, strict=True))) for n in N] == [a == b for b in range(8)]
    assert sp.expand(sum(N)) == 1
    for n, gradient in zip(N, shapes.hex8_gradient(*xi), strict=True):
        assert all(sp.expand(sp.diff(n, s) - g) == 0 for s, g in zip(xi, gradient, strict=True))


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
