"""Constraints: the one affine map of unknowns, u = T z + g, that every engine eliminates with.

g has the prescribed (Dirichlet) values. T has a column for each free unknown z, and makes tied
unknowns (ties, periodic sides, sides that move as one) equal; multipliers, prescribed unknowns and
what is tied to them have no z. `Problem.constraints` has those of a problem. The level of a
multigrid and the part of a process are `restricted` to their unknowns.

- Prescribed values: `residual` and `tangent` eliminate them from the equations that are solved.
- Ties: equations B x = c with forces f stand in the tangent with all else A, which asks for
  A x + B' f = r. Direct solvers take them as they are. Eigenvalues, stability, explicit dynamics
  and multigrid find z from T' A T (`expand`, `gather`, `congruent`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Protocol

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.loads import Tie
from softehl.runtime.discretisation.problem_checks import ProblemError


class Exchange(Protocol):
    """Unknowns z that several processes share: `parallel.halo_exchange.HaloExchange`."""

    def added(self, x: Array) -> Array:
        """Own sums of z, (k,), of what each process has for its free unknowns."""
        ...

    def copied(self, owned_values: Array) -> Array:
        """Values of the free unknowns of this process from own z, (k,)."""
        ...


@dataclass(frozen=True, eq=False)
class Constraints:
    """The map u = T z + g of unknowns (n,): of a problem, of a part of it, or of a level.

    fixed, values: (k,) prescribed unknowns, and g there; elsewhere it is zero. free: (n,) whether
    an unknown moves with z. group: (n,) one number for unknowns that are tied. exchange: of z over
    processes; None where all z are here.
    """

    fixed: Integers
    values: Array
    free: Flags
    group: Integers
    exchange: Exchange | None = None

    @classmethod
    def of(cls, assembler: Assembler, fixed: Integers, values: Array) -> Constraints:
        """Of prescribed values and the ties among elements."""
        a, b, multipliers = tie_dofs(assembler).T
        group = tied_groups(a, b, assembler.size)
        constrained: Flags = np.zeros(assembler.size, dtype=bool)
        constrained[group[fixed]] = constrained[multipliers] = True
        return cls(fixed, values, ~constrained[group], group)

    def restricted(self, numbers: Integers) -> Constraints:
        """Of some of the unknowns, (m,), in this order."""
        fixed = np.flatnonzero(self.prescribed[numbers])
        values = self.g[numbers[fixed]]
        return Constraints(fixed, values, self.free[numbers], self.group[numbers])

    def without(self, numbers: Integers) -> Constraints:
        """Constraints with no z for these unknowns and what is tied to them."""
        constrained: Flags = np.zeros(len(self.free), dtype=bool)
        constrained[self.group[numbers]] = True
        return replace(self, free=self.free & ~constrained[self.group])

    # Prescribed values

    @cached_property
    def prescribed(self) -> Flags:
        """True for prescribed unknowns, (n,)."""
        flags: Flags = np.zeros(len(self.free), dtype=bool)
        flags[self.fixed] = True
        return flags

    @cached_property
    def g(self) -> Array:
        """Prescribed values, (n,), zero elsewhere."""
        g = np.zeros(len(self.free))
        g[self.fixed] = self.values
        return g

    def admissible(self, x: Array) -> Array:
        """A copy of unknowns (n,) with the prescribed values."""
        y = x.copy()
        y[self.fixed] = self.values
        return y

    def deviation(self, x: Array) -> Array:
        """x - g of prescribed unknowns, (n,), zero elsewhere."""
        deviation = np.zeros_like(x)
        deviation[self.fixed] = x[self.fixed] - self.values
        return deviation

    def residual(
        self, r: Array, deviation: Array, times: Callable[[Array], Array] | None = None
    ) -> Array:
        """Residual (n,) with the equations x - g = 0 of prescribed unknowns.

        times: the product with the tangent, which moves the influence of the deviation into the
        other equations; left out, they stay as they are.
        """
        if times is not None and deviation.any():
            r = r - times(deviation)
        r[self.fixed] = deviation[self.fixed]
        return r

    def tangent(self, K: csc_array, assembler: Assembler) -> csc_array:
        """K with rows and columns of prescribed unknowns replaced by those of the identity.

        K: of the assembler's pattern; it is changed.
        """
        if len(self.fixed):
            K.data[assembler.cross(self.fixed)] = 0.0
            K.data[assembler.pattern.diagonal[self.fixed]] = 1.0
        return K

    # Free unknowns

    @cached_property
    def masters(self) -> Integers:
        """The first unknown of the group of each, (n,)."""
        _, first, inverse = np.unique(self.group, return_index=True, return_inverse=True)
        return np.asarray(first[inverse], dtype=np.int64)

    @cached_property
    def slaves(self) -> Integers:
        """Free unknowns that follow another one."""
        return np.flatnonzero(self.free & (self.masters != np.arange(len(self.free))))

    @cached_property
    def moving(self) -> Flags:
        """True for unknowns that are one of z, (n,)."""
        moving = self.free.copy()
        moving[self.slaves] = False
        return moving

    def copy_to_slaves(self, x: Array) -> None:
        """T z in place: slaves take the value of their masters."""
        x[self.slaves] = x[self.masters[self.slaves]]

    def collect(self, y: Array) -> None:
        """T' f in place: masters take the sum."""
        np.add.at(y, self.masters[self.slaves], y[self.slaves])

    def expand(self, z: Array) -> Array:
        """T z, (n,)."""
        x = np.zeros(len(self.free))
        if self.exchange is not None:
            x[self.free] = self.exchange.copied(z)
        else:
            x[self.moving] = z
            self.copy_to_slaves(x)
        return x

    def gather(self, forces: Array) -> Array:
        """T' f of forces (n,): (m,), own ones of several processes."""
        if self.exchange is not None:
            return self.exchange.added(forces[self.free])
        y = forces.copy()
        self.collect(y)
        return np.asarray(y[self.moving])

    @cached_property
    def square(self) -> csr_array:
        """T as a matrix (n, n), of zeros and ones; columns of unknowns that are none of z are
        empty.
        """
        free, n = np.flatnonzero(self.free), len(self.free)
        entries = np.ones(len(free)), (free, self.masters[free])
        return csr_array(coo_array(entries, shape=(n, n)))

    @cached_property
    def T(self) -> csr_array:
        """T as a matrix (n, m), of zeros and ones."""
        free = np.flatnonzero(self.free)
        columns = (np.cumsum(self.moving) - 1)[self.masters[free]]
        shape = len(self.free), int(self.moving.sum())
        return csr_array((np.ones(len(free)), (free, columns)), shape=shape)


