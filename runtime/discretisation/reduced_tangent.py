"""The tangent in the free unknowns z of u = T z + g, and the signs that its energy has by nature.

`CondensedMap` is T with internal unknowns of elements following the others. `concave` finds
multipliers and other fields over which the energy is largest: eigenvalues and stability do not
count them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, csr_array

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.discretisation.constraints import congruent
from softehl.runtime.discretisation.problem import Problem

SYMMETRIC = 1e-8
"""Of the largest entry: a tangent that differs by less from its transpose is symmetric."""

_NOTHING = 1e-12
"""Of the pivot of a multiplier when displacements are eliminated: its own entry is rounding."""

DISPLACEMENTS = ("u_x", "u_y", "u_z")
"""Unknowns that are motions, whatever the signs of their stiffness."""


@dataclass(frozen=True, eq=False)
class CondensedMap:
    """Changes T z of all unknowns (n,), where internal unknowns of elements follow the others.

    T: (n, m), that of the constraints without columns of internal unknowns, and the rows of these
    by a tangent K, so that T' K T is condensed.
    """

    problem: Problem
    T: csr_array

    @classmethod
    def of(cls, problem: Problem, K: csc_array) -> CondensedMap:
        """By a tangent K (n, n) before supports are eliminated."""
        inner, n = _internal(problem, K), problem.assembler.size
        if not inner:
            return cls(problem, problem.constraints.T)
        T = problem.constraints.without(np.concatenate([d.ravel() for d, _ in inner])).T
        moved = [-_block_matrix(inverse, dofs, n) @ K @ T for dofs, inverse in inner]
        return cls(problem, csr_array(T + sum(moved)))

    def saddle(self, K: csc_array) -> Flags:
        """Unknowns (m,) in which the energy is not convex but concave, by nature: pressures and
        other multipliers. K: the tangent (n, n) before supports are eliminated.
        """
        return np.asarray(abs(self.T).T @ concave(self.problem, K).astype(np.float64)) > 0.0

    def matrix(self, K: csc_array) -> csc_array:
        """T' K T, (m, m)."""
        return congruent(self.T, K)

    def expand(self, z: Array) -> Array:
        """T z, (n, ...)."""
        return np.asarray(self.T @ z)


def _internal(problem: Problem, K: csc_array) -> list[tuple[Integers, Array]]:
    """Numbers (n, k) of the internal unknowns of each block with some, and the inverses (n, k, k)
    of their tangents; without blocks where these have none.
    """
    result = []
    for numbers in _internal_dofs(problem):
        inverse = _inverses(_blocks(K, numbers))
        if np.isfinite(inverse).all():
            result.append((numbers, inverse))
    return result


def _internal_dofs(problem: Problem) -> list[Integers]:
    blocks = [b for b in problem.assembler.blocks if b.internal and len(b.dofs)]
    return [np.stack(list(b.internal.values()), axis=1) for b in blocks]


def _blocks(K: csc_array, numbers: Integers) -> Array:
    """Entries of K (n, k, k) among numbers (n, k) of each element."""
    n, k = numbers.shape
    rows, columns = np.repeat(numbers, k, axis=1).ravel(), np.tile(numbers, k).ravel()
    return np.asarray(csr_array(K)[rows, columns]).reshape(n, k, k)


def _inverses(blocks: Array) -> Array:
    try:
        return np.asarray(np.linalg.inv(blocks))
    except np.linalg.LinAlgError:
        return np.full_like(blocks, np.nan)


def _block_matrix(blocks: Array, numbers: Integers, n: int) -> csr_array:
    """A matrix (n, n) of blocks (., k, k) at numbers (., k)."""
    k = numbers.shape[1]
    rows, columns = np.repeat(numbers, k, axis=1).ravel(), np.tile(numbers, k).ravel()
    return csr_array((blocks.ravel(), (rows, columns)), shape=(n, n))


def internal_negative(problem: Problem, K: csc_array) -> int:
    """Number of negative eigenvalues of the blocks of internal unknowns."""
    blocks = [_blocks(K, numbers) for numbers in _internal_dofs(problem)]
    return sum(int((np.linalg.eigvalsh(b) < 0.0).sum()) for b in blocks)


