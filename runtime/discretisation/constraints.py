"""Constraints of a problem as one map of its unknowns, u = T z + g, of prescribed values and ties.

`Constraints` is the map to the free unknowns z, as a matrix: without prescribed unknowns and
multipliers of ties, tied unknowns as one, internal unknowns of elements condensed; the prescribed
values g are those of the problem. `LevelConstraints` is T for every level of multigrid, where no
matrix is formed. With the equations B x = c of the ties, their forces f and all else A, the tangent
asks for A x + B' f = r. Changes that ties admit are T z, so that conjugate gradients find z from
T' A T. Forces follow from B' f = r - A x (`Ties`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array
from scipy.sparse.csgraph import connected_components

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.discretisation.loads import Tie
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.discretisation.problem_checks import ProblemError
from softehl.runtime.solve.linear.direct import direct_solver
from softehl.runtime.solve.linear.linear_solver import Factors

SYMMETRIC = 1e-8
"""Of the largest entry: a tangent that differs by less from its transpose is symmetric."""

_NOTHING = 1e-12
"""Of the pivot of a multiplier when displacements are eliminated: its own entry is rounding."""

DISPLACEMENTS = ("u_x", "u_y", "u_z")
"""Unknowns that are motions, whatever the signs of their stiffness."""


@dataclass(frozen=True, eq=False)
class Constraints:
    """Changes of all unknowns (n,) that supports and ties admit, T z with z (m,).

    problem: of which. map: T, (n, m), of zeros and ones.
    """

    problem: Problem
    map: csr_array

    @classmethod
    def of(cls, problem: Problem, K: csc_array | None = None) -> Constraints:
        """Of a problem. K: the tangent (n, n) by which internal unknowns of elements follow the
        others: T' K T is then condensed. Left out, they are free unknowns as all others are.
        """
        n, ties = problem.assembler.size, [np.empty((0, 3), dtype=np.int64)]
        ties += [b.dofs for b in problem.assembler.blocks if isinstance(b.kernel, Tie)]
        a, b, multipliers = np.concatenate(ties).T
        group = tied_groups(a, b, n)
        constrained: Flags = np.zeros(int(group.max(initial=-1)) + 1, dtype=bool)
        constrained[group[problem.fixed]] = constrained[group[multipliers]] = True
        inner = [] if K is None else _internal(problem, K)
        for numbers, _ in inner:
            constrained[group[numbers]] = True
        number = np.cumsum(~constrained) - 1
        rows = np.flatnonzero(~constrained[group])
        columns = number[group[rows]]
        T = csr_array((np.ones(len(rows)), (rows, columns)), shape=(n, int((~constrained).sum())))
        if inner:
            assert K is not None
            moved = [-_block_matrix(inverse, numbers, n) @ K @ T for numbers, inverse in inner]
            T = csr_array(T + sum(moved))
        return cls(problem, T)

    def gather(self, forces: Array) -> Array:
        """T' f, (m,)."""
        return np.asarray(self.map.T @ forces)

    def expand(self, z: Array) -> Array:
        """T z, (n,)."""
        return np.asarray(self.map @ z)

    def saddle(self, K: csc_array) -> Flags:
        """Unknowns (m,) in which the energy is not convex but concave, by nature: pressures and
        other multipliers. K: the tangent (n, n) before supports are eliminated.
        """
        return np.asarray(abs(self.map).T @ concave(self.problem, K).astype(np.float64)) > 0.0

    def matrix(self, K: csc_array) -> csc_array:
        """T' K T, (m, m)."""
        return csc_array(self.map.T @ K @ self.map)


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
    fields = [part for name, part in named if name not in DISPLACEMENTS]
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
    skew = Constraints.of(problem).matrix(csc_array(K - K.T))
    return _largest(skew) <= SYMMETRIC * _largest(K)


def symmetric(K: csc_array) -> csc_array:
    """Its symmetric part."""
    return csc_array(0.5 * (K + K.T))


