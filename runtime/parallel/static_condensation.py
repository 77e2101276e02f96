"""Condensation of internal unknowns, element by element, on the way into PETSc's matrix.

As in `solve.linear.static_condensation`, the matrix solved is S = K_EE - K_EI K_II^-1 K_IE; here it
is formed from the tangents of elements, so that PETSc never sees internal unknowns, and no process
asks another one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.mpi import world
from softehl.runtime.parallel.halo_exchange import HaloExchange
from softehl.runtime.parallel.linear_solver_choice import internal_unknowns
from softehl.runtime.solve.linear.linear_solver import SingularMatrix
from softehl.runtime.solve.linear.static_condensation import inverses, most_singular


@dataclass(frozen=True, eq=False)
class ExternalUnknowns:
    """Unknowns of PETSc's vectors: all but internal ones.

    local_numbers: (k,) local numbers. exchange: of these, numbered as they stand there.
    """

    local_numbers: Integers
    exchange: HaloExchange

    @classmethod
    def of(cls, exchange: HaloExchange, assembler: Assembler) -> ExternalUnknowns:
        """Of local unknowns (m,), with elements that may have internal ones."""
        inner = internal_unknowns(assembler)
        if not inner:
            return cls(np.arange(len(exchange.numbers)), exchange)
        outer: Flags = np.ones(len(exchange.numbers), dtype=bool)
        for numbers in inner:
            outer[numbers] = False
        external, owned_external = np.flatnonzero(outer), outer[exchange.owned]
        numbers, starts = exchange.renumbered(owned_external)
        owned = (np.cumsum(outer) - 1)[exchange.owned[owned_external]]
        return cls(external, HaloExchange.of(numbers[external], owned, starts))

    @property
    def owned(self) -> Integers:
        """Local numbers of the process's own ones, in the order of its vectors."""
        return np.asarray(self.local_numbers[self.exchange.owned])


@dataclass(frozen=True, eq=False)
class InternalColumns:
    """Which columns of the elements of a block are internal unknowns, and which are not."""

    inner: Integers
    outer: Integers

    @classmethod
    def of(cls, block: ElementBlock) -> InternalColumns:
        """Of any block."""
        unknowns = list(getattr(block.kernel, "unknowns", ()))
        inner = np.array([unknowns.index(name) for name in block.internal], dtype=np.int64)
        return cls(inner, np.setdiff1d(np.arange(block.dofs.shape[1]), inner))


@dataclass(frozen=True, eq=False)
class CondensedElements:
    """Elements whose internal unknowns are eliminated.

    numbers: (n, k) local numbers of these, and others: (n, e) of the others. within: K_II
    (n, k, k). out: K_IE (n, k, e), and back: K_EI (n, e, k), without prescribed unknowns.
    """

    numbers: Integers
    others: Integers
    within: Array
    out: Array
    back: Array

    @classmethod
    def of(
        cls, columns: InternalColumns, dofs: Integers, K: Array, free: Flags
    ) -> CondensedElements:
        """Of tangents K (n, k + e, k + e)."""
        inner, outer = columns.inner, columns.outer
        others, rows = dofs[:, outer], K[:, inner]
        moving = free[others].astype(np.float64)
        out, back = rows[:, :, outer] * moving[:, None], K[:, outer][:, :, inner]
        within = np.ascontiguousarray(rows[:, :, inner])
        return cls(dofs[:, inner], others, within, out, back * moving[:, :, None])

    @cached_property
    def inverse(self) -> Array:
        """Of K_II, (n, k, k); not finite where there is none."""
        return inverses(self.within)

    @cached_property
    def coupling(self) -> Array:
        """K_II^-1 K_IE, (n, k, e): by how much the others move the internal unknowns."""
        return np.asarray(self.inverse @ self.out)

    def eliminate(self, r: Array) -> None:
        """Take off residuals (m,), in place, what internal unknowns would move by theirs."""
        moved = np.einsum("nij,nj->ni", self.inverse, r[self.numbers])
        np.subtract.at(r, self.others, np.einsum("nej,nj->ne", self.back, moved))

    def recover(self, x: Array, r: Array) -> None:
        """Put internal unknowns into x (m,), which has all others."""
        left = r[self.numbers] - np.einsum("nie,ne->ni", self.out, x[self.others])
        x[self.numbers] = np.einsum("nij,nj->ni", self.inverse, left)

    def add_product(self, y: Array, x: Array, of: Callable[[Array], Array]) -> None:
        """Add to y (m,) what K x has beyond S x; of: takes entries, or their magnitudes."""
        inner, others = x[self.numbers], x[self.others]
        row = np.einsum("nie,ne->ni", of(self.out), others)
        np.add.at(y, self.numbers, row + np.einsum("nij,nj->ni", of(self.within), inner))
        moved = inner + np.einsum("nie,ne->ni", of(self.coupling), others)
        np.add.at(y, self.others, np.einsum("nej,nj->ne", of(self.back), moved))


def require_eliminated(pieces: list[CondensedElements], exchange: HaloExchange) -> None:
    """Raise SingularMatrix on all processes where internal unknowns of any cannot be eliminated."""
    row = -1
    for piece in pieces:
        if not np.isfinite(piece.inverse).all():
            row = int(exchange.numbers[piece.numbers[most_singular(piece.within), 0]])
    row = int(max(world().allgather(row)))
    if row >= 0:
        raise SingularMatrix("internal unknowns of an element cannot be eliminated", row)