def _condensed(problem: Problem, K: csc_array) -> csc_array:
    """K (n, n) with internal unknowns of elements condensed, whose rows and columns are zero."""
    mask, n = np.ones(problem.assembler.size), problem.assembler.size
    for numbers, inverse in _internal(problem, K):
        K = csc_array(K - K @ _block_matrix(inverse, numbers, n) @ K)
        mask[numbers] = 0.0
    return K if mask.all() else csc_array(K.multiply(mask[:, None]).multiply(mask[None]))


def is_motion(name: str) -> bool:
    """True for a component of the motion of a rigid body, "grip:u_x" or "grip:theta_z"."""
    _, colon, component = name.rpartition(":")
    return bool(colon) and (component in DISPLACEMENTS or component.partition("_")[0] == "theta")


def concave(
    problem: Problem,
    K: csc_array,
    added: Callable[[Array], Array] = np.asarray,
    anywhere: Callable[[bool], bool] = bool,
) -> Flags:
    """Unknowns (n,) of multipliers and other fields over which the energy is largest, without fixed
    ones and internal ones of elements: fields no diagonal entry of which is positive when internal
    unknowns are condensed, displacements excepted. K: before supports are eliminated.

    If no field has a positive entry, those of zeros are convex (stresses beside displacements).
    One that is coupled to no other field is no multiplier, it is unstable, where its pages have
    energies; the sign of an equation that a page writes down itself says nothing. Entries that are
    rounding beside what displacements add are zero. added, anywhere: sums over processes that have
    a part each, and whether something is true on any.
    """
    layout, fixed, K = problem.layout, problem.fixed, _condensed(problem, K)
    is_concave: Flags = np.zeros(layout.total, dtype=bool)
    free = ~is_concave
    free[fixed] = False
    diagonal = added(K.diagonal())
    moving = np.zeros(layout.total)
    for name in set(DISPLACEMENTS) & set(layout.names):
        entries = diagonal[layout.part(name)]
        moving[layout.part(name)] = np.divide(
            1.0, entries, out=np.zeros_like(entries), where=entries > 0.0
        )
    pivots = added(K.multiply(K) @ moving)
    diagonal = np.where(np.abs(diagonal) > _NOTHING * pivots, diagonal, 0.0)
    inner = {name for block in problem.assembler.blocks for name in block.internal}
    named = [(name, layout.part(name)) for name in layout.names if name not in inner]
    fields = [part for name, part in named if name not in DISPLACEMENTS and not is_motion(name)]
    for part in fields:
        entries, all_fixed = diagonal[part], not anywhere(bool(free[part].any()))
        convex = (entries >= 0.0).any() if all_fixed else (entries[free[part]] > 0.0).any()
        is_concave[part] = not anywhere(bool(convex))
    if all(anywhere(bool(is_concave[part].any())) for _, part in named):
        for part in fields:
            is_concave[part] = anywhere(bool((diagonal[part] < 0.0).any()))
    others = added(abs(K) @ (~is_concave).astype(np.float64))  # a fixed unknown is no other field
    is_concave[fixed] = False
    others[_written(problem)] = 1.0
    for part in fields:
        if not anywhere(bool(others[part].any())):
            is_concave[part] = False
    return is_concave


def _written(problem: Problem) -> Integers:
    """Unknowns of pages without an energy."""
    blocks = problem.assembler.blocks
    pages = [b for b in blocks if "energy" not in getattr(b.kernel, "tasks", ("energy",))]
    return np.concatenate([np.empty(0, dtype=np.int64), *(b.dofs.ravel() for b in pages)])


def is_symmetric(K: csc_array) -> bool:
    """True if K is symmetric but for rounding."""
    return _largest(K - K.T) <= SYMMETRIC * _largest(K)


def is_symmetric_where_free(problem: Problem, K: csc_array) -> bool:
    """True if K is symmetric but for rounding, for changes that supports and ties admit.

    K: before supports are eliminated. A pressure that follows a side which ends at supports has a
    tangent that is not symmetric in the prescribed unknowns only.
    """
    skew = congruent(problem.constraints.T, csc_array(K - K.T))
    return _largest(skew) <= SYMMETRIC * _largest(K)


def symmetric(K: csc_array) -> csc_array:
    """Its symmetric part."""
    return csc_array(0.5 * (K + K.T))


def _largest(K: csc_array) -> float:
    return float(np.abs(K.data).max(initial=0.0))
