"""Local unknowns of an element whose equations are integrals: exact condensation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

from softehl.codegen.elements import quadrature, shapes
from softehl.codegen.language import kinematics
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.model import Model
from softehl.runtime.kernels.kernel import load_kernel
from tests.codegen.workshop import compiled, tangent_errors

MU, LAME = 2.0, 3.0


def enhanced(name: str, *, condensed: bool, unroll: bool | None = None) -> Definition:
    """A neo-Hookean quadrilateral with two enhanced modes, xi in F_00 and eta in F_11."""
    m = Model(name, nodes=4, rule=quadrature.gauss(2, 2), unroll=unroll)
    X, u = m.coordinates("X", "Y"), m.nodal_unknowns("u", "v")
    mu, lame = m.parameters(mu="shear modulus", lame="first Lame parameter")
    xi, eta = m.point()
    e = kinematics.isoparametric(m, X, shapes.quad4_gradient(xi, eta))
    F = kinematics.deformation_gradient(m, e.dN, u)

    def energy(s: Any) -> Any:
        G = F + sp.diag(xi * s[0], eta * s[1])
        J = G.det()
        W = mu / 2 * ((G.T * G).trace() - 2 - 2 * sp.log(J)) + lame / 2 * sp.log(J) ** 2
        return W * e.detJ

    def stationary(s: Any) -> Any:
        return m.derivative("Pi_s", m.integral("local", energy(s)), s)

    if condensed:
        s = m.implicit("s", stationary, start=[sp.Integer(0)] * 2)
    else:
        s = [m.unknown("s_0"), m.unknown("s_1")]
    m.potential(m.integral("Pi", energy(s)))
    m.offer(tasks=["energy", "residual", "tangent"])
    return m.finish()


def test_the_condensed_element_is_the_schur_complement_of_the_whole(tmp_path: Path) -> None:
    d = enhanced("condensed", condensed=True)
    for folder in ("whole", "condensed"):
        (tmp_path / folder).mkdir()
    whole = compiled(enhanced("whole", condensed=False), tmp_path / "whole")
    kernel = compiled(d, tmp_path / "condensed")
    X = np.array([[0.0, 0, 1.2, 0.1, 1.1, 1, -0.1, 0.9]])
    u = 0.2 * np.random.default_rng(3).uniform(-1, 1, (1, 8))
    given: dict[str, Any] = {"parameters": [MU, LAME]}
    s = np.zeros((1, 2))
    for _ in range(20):
        R, K = whole.tangent(X, np.hstack([u, s]), **given)
        s -= np.linalg.solve(K[0, 8:, 8:], R[0, 8:])
    assert np.abs(s).min() > 1e-3
    schur = K[0, :8, :8] - K[0, :8, 8:] @ np.linalg.solve(K[0, 8:, 8:], K[0, 8:, :8])
    found, slopes = kernel.tangent(X, u, **given)
    np.testing.assert_allclose(
        kernel.energy(X, u, **given), whole.energy(X, np.hstack([u, s]), **given), rtol=1e-13
    )
    np.testing.assert_allclose(found[0], R[0, :8], atol=1e-13)
    np.testing.assert_allclose(slopes[0], schur, atol=1e-12)
    assert load_kernel("condensed", tmp_path / "condensed").nodes == 4
    assert max(tangent_errors(d, kernel, X[0], u[0], **given)) < 1e-12


def test_what_cannot_be_condensed_says_what_to_write() -> None:
    with pytest.raises(ModelError, match="s: its equations are integrals, which need unroll=True"):
        enhanced("rolled", condensed=True, unroll=False)
    m = Model("mixed", nodes=1, rule=quadrature.gauss(2, 1))
    (xi,) = m.point()
    (old,) = m.point_data(old="history")
    with pytest.raises(ModelError, match="wrap it in integral"):
        m.implicit("a", lambda a: a * xi - m.integral("A", a), start=sp.Integer(0))
    with pytest.raises(ModelError, match="may hold no point data"):
        m.implicit("b", lambda b: b - m.integral("B", b * old), start=sp.Integer(0))
