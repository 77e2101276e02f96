"""Functions that are smooth at zero, at every size of their argument."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp

from softehl.codegen.elements import quadrature
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.errors import ModelError
from softehl.codegen.language.model import Model
from softehl.codegen.tools import build
from softehl.codegen.verify import verification
from softehl.runtime.kernels.kernel import Kernel
from tests.codegen.workshop import compiled, tangent_errors

SIZES = (0.0, 1e-300, 1e-8, 1e-4, 1.0, 3.0, np.pi, 3.2, 30.0, 1e3)


def exact(x: float, order: int, first: int) -> Any:
    """Derivative of sin(x) / x (first = 1) or (1 - cos(x)) / x^2 (2): below 1 by its series."""
    with mpmath.workdps(60):
        if x >= 1:
            if first == 1:
                return mpmath.diff(lambda t: mpmath.sin(t) / t, x, order)
            return mpmath.diff(lambda t: (1 - mpmath.cos(t)) / t**2, x, order)
        total = mpmath.mpf(0)
        for k in range((order + 1) // 2, 30):
            factor = mpmath.ff(2 * k, order) / mpmath.fac(2 * k + first)
            total += (-1) ** k * factor * mpmath.mpf(x) ** (2 * k - order)
        return total


def test_sinc_and_cosc(tmp_path: Path) -> None:
    m = Model("smooth", nodes=1, rule=quadrature.point_rule())
    x = m.unknown("x")
    a, b = m.parameters(a="factor", b="factor")
    m.potential(a * m.sinc(x) + b * m.cosc(x))
    kernel = compiled(m.finish(), tmp_path)
    nowhere = np.zeros((1, 0))
    for size in SIZES:
        for first, parameters in ((1, [1.0, 0.0]), (2, [0.0, 1.0])):
            u = np.array([[size]])
            value = kernel.energy(nowhere, u, parameters=parameters)[0]
            R, K = kernel.tangent(nowhere, u, parameters=parameters)
            for order, found in enumerate((value, R[0, 0], K[0, 0, 0])):
                right = exact(size, order, first)
                assert abs(found - right) <= 2e-15 * abs(right), (size, first, order)


def turning(name: str, *, tasks: bool = False, branches: bool = True) -> Definition:
    """A vector that is turned, and the rotation vector of the rotation."""
    m = Model(name, nodes=1, rule=quadrature.point_rule())
    w = [m.unknown(f"w_{k}") for k in range(3)]
    (a,) = m.parameters(a="factor")
    R = m.define("R", m.rotation(w))
    v = m.rotation_vector(R, branches=branches)
    x = R * sp.Matrix([1, 2, -1]) * a
    m.potential((x[0] * x[1] + x[2]) / 8 + sum(c**2 for c in v) / 2 + v[0] * v[1] / 4)
    m.fields(**{f"R_{k}": r for k, r in enumerate(R)}, **{f"v_{k}": c for k, c in enumerate(v)})
    m.offer(tasks=["tangent", "fields"], product=tasks, fields_rate=tasks)
    return m.finish()


@pytest.fixture(scope="module")
def kernel(tmp_path_factory: pytest.TempPathFactory) -> Kernel:
    return compiled(turning("turning"), tmp_path_factory.mktemp("turning"))


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-160, 1e-8, 1e-4, 1.0, 2.0, 2.2, 3.0, 3.1415])
def test_rotation_and_its_inverse(angle: float, kernel: Kernel) -> None:
    for axis in ([0.6, 0.0, 0.8], [0.1, -0.9, 0.3], [-0.2, 0.3, 0.1], [0.0, 0.0, 1.0]):
        w = angle * np.array(axis) / np.linalg.norm(axis)
        at = np.zeros((1, 0)), w[None]
        found = kernel.fields_at(*at, parameters=[1.0])[0, 0]
        with mpmath.workdps(40):
            W = mpmath.matrix([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
            R = np.array(mpmath.expm(W).tolist(), dtype=float).ravel()
        assert np.abs(found[:9] - R).max() <= 1e-15
        assert np.abs(found[9:] - w).max() <= 1e-15 * max(angle, 1e-300) + 1e-15 * (angle > 2)


@pytest.mark.parametrize("w", [(0.0, 0.0, 0.0), (1e-9, 2e-9, 0.0), (0.3, -0.2, 0.5), (2, 1.9, 1)])
def test_two_derivatives(w: tuple[float, ...], kernel: Kernel) -> None:
    """At half a turn and beyond only the sign of the vector changes."""
    errors = tangent_errors(turning("turning"), kernel, (), w, parameters=[0.7])
    assert max(errors) < 3e-15


def test_a_rotation_vector_without_branches(tmp_path: Path) -> None:
    """Its digits go with the cosine of the half angle."""
    kernel = compiled(turning("one_formula", branches=False), tmp_path)
    axis = np.array([0.6, -0.64, 0.48])
    for angle in (0.0, 1e-160, 1e-4, 1.0, 2.0, 2.6, 3.0):
        at = np.zeros((1, 0)), (angle * axis)[None]
        found = kernel.fields_at(*at, parameters=[1.0])[0, 0, 9:]
        lost = 1 / np.cos(angle / 2) ** 2
        assert np.abs(found - angle * axis).max() <= 2e-15 * lost * max(angle, 1e-300)
    d = turning("one_formula", branches=False)
    assert max(tangent_errors(d, kernel, (), (0.3, -0.2, 0.5), parameters=[0.7])) < 3e-15


def test_a_large_rotation_vector(kernel: Kernel) -> None:
    w = np.array([600.0, -300.0, 741.0])
    found = kernel.fields_at(np.zeros((1, 0)), w[None], parameters=[1.0])[0, 0, :9]
    with mpmath.workdps(500):
        W = mpmath.matrix([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        R = np.array(mpmath.expm(W, method="taylor").tolist(), dtype=float).ravel()
    assert np.abs(found - R).max() < 1e-15


@pytest.mark.slow
def test_all_tasks(tmp_path: Path) -> None:
    d = turning("turning_tasks", tasks=True)
    compiled(d, tmp_path)
    tasks = ("tangent", "fields", "product", "fields_rate")
    checked = verification.check(d, tasks, tmp_path / build.LIBRARY, seconds=1)
    assert max(checked.errors.values()) <= verification.BOUND


def test_mistakes() -> None:
    m = Model("wrong", nodes=1, rule=quadrature.point_rule())
    a, b = m.unknown("a"), m.unknown("b")
    with pytest.raises(ModelError, match=r"m.sinc: .* is no scalar; of a vector m.rotation"):
        m.sinc([a, b])
    with pytest.raises(ModelError, match=r"m.rotation: w has 2 entries, must have 3"):
        m.rotation([a, b])
    with pytest.raises(ModelError, match=r"m.rotation_vector: R has shape \(2, 2\), must be"):
        m.rotation_vector(sp.eye(2))
    with pytest.raises(ModelError, match=r"m.isotropic: m.sinc.* have no divided differences"):
        m.isotropic(sp.Matrix([[a, b], [b, a]]), lambda x: m.sinc(x))
