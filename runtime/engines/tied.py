"""Ties in a tangent that is no matrix: unknowns that follow others, and the forces between them.

With the equations B x = c of the ties, their forces f and all else A, the tangent asks for
A x + B' f = r. Changes that ties admit are T z, so that conjugate gradients find z from T' A T.
Forces follow from B' f = r - A x.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array
from scipy.sparse.csgraph import connected_components

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.fem.loads import Tie
from softehl.runtime.fem.problem import Problem
from softehl.runtime.solve.backends import choose
from softehl.runtime.solve.linear import Factors


@dataclass(frozen=True, eq=False)
class Follow:
    """Unknowns of a level that follow others there: T, place by place.

    moving: (n,) whether an unknown is one of z. behind: (k,) places of those that follow, and
    ahead: (k,) of those that they follow.
    """

    moving: Flags
    behind: Integers
    ahead: Integers

    def spread(self, x: Array) -> None:
        """T x in place: those behind take the value of those ahead."""
        x[self.behind] = x[self.ahead]

    def gather(self, y: Array) -> None:
        """T' y in place: those ahead take the sum."""
        np.add.at(y, self.ahead, y[self.behind])

    @property
    def matrix(self) -> csr_array:
        """T, (n, n), of zeros and ones; columns of unknowns that are none of z are empty."""
        own = np.flatnonzero(self.moving)
        rows, columns = np.append(own, self.behind), np.append(own, self.ahead)
        n = len(self.moving)
        return csr_array(coo_array((np.ones(len(rows)), (rows, columns)), (n, n)))


@dataclass(frozen=True, eq=False)
class Ties:
    """All ties of a problem, maybe none.

    whole: (n, n) their part of the tangent. equations: B, (k, n), without prescribed unknowns, and
    normal: factors of B B'. forces: (k,) numbers of the forces. free: (n,) whether an unknown
    moves: it is no force, not prescribed, and tied to none that is. follows: of every level.
    """

    whole: csr_array
    equations: csr_array
    normal: Factors | None
    forces: Integers
    free: Flags
    follows: tuple[Follow, ...]

    @classmethod
    def of(cls, problem: Problem, levels: Sequence[Integers]) -> Ties:
        """Of a problem, for levels of unknowns of these numbers.

        Raises StudyError where a tie follows from others.
        """
        n, found = problem.assembler.size, [np.empty((0, 3), dtype=np.int64)]
        found += [b.dofs for b in problem.assembler.blocks if isinstance(b.kernel, Tie)]
        a, b, forces = np.concatenate(found).T
        _require_independent(a, b, problem)
        free: Flags = np.ones(n, dtype=bool)
        free[problem.fixed] = free[forces] = False
        k, ones = len(a), np.ones(len(a))
        rows = np.tile(np.arange(k), 2)
        B = csr_array(coo_array((np.append(ones, -ones), (rows, np.append(a, b))), (k, n)))
        spread = csr_array((ones, (forces, np.arange(k))), shape=(n, k)) @ B
        own = csr_array(B.multiply(free.astype(np.float64)[None]))
        normal = choose("auto").factorise(csc_array(own @ own.T)) if k else None
        groups = _groups(a, b, n)
        still = np.zeros(n, dtype=bool)
        still[groups[problem.fixed]] = True
        free &= ~still[groups]
        follows = tuple(_follow(free[numbers], groups[numbers]) for numbers in levels)
        return cls(csr_array(spread + spread.T), own, normal, forces, free, follows)

    def shift(self, r: Array) -> Array:
        """The least x, (n,), of B x = r of the ties."""
        if self.normal is None:
            return np.zeros_like(r)
        return np.asarray(self.equations.T @ self.normal.solve(r[self.forces]))

    def put_forces(self, x: Array, left: Array) -> None:
        """Put into x the forces f of B' f = left, (n,), as well as they can."""
        if self.normal is not None:
            x[self.forces] = self.normal.solve(self.equations @ left)


def _groups(a: Integers, b: Integers, n: int) -> Integers:
    """Number of the group of each of n unknowns, of which a and b are tied."""
    graph = csr_array((np.ones(len(a)), (a, b)), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _follow(free: Flags, groups: Integers) -> Follow:
    """The first unknown of each group goes ahead of those that are there."""
    _, first, inverse = np.unique(groups, return_index=True, return_inverse=True)
    ahead = first[inverse]
    behind = np.flatnonzero(free & (ahead != np.arange(len(free))))
    moving = free.copy()
    moving[behind] = False
    return Follow(moving, behind, ahead[behind])


def _require_independent(a: Integers, b: Integers, problem: Problem) -> None:
    """Raise StudyError where a tie follows from others: all prescribed unknowns are as one."""
    n = problem.assembler.size
    node = np.arange(n + 1)
    node[problem.fixed] = n
    groups = _groups(node[a], node[b], n + 1)
    edges, members = np.bincount(groups[node[a]], minlength=n + 1), np.bincount(groups)
    wrong = np.flatnonzero(edges[: len(members)] >= members)
    if len(wrong):
        first = int(np.flatnonzero((groups[node] == wrong[0])[:n])[0])
        raise StudyError(
            f"tie: {problem.name_of(first)} is tied in a circle, so that one tie follows from the "
            "others: leave one of them out"
        )
