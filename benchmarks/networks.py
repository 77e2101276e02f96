"""A network as the energy of a hexahedron: residual and tangent here and in JAX, ns an element.

    python -m benchmarks.networks [--elements N]        (in an environment with JAX)

The energy is a network of I1, I2 and J with layers of 16 and 16, softplus. JAX computes residual
and tangent of all elements in one jitted call, in two ways: `jax.hessian` of the energy of an
element, under `vmap`; and moduli at the points, d2W/dF2 by `jax.hessian`, pulled back by the
derivatives of the shape functions, as a careful user would write it. All on one thread, in
float64, the least of many runs in turn; the results agree to rounding.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")

import numpy as np

import softehl
from benchmarks.hosts import least
from softehl.codegen.language.fields import Fields
from softehl.runtime.arrays import Array

LAYERS = (16, 16)
CORNERS = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
)


@softehl.page
def learned(m: Fields) -> None:
    """An energy of three invariants."""
    F = m.deformation_gradient(m.vector("u"))
    C = F.T * F
    I1 = m.define("I1", C.trace())
    I2 = m.define("I2", (I1**2 - (C * C).trace()) / 2)
    m.minimise(m.network("W", [I1, I2, m.define("J", F.det())], layers=LAYERS))


def elements(n: int) -> tuple[Array, Array]:
    """Coordinates and displacements of n distorted, deformed cubes, (n, 24) each."""
    rng = np.random.default_rng(0)
    X = CORNERS + 0.05 * rng.normal(size=(n, 8, 3))
    return X.reshape(n, 24), 0.05 * rng.normal(size=(n, 24))


def softehl_call(X: Array, u: Array, weights: Any) -> Callable[[], tuple[Array, Array]]:
    """Residuals and tangents by the compiled kernel, into the same arrays."""
    kernel = softehl.load_kernel(learned, cell="hex8")
    again = kernel.call("tangent", X, u, parameters={"W": weights}).again()
    R, K = np.empty(u.shape), np.empty((*u.shape, 24))

    def call() -> tuple[Array, Array]:
        again(u, R, K)
        return R, K

    return call


def shape_gradients() -> Array:
    """Derivatives of the shape functions by the parent coordinates, (points, 8, 3)."""
    xi = np.array([(2 * c - 1) / np.sqrt(3) for c in CORNERS])
    signs = 2.0 * CORNERS - 1.0
    factors = 1.0 + xi[:, None, :] * signs
    return np.stack(
        [signs[:, k] * np.prod(np.delete(factors, k, axis=2), axis=2) / 8.0 for k in range(3)],
        axis=2,
    )


def jax_calls(X: Array, u: Array, weights: Any) -> dict[str, Callable[[], Any]]:
    """Residuals and tangents by JAX, in both ways."""
    jax: Any = importlib.import_module("jax")
    jax.config.update("jax_enable_x64", True)
    jnp: Any = importlib.import_module("jax.numpy")
    dN, W = jnp.asarray(shape_gradients()), [tuple(map(jnp.asarray, layer)) for layer in weights]

    def energy(F: Any) -> Any:
        C = F.T @ F
        I1 = jnp.trace(C)
        h = jnp.array([I1, (I1**2 - jnp.trace(C @ C)) / 2, jnp.linalg.det(F)])
        for w, b in W[:-1]:
            h = jax.nn.softplus(w @ h + b)
        return (W[-1][0] @ h + W[-1][1])[0]

    def geometry(X: Any) -> tuple[Any, Any]:
        J = jnp.einsum("ai,qak->qik", X.reshape(8, 3), dN)
        return jnp.einsum("qak,qki->qai", dN, jnp.linalg.inv(J)), jnp.linalg.det(J)

    def gradients(u: Any, B: Any) -> Any:
        return jnp.eye(3) + jnp.einsum("ai,qak->qik", u.reshape(8, 3), B)

    def element(u: Any, X: Any) -> Any:
        B, volume = geometry(X)
        return volume @ jax.vmap(energy)(gradients(u, B))

    def by_points(u: Any, X: Any) -> tuple[Any, Any]:
        B, volume = geometry(X)
        F = gradients(u, B)
        P, A = jax.vmap(jax.grad(energy))(F), jax.vmap(jax.hessian(energy))(F)
        R = jnp.einsum("q,qik,qak->ai", volume, P, B)
        K = jnp.einsum("q,qikjl,qak,qbl->aibj", volume, A, B, B)
        return R.reshape(24), K.reshape(24, 24)

    def by_element(u: Any, X: Any) -> tuple[Any, Any]:
        return jax.grad(element)(u, X), jax.hessian(element)(u, X)

    calls: dict[str, Callable[[], Any]] = {}
    for name, function in (("JAX, hessian", by_element), ("JAX, moduli", by_points)):
        jitted = jax.jit(jax.vmap(function))
        arrays = jnp.asarray(u), jnp.asarray(X)
        calls[name] = partial(_finished, jax, jitted, arrays)
    return calls


def _finished(jax: Any, function: Callable[..., Any], arrays: Sequence[Any]) -> Any:
    """Results that are computed, not only asked for."""
    return jax.block_until_ready(function(*arrays))


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--elements", type=int, default=512)
    n = parser.parse_args(arguments).elements
    X, u = elements(n)
    weights = softehl.initial_weights(3, LAYERS, seed=1)
    calls: dict[str, Callable[[], Any]] = {"softehl": softehl_call(X, u, weights)}
    try:
        calls |= jax_calls(X, u, weights)
    except ImportError:
        print("JAX is not installed: left out")
    R, K = calls["softehl"]()
    for name, call in calls.items():
        R_other, K_other = map(np.asarray, call())
        error = max(abs(R_other - R).max() / abs(R).max(), abs(K_other - K).max() / abs(K).max())
        assert error < 1e-12, (name, error)
    print("| residual and tangent | ns an element |\n|---|---|")
    for name, seconds in least(calls).items():
        print(f"| {name} | {seconds / n * 1e9:.0f} |")


if __name__ == "__main__":
    main(sys.argv[1:])