def congruent(T: csr_array, K: csc_array) -> csc_array:
    """T' K T, (m, m)."""
    return csc_array(T.T @ K @ T)


def tie_dofs(assembler: Assembler) -> Integers:
    """Unknowns a and b of all ties and their multipliers, (t, 3)."""
    ties = [b.dofs for b in assembler.blocks if isinstance(b.kernel, Tie)]
    return np.concatenate([np.empty((0, 3), dtype=np.int64), *ties])


def tied_groups(a: Integers, b: Integers, n: int) -> Integers:
    """Group of each of n unknowns (n,), of which a and b, (t,) each, are tied: its first one."""
    group = _own_groups(n)
    while (group[a] != group[b]).any():
        lower, hooked = np.minimum(group[a], group[b]), group.copy()
        np.minimum.at(hooked, group[a], lower)
        np.minimum.at(hooked, group[b], lower)
        group = hooked[hooked]
    return group


@lru_cache(maxsize=4)
def _own_groups(n: int) -> Integers:
    """Each of n unknowns by itself, (n,): one array for all steps of a path."""
    group = np.arange(n)
    group.flags.writeable = False
    return group


def require_prescribed(
    fixed: Integers, values: Array, n: int, name_of: Callable[[int], str]
) -> None:
    """Raise ProblemError for prescribed values that no unknowns (n,) can have."""
    if np.shape(fixed) != np.shape(values) or np.ndim(fixed) != 1:
        raise ProblemError(
            f"fixed has shape {np.shape(fixed)} and values {np.shape(values)}: they are "
            "lists of one length"
        )
    if len(fixed) and not 0 <= fixed.min() <= fixed.max() < n:
        raise ProblemError(f"fixed: unknowns are numbered from 0 to {n - 1}")
    if not np.isfinite(values).all():
        first = int(fixed[~np.isfinite(values)][0])
        raise ProblemError(f"{name_of(first)} is prescribed to a value that is not finite")
    order = np.argsort(fixed, kind="stable")
    same = fixed[order][1:] == fixed[order][:-1]
    differ = np.flatnonzero(same & (values[order][1:] != values[order][:-1]))
    if len(differ):
        one, other = order[differ[0]], order[differ[0] + 1]
        raise ProblemError(
            f"{name_of(int(fixed[one]))} is prescribed twice, to {float(values[one]):g} and to "
            f"{float(values[other]):g}"
        )


def require_independent_ties(assembler: Assembler, prescribed: Flags) -> None:
    """Raise ProblemError that names a tie which follows from others: they form a circle.

    prescribed: (n,) flags; all prescribed unknowns are as one.
    """
    first = 0
    number = dependent_tie(tie_dofs(assembler), prescribed)
    if number is None:
        return
    for block in assembler.blocks:
        if isinstance(block.kernel, Tie):
            if number < first + len(block.dofs):
                position = ", ".join(f"{x:.4g}" for x in block.coordinates[number - first])
                raise ProblemError(
                    f"{block.name}: the node at ({position}) is tied in a circle, so that one tie "
                    "follows from the others: leave one of them out"
                )
            first += len(block.dofs)


def dependent_tie(ties: Integers, prescribed: Flags) -> int | None:
    """The number of the first of ties (t, 3) that closes a circle of ties, None without any.

    Equations of a circle are dependent: every engine would meet a singular matrix.
    """
    n = len(prescribed)
    node = np.where(np.append(prescribed, True), n, np.arange(n + 1))
    a, b = node[ties[:, 0]], node[ties[:, 1]]
    groups = tied_groups(a, b, n + 1)
    n_edges = np.bincount(groups[a], minlength=n + 1)
    n_members = np.bincount(groups, minlength=n + 1)
    if not ((n_edges > 0) & (n_edges >= n_members)).any():
        return None
    parents: dict[int, int] = {}
    for k, pair in enumerate(zip(a.tolist(), b.tolist(), strict=True)):
        one, other = (_root(parents, x) for x in pair)
        if one == other:
            return k
        parents[one] = other
    return None


def _root(parents: dict[int, int], x: int) -> int:
    while x in parents:
        x = parents[x]
    return x
