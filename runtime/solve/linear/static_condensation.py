"""Static condensation of internal unknowns of elements before the factorisation.

With K = [[K_EE, K_EI], [K_IE, K_II]], where the block K_II of internal unknowns falls into a small
one for each element, what is solved is S = K_EE - K_EI K_II^-1 K_IE; the internal unknowns follow
from the others, K_II^-1 (r_I - K_IE x_E). This is exact: a step is that of the whole matrix.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import bsr_array, csc_array, csr_array

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.solve.linear.linear_solver import (
    Factors,
    LinearSolver,
    SingularMatrix,
    SparseMatrix,
)
from softehl.runtime.solve.singularity_check import JudgesSingularity, unconstrained_unknown


@dataclass(frozen=True, eq=False)
class CondensingSolver:
    """A linear solver that condenses internal unknowns first.

    groups: (n, k) numbers of the internal unknowns of n like elements. A matrix may have rows
    beyond those of the problem, as paths by arc length do.
    """

    solver: LinearSolver
    groups: tuple[Integers, ...]

    @property
    def name(self) -> str:
        """See `LinearSolver`."""
        return self.solver.name

    def external(self, size: int) -> Integers:
        """All other unknowns of so many, rising."""
        mask: Flags = np.ones(size, dtype=bool)
        for group in self.groups:
            mask[group] = False
        return np.flatnonzero(mask)

    def factorise(self, K: SparseMatrix) -> CondensedFactors:
        """Factors of K, (n, n); raises SingularMatrix, also where internal unknowns are loose."""
        rows, parts, E = csr_array(K), [], self.external(K.shape[0])
        S = rows[E][:, E]
        for group in self.groups:
            inner = group.ravel()
            inverse, sign = block_inverse(rows[inner][:, inner], group)
            out, back = rows[inner][:, E], rows[E][:, inner]
            S = S - back @ (inverse @ out)
            parts.append(_Group(inner, inverse, csr_array(out), csr_array(back), sign))
        if not np.isfinite(S.data).all():
            raise SingularMatrix("the matrix has entries that are not finite")
        return CondensedFactors(E, tuple(parts), self.solver.factorise(csc_array(S)))


@dataclass(frozen=True, eq=False)
class _Group:
    """Like elements: numbers of internal unknowns (m,), K_II^-1, K_IE, K_EI, and the sign of the
    determinant of K_II.
    """

    inner: Integers
    inverse: bsr_array
    out: csr_array
    back: csr_array
    sign: float


@dataclass(frozen=True, eq=False)
class CondensedFactors:
    """Factors of a matrix by those of its condensed one; `external` are the unknowns of that."""

    external: Integers
    parts: tuple[_Group, ...]
    external_factors: Factors

    def solve(self, b: Array) -> Array:
        """x of K x = b, (n,)."""
        x, right = np.empty(len(b)), b[self.external]
        for part in self.parts:
            right = right - part.back @ (part.inverse @ b[part.inner])
        x[self.external] = external = self.external_factors.solve(right)
        for part in self.parts:
            x[part.inner] = part.inverse @ (b[part.inner] - part.out @ external)
        return x

    def pivots(self) -> Array | None:
        """Pivots of the rest (m,), see `Factorisation.pivots`."""
        method = getattr(self.external_factors, "pivots", None)
        return None if method is None else method()

    def sign(self) -> float | None:
        """Sign of the determinant; None where it is not known."""
        method = getattr(self.external_factors, "sign", None)
        rest_sign = None if method is None else method()
        return (
            None if rest_sign is None else rest_sign * float(np.prod([p.sign for p in self.parts]))
        )

    def indefinite(self) -> bool | None:
        """True if the rest has a negative eigenvalue; None where it is not known."""
        method = getattr(self.external_factors, "indefinite", None)
        return None if method is None else method()

    def unconstrained_unknown(self) -> int | None:
        """See `JudgesSingularity`: what K_II admits is regular, so the rest decides."""
        number = (
            self.external_factors.unconstrained_unknown()
            if isinstance(self.external_factors, JudgesSingularity)
            else self._unconstrained_external()
        )
        return None if number is None else int(self.external[number])

    def _unconstrained_external(self) -> int | None:
        matrix = getattr(self.external_factors, "matrix", None)
        return None if matrix is None else unconstrained_unknown(matrix, self.external_factors)


def block_inverse(K: csr_array, group: Integers) -> tuple[bsr_array, float]:
    """Inverse of a matrix of one block for each of n elements, and the sign of its determinant.

    Raises SingularMatrix.
    """
    n, k = group.shape
    blocks, entries = np.zeros((n, k, k)), K.tocoo()
    element = entries.row // k
    if (element != entries.col // k).any():
        raise SingularMatrix("internal unknowns of two elements know each other")
    np.add.at(blocks, (element, entries.row % k, entries.col % k), entries.data)
    inverse = inverses(blocks)
    if not np.isfinite(inverse).all():
        bad = most_singular(blocks)
        row = int(group[bad, 0])
        raise SingularMatrix(f"internal unknowns of element {bad} cannot be eliminated", row)
    where = np.arange(n)
    sign = float(np.prod(np.linalg.slogdet(blocks)[0]))
    return bsr_array((inverse, where, np.arange(n + 1)), shape=(n * k, n * k)), sign


def inverses(blocks: Array) -> Array:
    """Of matrices (n, k, k); not finite where one of them has none."""
    try:
        return np.asarray(np.linalg.inv(blocks))
    except np.linalg.LinAlgError:
        return np.full_like(blocks, np.nan)


def most_singular(blocks: Array) -> int:
    """Number of the matrix of (n, k, k) that is closest to singular."""
    sizes = np.abs(blocks).max(axis=(1, 2), initial=0.0)
    return int(np.argmin(np.abs(np.linalg.det(blocks / np.maximum(sizes, 1e-300)[:, None, None]))))
