"""Krylov methods of matrices that are known by their products."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres

from softehl.runtime.arrays import Array

_RESTART = 60  # vectors that GMRES keeps
Apply = Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class KrylovResult:
    """End of an iteration.

    x: (n,). iterations: that it took. converged: whether the residual is small enough. negative:
    whether a direction with negative curvature was met; x is then what was found before it.
    """

    x: Array
    iterations: int
    converged: bool
    negative: bool = False


def conjugate_gradients(
    apply: Apply,
    precondition: Apply,
    b: Array,
    tolerance: float,
    max_iterations: int,
    dot: Callable[[Array, Array], float] = np.dot,
) -> KrylovResult:
    """x of A x = b from zero, until the residual is `tolerance` times b.

    A is symmetric; where it turns out to be indefinite, that is the end. dot: of two vectors, where
    they are spread over processes.
    """
    x, r = np.zeros_like(b), b.copy()
    target = tolerance * float(np.sqrt(dot(b, b)))
    p, previous_rho = np.zeros_like(b), 1.0
    for k in range(max_iterations):
        if float(np.sqrt(dot(r, r))) <= target:
            return KrylovResult(x, k, converged=True)
        z = precondition(r)
        product = float(dot(r, z))
        p *= product / previous_rho
        p += z
        Ap = apply(p)
        curvature = float(dot(p, Ap))
        if not curvature > 0.0 or not product > 0.0:
            return KrylovResult(x if k else z, k + 1, converged=False, negative=curvature <= 0.0)
        x += product / curvature * p
        Ap *= product / curvature
        r -= Ap
        previous_rho = product
    return KrylovResult(x, max_iterations, converged=False)


def minimal_residuals(
    apply: Apply, precondition: Apply, b: Array, tolerance: float, max_iterations: int
) -> KrylovResult:
    """x of A x = b for any A, by GMRES; otherwise as `conjugate_gradients`."""
    counts, n = [0], len(b)

    def count_iteration(_: float) -> None:
        counts[0] += 1

    A = LinearOperator((n, n), matvec=apply, dtype=np.float64)
    M = LinearOperator((n, n), matvec=precondition, dtype=np.float64)
    restart = min(_RESTART, max_iterations)
    x, failed = gmres(
        A,
        b,
        rtol=tolerance,
        maxiter=-(-max_iterations // restart),
        M=M,
        restart=restart,
        callback=count_iteration,
        callback_type="pr_norm",
    )
    return KrylovResult(np.asarray(x), counts[0], converged=not failed)
