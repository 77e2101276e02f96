"""The coarsest level of multigrid: algebraic multigrid where pyamg is installed, else factors."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_array, csr_array

from softehl.runtime.arrays import Array
from softehl.runtime.solve.linear.amg import available, hierarchy
from softehl.runtime.solve.linear.direct import direct_solver
from softehl.runtime.solve.linear.linear_solver import SingularMatrix
from softehl.runtime.solve.linear.multigrid import Apply

DIRECT_BELOW = 5_000
"""Unknowns up to which factors are faster than algebraic multigrid, whose answer is not exact."""


def coarse_solver(A: csr_array, nullspace: Array, block: int) -> Apply:
    """A function that solves A x = b, at least about.

    nullspace: (n, k) near null space. block: unknowns of a node, which are neighbours.
    Raises SingularMatrix.
    """
    if A.shape[0] < DIRECT_BELOW or not available():
        factors = direct_solver("auto").factorise(csc_array(A))
        return factors.solve
    if not np.isfinite(A.data).all():
        raise SingularMatrix("the matrix has entries that are not finite")
    # K/mu = 1000, 200,000 unknowns above: light cycles 171 iterations in 5.2 s, others 167 in 6.2 s
    cycle = hierarchy(A, nullspace, block, light=True).aspreconditioner(cycle="V")
    return lambda b: np.asarray(cycle @ b)
