"""The lowest modes of matrices too large for factors: LOBPCG with algebraic multigrid."""

from __future__ import annotations

import warnings

import numpy as np
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import LinearOperator, lobpcg

from softehl.runtime.arrays import Array
from softehl.runtime.solve.eigen import NoModes, require_count, signed, terms, without_rounding
from softehl.runtime.solve.linear.amg import AlgebraicMultigrid, NearNullspace

_EXACT = 1e-5
"""Of the residual of a mode, relative to its inertia: the error of its square is about the square
of that."""
_ROUND, _ROUNDS = 15, 10  # iterations until residuals are looked at, and how often


def lowest_modes(
    K: csc_array, M: csc_array, modes: NearNullspace, count: int
) -> tuple[Array, Array]:
    """As `eigen.lowest`: of K, (n, n), with rows of the identity where unknowns are prescribed.

    Raises NoModes, SingularMatrix.
    """
    factors = AlgebraicMultigrid(modes).factorise(K)
    A, grids, order = factors.matrix, factors.grids, factors.order
    cycle, moving = grids.of(A).aspreconditioner(cycle="V"), np.where(grids.prescribed, 0.0, 1.0)
    scale = diags_array(grids.scale * moving)
    B = (scale @ csc_array(M)[order][:, order] @ scale).tocsr()
    require_count(count, int((B.diagonal() > 0.0).sum()))

    def preconditioned(V: Array) -> Array:
        return np.stack([moving * (cycle @ np.ascontiguousarray(v)) for v in V.T], axis=1)

    P = LinearOperator(
        A.shape, lambda v: preconditioned(v.reshape(-1, 1)), matmat=preconditioned, dtype=float
    )
    # modes beyond those asked for, so that equal frequencies at the end do not hold them up
    begin = np.random.default_rng(0).uniform(-1.0, 1.0, (len(order), count + 2 + count // 3))
    X: Array = preconditioned(begin)
    tolerance = 0.0
    for _ in range(_ROUNDS):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # residuals are looked at below
            result = lobpcg(A, X, B=B, M=P, tol=tolerance, maxiter=_ROUND, largest=False)
        values, X = (np.asarray(part, dtype=np.float64) for part in result[:2])
        inertia = np.abs(values).max() * np.linalg.norm(B @ X, axis=0)
        left = np.linalg.norm(A @ X - (B @ X) * values, axis=0)
        if (left <= _EXACT * inertia)[np.argsort(values)[:count]].all():
            break
        tolerance = 0.5 * _EXACT * float(inertia.min())
    else:
        raise NoModes(
            f"{count} modes: multigrid left {(left / inertia).max():.1e} of them after "
            f'{_ROUNDS * _ROUND} iterations; use linear = "direct"'
        )
    order_of_values, shapes = np.argsort(values)[:count], np.zeros((count, len(order)))
    shapes[:, order] = ((grids.scale * moving)[:, None] * X[:, order_of_values]).T
    sizes = np.sqrt(np.einsum("kn,kn->k", shapes, (M @ shapes.T).T))
    shapes /= sizes[:, None]
    return without_rounding(values[order_of_values], terms(K, shapes)), signed(shapes)
