"""A study as an operation of JAX, where JAX is installed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp

import softehl
from softehl.codegen.language.fields import Fields
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.fit.jax_operation import Operation

jax: Any = pytest.importorskip("jax")
jnp: Any = pytest.importorskip("jax.numpy")


@softehl.page
def rubber(m: Fields) -> None:
    """Neo-Hooke with a share of the modulus in each element."""
    u = m.vector("u")
    mu, K = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]")
    (s,) = m.data(s="share of the shear modulus")
    F = m.deformation_gradient(u)
    J = m.define("J", F.det())
    m.minimise(s * mu / 2 * ((F.T * F).trace() - 3 - 2 * sp.log(J)) + K / 2 * (J - 1) ** 2)


@pytest.fixture(scope="module")
def solve() -> Operation:
    jax.config.update("jax_enable_x64", True)
    study = softehl.Study(softehl.Mesh.rectangle(2, 1, cells=(2, 1)))
    study.add("rubber", rubber, mu=0.4, K=0.9, s=1)
    study.fix("left", u_x=0, u_y=0)
    study.load("right", u_y=0.02)
    tight = softehl.Newton(tolerance=1e-13)
    return study.in_jax(by={"rubber": ["mu", "s"]}, steps=2, newton=tight)


def test_gradients_are_those_of_differences(solve: Operation) -> None:
    """Of order 4; also under jit and vmap."""

    def work(p: Any) -> Any:
        return jnp.sin(3 * solve(p)).sum()

    p, v, h = solve.start, np.array([1.0, -0.3, 0.7]), 4e-4
    near, far = (float(work(p + k * v) - work(p - k * v)) for k in (h, 2 * h))
    slope = jax.jit(jax.grad(work))(p)
    assert float(slope @ v) == pytest.approx((8 * near - far) / (12 * h), rel=1e-10)
    both = jax.vmap(jax.grad(work))(jnp.stack([p, 1.1 * p]))
    np.testing.assert_array_equal(both[0], slope)
    assert np.abs(both[1] - slope).max() > 1e-2
    assert solve.places("u_y").shape == (6,)


def test_what_has_no_derivative_is_refused(solve: Operation) -> None:
    def work(p: Any) -> Any:
        return (solve(p) ** 2).sum()

    with pytest.raises(NotImplementedError, match="the adjoint of a study has no derivatives"):
        jax.grad(lambda p: jax.grad(work)(p).sum())(solve.start)
    with pytest.raises(TypeError, match="can't apply forward-mode"):
        jax.jacfwd(work)(solve.start)
    with pytest.raises(TypeError, match=r"inputs have shape \(2,\), must be \(3,\)"):
        solve(solve.start[:2])
    with pytest.raises(StudyError, match="no unknown 'u_z' at nodes; there are u_x, u_y"):
        solve.places("u_z")
