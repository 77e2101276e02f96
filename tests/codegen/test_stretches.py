"""Isotropic energies of principal stretches: exact where stretches are equal, nearly so, or not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

from softehl.codegen.graph.differentiate import gradient
from softehl.codegen.graph.evaluate import State
from softehl.codegen.graph.graph import Op
from softehl.codegen.graph.routines import Isotropic, upper
from softehl.codegen.graph.traverse import reachable
from softehl.codegen.language.complaints import ModelError
from softehl.codegen.language.definition import Definition
from softehl.codegen.language.elements import quadrature
from softehl.codegen.language.model import Model
from softehl.codegen.tools import build
from softehl.codegen.tools.oracle import Oracle
from softehl.runtime.arrays import Array
from softehl.runtime.kernels import Kernel, load_kernel
from tests.codegen.workshop import compiled, element_state, off, tangent_errors, write

PARAMETERS = (0.7, 1.7, 0.3)
GAPS = (0.3, 0.052, 0.048, 1e-3, 1e-6, 1e-9, 1e-12, 0.0)
ENTRIES = ("c11", "c22", "c33", "c12", "c13", "c23")


def stretches(energy: Any = None) -> Definition:
    """The six entries of C are the unknowns; Ogden, Hencky and volumetric terms together."""
    m = Model("stretches", nodes=1, rule=quadrature.point_rule())
    a, b, c, d, e, f = (m.unknown(n) for n in ENTRIES)
    mu, alpha, beta = m.parameters(mu="modulus", alpha="exponent", beta="modulus")
    C = sp.Matrix([[a, d, e], [d, b, f], [e, f, c]])

    def mixed(x: Any, y: Any, z: Any) -> Any:
        ogden = mu / alpha * (x**alpha + y**alpha + z**alpha - 3)
        return ogden + beta * sum(sp.log(v) ** 2 for v in (x, y, z)) + (x * y * z - 1) ** 2

    W = m.principal("W", C, energy or mixed)
    m.potential(W)
    m.fields(W=W, mu=mu, alpha=alpha, beta=beta)  # another energy may leave them unused
    m.offer(derivatives=[alpha])
    return m.finish()


@pytest.fixture(scope="module")
def kernel(tmp_path_factory: pytest.TempPathFactory) -> Kernel:
    return compiled(stretches(), tmp_path_factory.mktemp("stretches"))


def unknowns(C: Array) -> list[float]:
    return [float(C[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def turned(*squares: float) -> Array:
    Q, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    C: Array = Q @ np.diag(squares) @ Q.T
    return (C + C.T) / 2


def errors(kernel: Kernel, C: Array) -> tuple[float, float]:
    found: tuple[float, float] = tangent_errors(
        stretches(), kernel, (), unknowns(C), parameters=PARAMETERS
    )
    return found


@pytest.mark.parametrize("gap", GAPS)
def test_two_and_three_nearly_equal_stretches(gap: float, kernel: Kernel) -> None:
    """Relative to the largest entry, 1e-14 is reached at every gap."""
    assert max(errors(kernel, turned(1.44 * (1 + gap), 1.44, 0.7))) <= 1e-14
    assert max(errors(kernel, turned(1.3 * (1 + gap), 1.3, 1.3 * (1 - gap / 2)))) <= 1e-14


def test_undeformed_and_diagonal_states(kernel: Kernel) -> None:
    for C in (np.eye(3), np.diag([1.2, 1.2, 0.5]), np.diag([0.4, 2.5, 0.4])):
        assert max(errors(kernel, C)) <= 1e-14
    R, K = kernel.tangent(np.zeros((1, 0)), np.array([unknowns(np.eye(3))]), parameters=PARAMETERS)
    np.testing.assert_allclose(R[0, :3], 0.35, rtol=1e-14)  # mu/2: Hencky and volume are at rest
    assert np.abs(R[0, 3:]).max() == 0
    assert np.linalg.matrix_rank(K[0]) == 6


def test_large_stretches(kernel: Kernel) -> None:
    assert max(errors(kernel, turned(30.0, 0.05, 0.6))) <= 1e-13


def test_energy_and_its_slope_by_the_exponent(kernel: Kernel) -> None:
    """Uniaxial closed forms: d/dalpha of dW/dC_11 = mu/2 x^(alpha - 2)."""
    x = 1.3
    u = np.array([unknowns(np.diag([x**2, 1.0, 1.0]))])
    mu, alpha, beta = PARAMETERS
    W = mu / alpha * (x**alpha - 1) + beta * np.log(x) ** 2 + (x - 1) ** 2
    nowhere = np.zeros((1, 0))
    np.testing.assert_allclose(kernel.energy(nowhere, u, parameters=PARAMETERS), W, rtol=1e-14)
    slope = kernel.derivative("alpha", nowhere, u, parameters=PARAMETERS)
    np.testing.assert_allclose(slope[0, 0], mu / 2 * x ** (alpha - 2) * np.log(x), rtol=1e-14)
    C = turned(1.3, 1.3 * (1 + 1e-7), 0.8)
    at = element_state(kernel, (), unknowns(C), parameters=PARAMETERS)
    found = kernel.derivative("alpha", nowhere, np.array([unknowns(C)]), parameters=PARAMETERS)
    assert off(found[0], Oracle(stretches()).derivative(at, "parameters", 1)) <= 1e-14


def test_a_matrix_that_is_not_positive_definite_is_a_failure(kernel: Kernel) -> None:
    u = np.array([unknowns(np.diag([1.0, 2.0, c])) for c in (1.0, -1.0, 0.0)])
    R, K = kernel.tangent(np.zeros((3, 0)), u, parameters=PARAMETERS)
    assert np.isfinite(R[0]).all()
    assert np.isnan(R[1:]).all()
    assert np.isnan(K[1:]).all()


def test_the_branch_is_needed(tmp_path: Path) -> None:
    """Without the mean over nearly equal stretches the tangent is far off: the oracle says so."""
    write(stretches(), tmp_path)
    source = tmp_path / "stretches.c"
    text = source.read_text()
    assert text.count("0.05 * middle") == 1
    source.write_text(text.replace("0.05 * middle", "0.0"))
    build.build(tmp_path, extra=("-O1",))
    naive = load_kernel("stretches", tmp_path)
    assert errors(naive, turned(1.44 * (1 + 1e-9), 1.44, 0.7))[1] > 1e-9


def test_order_of_the_second_derivatives() -> None:
    pairs = [(i, j) for i in range(6) for j in range(i, 6)]
    assert [upper(i, j) for i, j in pairs] == list(range(21))
    assert upper(4, 2) == upper(2, 4)


def test_what_is_no_isotropic_energy_is_refused() -> None:
    with pytest.raises(ModelError, match="W: the energy changes when two stretches are exchanged"):
        stretches(lambda x, y, z: x + 2 * y + z)
    with pytest.raises(ModelError, match="exchanged"):
        stretches(lambda x, y, z: (x - y) * (y - z) * (z - x))
    with pytest.raises(ModelError, match="exchanged"):  # only where a stretch is above 3
        stretches(lambda x, y, z: x + y + z + sp.Max(x - 3, 0) ** 2)
    m = Model("flat", nodes=1, rule=quadrature.point_rule())
    with pytest.raises(ModelError, match=r"C has shape \(2, 2\), must be \(3, 3\)"):
        m.principal("W", sp.eye(2), lambda x, y, z: x + y + z)


def test_derivatives_of_the_oracle_are_differences() -> None:
    """Orders 1 and 2 in 90 digits against trace(C^2), whose derivatives are 2 C and a constant."""
    d = stretches(lambda x, y, z: x**4 + y**4 + z**4)
    (call,) = (n for n in reachable([d.potential]) if n.op is Op.CALL)
    assert isinstance(call.payload, Isotropic)
    first = gradient(d.graph, d.potential, d.directions)
    C = turned(1.3, 1.3, 0.8)
    at = element_state_of(C)
    for k, u in enumerate(d.directions):
        value = Oracle(replace(d, potential=first[u])).potential(at)
        assert abs(value - 2 * unknowns(C)[k] * (1 if k < 3 else 2)) < 1e-20


def element_state_of(C: Array) -> State:
    return State((), unknowns(C), (), PARAMETERS)
