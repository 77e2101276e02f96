"""The coarsest level of multigrid: algebraic multigrid where pyamg is installed, else factors."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from scipy.sparse import bsr_array, csc_array, csr_array

from softehl.runtime.arrays import Array
from softehl.runtime.solve.backends import choose
from softehl.runtime.solve.linear import SingularMatrix
from softehl.runtime.solve.multigrid import Apply

DIRECT_BELOW = 5_000
"""Unknowns up to which factors are faster than algebraic multigrid, whose answer is not exact."""


def coarse_solver(A: csr_array, near: Array, block: int) -> Apply:
    """A function that solves A x = b, at least about.

    near: (n, k) motions that A hardly resists. block: unknowns of a node, which are neighbours.
    Raises SingularMatrix.
    """
    amg = None if A.shape[0] < DIRECT_BELOW else _pyamg()
    if amg is None:
        factors = choose("auto").factorise(csc_array(A))
        return factors.solve
    if not np.isfinite(A.data).all():
        raise SingularMatrix("the matrix has entries that are not finite")
    blocks = bsr_array(A, blocksize=(block, block))
    matrix: Any = blocks
    solver = amg.smoothed_aggregation_solver(
        matrix,
        B=near,
        strength=("symmetric", {"theta": 0.0}),
        smooth=("jacobi", {"omega": 4.0 / 3.0}),
        presmoother=("block_gauss_seidel", {"sweep": "symmetric"}),
        postsmoother=("block_gauss_seidel", {"sweep": "symmetric"}),
        max_coarse=500,
        coarse_solver="splu",  # its own choice, a pseudo-inverse, takes ten seconds
    )
    cycle = solver.aspreconditioner(cycle="V")
    return lambda b: np.asarray(cycle @ b)


def _pyamg() -> Any:
    """The package, or None where it is not installed."""
    try:
        return import_module("pyamg")
    except ImportError:
        return None
