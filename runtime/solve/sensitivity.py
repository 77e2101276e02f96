"""Sensitivities of what solves R(x, s) = 0, by the adjoint.

With K = dR/dx and the load b = dR/ds of a variation, dx = -K^-1 b, and a quantity q(x, s) has
dq/ds = q_s + q_x . dx = q_s - l . b with K^T l = q_x: one solve for each quantity.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_array

from softehl.runtime.arrays import Array
from softehl.runtime.solve.linear import LinearSolver, SparseMatrix


def adjoints(linear: LinearSolver, K: SparseMatrix, gradients: Array) -> Array:
    """Adjoints l (n, k) of quantities with the gradients q_x (n, k); raises SingularMatrix."""
    factors = linear.factorise(csc_array(K.T))
    return np.stack([factors.solve(g) for g in gradients.T], axis=1)
