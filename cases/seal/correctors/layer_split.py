"""Split of an assembled problem into a body and a layer on its boundary.

The tangent of the layer is split into the unknowns that it shares with the body and its own. The
positions of its entries are found once for a pattern. Its own unknowns are numbered along the layer
and coupled to few others, so they are eliminated by nested dissection.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from softehl.cases.seal.correctors.nested_dissection import Elimination
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.discretisation.step_bounds import Guard

Small = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Cut:
    """Of a csc pattern with m shared unknowns, first, and k own ones.

    inside: places of its entries in the data of a larger pattern. rows, columns: of each.
    """

    m: int
    k: int
    inside: Integers
    rows: Integers
    columns: Integers

    @classmethod
    def of(cls, indptr: Small, indices: Small, m: int, size: int) -> Cut:
        """Of a csc pattern whose first `size` = m + k rows and columns count."""
        columns = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))
        rows = indices.astype(np.int64)
        inside = np.flatnonzero((rows < size) & (columns < size))
        return cls(m, size - m, inside, rows[inside], columns[inside])

    @cached_property
    def elimination(self) -> Elimination:
        """Of the own unknowns."""
        return Elimination.of(self.rows, self.columns, self.m, self.m + self.k)

    def parts(self, data: Array) -> Parts:
        """The tangent with these data of the larger pattern."""
        return Parts(self, data[self.inside])

    def placed(self, rows: Integers, columns: Integers, values: Array) -> Array:
        """Data of a tangent with these entries alone. Raises ValueError where it has none there."""
        size = self.m + self.k
        order = np.lexsort((self.rows, self.columns))
        keys, requested = self.columns[order] * size + self.rows[order], columns * size + rows
        at = np.minimum(np.searchsorted(keys, requested), len(keys) - 1)
        if not np.array_equal(keys[at], requested):
            lost = np.flatnonzero(keys[at] != requested)[0]
            raise ValueError(
                f"the layer's tangent has no entry in row {rows[lost]}, column {columns[lost]}; "
                "add an element that knows both unknowns to the layer"
            )
        return np.asarray(np.bincount(order[at], values, len(keys)), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Parts:
    """data: of the entries of the cut pattern."""

    cut: Cut
    data: Array

    @classmethod
    def of(cls, L: csc_array[np.float64], m: int) -> Parts:
        """Cut L (m + k, m + k), csc without entries that are given twice."""
        return Cut.of(L.indptr, L.indices, m, L.shape[0]).parts(L.data)

    @property
    def matrix(self) -> csc_array[np.float64]:
        """The tangent (m + k, m + k)."""
        cut, size = self.cut, self.cut.m + self.cut.k
        return csc_array((self.data, (cut.rows, cut.columns)), shape=(size, size))

    @property
    def shared(self) -> csc_array[np.float64]:
        """The first columns (m + k, m)."""
        return self.matrix[:, : self.cut.m]


@dataclass(frozen=True, eq=False)
class Layer:
    """The blocks of a layer and a small assembler for them alone.

    shared: (m,) unknowns of the layer that belong to the body too, rising. interior: (k,) those
    that only the layer has. numbers: shared, own, and what is always prescribed, as the assembler
    counts them.
    """

    names: tuple[str, ...]
    shared: Integers
    interior: Integers
    numbers: Integers
    assembler: Assembler

    @classmethod
    def of(
        cls, assembler: Assembler, names: Sequence[str], shared: Integers, interior: Integers
    ) -> Layer:
        """The layer of these blocks; every unknown of them that is not given is prescribed."""
        blocks = [assembler.block(name) for name in names]
        all_of_them = np.unique(np.concatenate([block.dofs.ravel() for block in blocks]))
        constrained = np.setdiff1d(all_of_them, np.concatenate([shared, interior]))
        numbers = np.concatenate([np.sort(shared), interior, constrained])
        compact = np.full(assembler.size, -1)
        compact[numbers] = np.arange(len(numbers))
        small = [_renumbered(block, compact) for block in blocks]
        build = Assembler.build(len(numbers), small)
        return cls(tuple(names), np.sort(shared), interior, numbers, build)

    @property
    def size(self) -> int:
        """Number of unknowns m + k."""
        return len(self.shared) + len(self.interior)

    @cached_property
    def cut(self) -> Cut:
        """Places of the entries of the tangent in the cut matrix."""
        pattern = self.assembler.pattern
        return Cut.of(pattern.indptr, pattern.indices, len(self.shared), self.size)


def _renumbered(block: ElementBlock, compact: Integers) -> ElementBlock:
    return replace(block, dofs=compact[block.dofs])


@dataclass(frozen=True, eq=False)
class Layered:
    """A problem with its layer; satisfies `LayeredProblem`.

    guards: those of the problem that concern the layer.
    """

    problem: Problem
    layer: Layer
    guards: tuple[Guard, ...] = ()

    @property
    def shared(self) -> Integers:
        """See `LayeredProblem`."""
        return self.layer.shared

    @property
    def interior(self) -> Integers:
        """See `LayeredProblem`."""
        return self.layer.interior

    def residual(self, x: Array) -> Array:
        """See `Problem`."""
        return self.problem.residual(x)

    def linearise(self, x: Array) -> tuple[Array, csc_array[np.float64]]:
        """See `Problem`."""
        return self.problem.linearise(x)

    def norm(self, r: Array) -> float:
        """See `Problem`."""
        return self.problem.norm(r)

    def scaled(self, r: Array) -> Array:
        """See `Problem`."""
        return self.problem.scaled(r)

    def beyond_rounding(self, r: Array, x: Array, K: csc_array[np.float64]) -> float:
        """See `Problem`."""
        return self.problem.beyond_rounding(r, x, K)

    def step_limit(self, x: Array, dx: Array) -> float:
        """See `Problem`."""
        return self.problem.step_limit(x, dx)

    def name_of(self, number: int) -> str:
        """See `Problem`."""
        return self.problem.name_of(number)

    def where_not_finite(self, x: Array) -> str:
        """See `Problem`."""
        return self.problem.where_not_finite(x)

    def admissible(self, x: Array) -> Array:
        """See `Problem`."""
        return self.problem.admissible(x)

    def body(self, x: Array) -> csc_array[np.float64]:
        """Tangent (n, n) of the body; rows and columns of the layer's own unknowns are unity."""
        return self._body.linearise(x)[1]

    def layer_residual(self, x: Array) -> Array:
        """Residual (m + k,) of the layer, shared unknowns first."""
        layer = self.layer
        r = layer.assembler.residual(x[layer.numbers], self.problem.parameters)
        return np.asarray(r[: layer.size])

    def layer_linearise(self, x: Array) -> tuple[Array, Parts]:
        """Residual (m + k,) of the layer, shared unknowns first, and its tangent."""
        layer = self.layer
        r, K = layer.assembler.linearise(x[layer.numbers], self.problem.parameters)
        return r[: layer.size], layer.cut.parts(K.data)

    def layer_limit(self, x: Array, dx: Array) -> float:
        """Largest fraction of the step that the guards of the layer admit."""
        return min((guard.limit(x, dx) for guard in self.guards), default=1.0)

    @cached_property
    def _body(self) -> Problem:
        without_layer = self.problem.with_parameters(**dict.fromkeys(self.layer.names))
        return without_layer.with_fixed(
            [np.union1d(self.problem.fixed, self.layer.interior)], [0.0]
        )
