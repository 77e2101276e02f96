"""Free unknowns of a problem: without prescribed ones, tied ones as one, no multipliers of ties."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, csr_array
from scipy.sparse.csgraph import connected_components

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.fem.loads import Tie
from softehl.runtime.fem.problem import Problem

SYMMETRIC = 1e-8
"""Of the largest entry: a tangent that differs by less from its transpose is symmetric."""


@dataclass(frozen=True, eq=False)
class Reduction:
    """Changes of all unknowns (n,) that supports and ties admit, T z with z (m,).

    problem: of which. map: T, (n, m), of zeros and ones.
    """

    problem: Problem
    map: csr_array

    @classmethod
    def of(cls, problem: Problem) -> Reduction:
        """Of a problem."""
        n, ties = problem.assembler.size, [np.empty((0, 3), dtype=np.int64)]
        ties += [b.dofs for b in problem.assembler.blocks if isinstance(b.kernel, Tie)]
        a, b, multipliers = np.concatenate(ties).T
        graph = csr_array((np.ones(len(a)), (a, b)), shape=(n, n))
        count, group = connected_components(graph, directed=False)
        held: Flags = np.zeros(count, dtype=bool)
        held[group[problem.fixed]] = held[group[multipliers]] = True
        number = np.cumsum(~held) - 1
        rows = np.flatnonzero(~held[group])
        columns = number[group[rows]]
        found = csr_array((np.ones(len(rows)), (rows, columns)), shape=(n, int((~held).sum())))
        return cls(problem, found)

    def gather(self, forces: Array) -> Array:
        """T' f, (m,)."""
        return np.asarray(self.map.T @ forces)

    def spread(self, z: Array) -> Array:
        """T z, (n,)."""
        return np.asarray(self.map @ z)

    def saddle(self, K: csc_array) -> Flags:
        """Unknowns (m,) in which the energy is not convex but concave, by nature: pressures and
        other multipliers. K: the tangent (n, n) before supports are eliminated.
        """
        return self.gather(concave(self.problem, K).astype(np.float64)) > 0.0

    def matrix(self, K: csc_array) -> csc_array:
        """T' K T, (m, m)."""
        return csc_array(self.map.T @ K @ self.map)


def concave(
    problem: Problem,
    K: csc_array,
    added: Callable[[Array], Array] = np.asarray,
    anywhere: Callable[[bool], bool] = bool,
) -> Flags:
    """Unknowns (n,) of the fields no diagonal entry of which is positive, without fixed ones.

    One that is coupled to no other field is no multiplier, it is unstable, where its pages have
    energies; the sign of an equation that a page writes down itself says nothing. added, anywhere:
    sums over processes that have a part each, and whether something is true on any.
    """
    layout, fixed = problem.layout, problem.fixed
    found: Flags = np.zeros(layout.total, dtype=bool)
    free = ~found
    free[fixed] = False
    diagonal = added(K.diagonal())
    for part in layout.fields:
        own, held = diagonal[part], not anywhere(bool(free[part].any()))
        convex = (own >= 0.0).any() if held else (own[free[part]] > 0.0).any()
        found[part] = not anywhere(bool(convex))
    others = added(abs(K) @ (~found).astype(np.float64))  # a fixed unknown is no other field
    found[fixed] = False
    others[_written(problem)] = 1.0
    for part in layout.fields:
        if not anywhere(bool(others[part].any())):
            found[part] = False
    return found


def _written(problem: Problem) -> Integers:
    """Unknowns of pages without an energy."""
    blocks = problem.assembler.blocks
    pages = [b for b in blocks if "energy" not in getattr(b.kernel, "tasks", ("energy",))]
    return np.concatenate([np.empty(0, dtype=np.int64), *(b.dofs.ravel() for b in pages)])


def is_symmetric(K: csc_array) -> bool:
    """True if K is its transpose but for rounding."""
    return _largest(K - K.T) <= SYMMETRIC * _largest(K)


def symmetric(K: csc_array) -> csc_array:
    """Its symmetric part."""
    return csc_array(0.5 * (K + K.T))


def _largest(K: csc_array) -> float:
    return float(np.abs(K.data).max(initial=0.0))