def _largest(K: csc_array) -> float:
    return float(np.abs(K.data).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class LevelConstraints:
    """Constraints of the unknowns of a level of multigrid: T, unknown by unknown.

    moving: (n,) whether an unknown is one of z. slaves: (k,) places of those that follow, and
    masters: (k,) of those that they follow.
    """

    moving: Flags
    slaves: Integers
    masters: Integers

    def expand(self, x: Array) -> None:
        """T x in place: those behind take the value of those ahead."""
        x[self.slaves] = x[self.masters]

    def gather(self, y: Array) -> None:
        """T' y in place: those ahead take the sum."""
        np.add.at(y, self.masters, y[self.slaves])

    @property
    def matrix(self) -> csr_array:
        """T, (n, n), of zeros and ones; columns of unknowns that are none of z are empty."""
        masters = np.flatnonzero(self.moving)
        rows, columns = np.append(masters, self.slaves), np.append(masters, self.masters)
        n = len(self.moving)
        return csr_array(coo_array((np.ones(len(rows)), (rows, columns)), (n, n)))


@dataclass(frozen=True, eq=False)
class Ties:
    """All ties of a problem, maybe none.

    matrix: (n, n) their part of the tangent. equations: B, (k, n), without prescribed unknowns, and
    normal: factors of B B'. forces: (k,) numbers of the forces. free: (n,) whether an unknown
    moves: it is no force, not prescribed, and tied to none that is. follows: of every level.
    """

    matrix: csr_array
    equations: csr_array
    normal: Factors | None
    forces: Integers
    free: Flags
    follows: tuple[LevelConstraints, ...]

    @classmethod
    def of(cls, problem: Problem, levels: Sequence[Integers]) -> Ties:
        """Of a problem, for levels of unknowns of these numbers.

        Raises ProblemError where a tie follows from others.
        """
        n, ties = problem.assembler.size, [np.empty((0, 3), dtype=np.int64)]
        ties += [b.dofs for b in problem.assembler.blocks if isinstance(b.kernel, Tie)]
        a, b, forces = np.concatenate(ties).T
        _require_independent(a, b, problem)
        free: Flags = np.ones(n, dtype=bool)
        free[problem.fixed] = free[forces] = False
        k, ones = len(a), np.ones(len(a))
        rows = np.tile(np.arange(k), 2)
        B = csr_array(coo_array((np.append(ones, -ones), (rows, np.append(a, b))), (k, n)))
        coupling = csr_array((ones, (forces, np.arange(k))), shape=(n, k)) @ B
        free_equations = csr_array(B.multiply(free.astype(np.float64)[None]))
        normal = (
            direct_solver("auto").factorise(csc_array(free_equations @ free_equations.T))
            if k
            else None
        )
        groups = tied_groups(a, b, n)
        group_fixed = np.zeros(n, dtype=bool)
        group_fixed[groups[problem.fixed]] = True
        free &= ~group_fixed[groups]
        follows = tuple(_follow(free[numbers], groups[numbers]) for numbers in levels)
        return cls(csr_array(coupling + coupling.T), free_equations, normal, forces, free, follows)

    def shift(self, r: Array) -> Array:
        """The least x, (n,), of B x = r of the ties."""
        if self.normal is None:
            return np.zeros_like(r)
        return np.asarray(self.equations.T @ self.normal.solve(r[self.forces]))

    def put_forces(self, x: Array, left: Array) -> None:
        """Put into x the forces f of B' f = left, (n,), in the sense of least squares."""
        if self.normal is not None:
            x[self.forces] = self.normal.solve(self.equations @ left)


def tied_groups(a: Integers, b: Integers, n: int) -> Integers:
    """Group of each of n unknowns (n,), of which a and b, (k,) each, are tied."""
    graph = csr_array((np.ones(len(a)), (a, b)), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _follow(free: Flags, groups: Integers) -> LevelConstraints:
    """Constraints of a level: the first free unknown of each group is the master."""
    _, first, inverse = np.unique(groups, return_index=True, return_inverse=True)
    masters = first[inverse]
    slaves = np.flatnonzero(free & (masters != np.arange(len(free))))
    moving = free.copy()
    moving[slaves] = False
    return LevelConstraints(moving, slaves, masters[slaves])


def _require_independent(a: Integers, b: Integers, problem: Problem) -> None:
    """Raise ProblemError where a tie follows from others: all prescribed unknowns are as one."""
    n = problem.assembler.size
    node = np.arange(n + 1)
    node[problem.fixed] = n
    groups = tied_groups(node[a], node[b], n + 1)
    edges, members = np.bincount(groups[node[a]], minlength=n + 1), np.bincount(groups)
    dependent = np.flatnonzero(edges[: len(members)] >= members)
    if len(dependent):
        first = int(np.flatnonzero((groups[node] == dependent[0])[:n])[0])
        raise ProblemError(
            f"tie: {problem.name_of(first)} is tied in a circle, so that one tie follows from the "
            "others: leave one of them out"
        )
