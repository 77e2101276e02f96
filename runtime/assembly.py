"""Assembly of element kernels into a residual vector and a sparse tangent.

The sparsity pattern and the position of every element entry in it are computed once; assembling
is then one gather, one kernel call and one `bincount` for each block of like elements.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array

from runtime.rules import Rule

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

_FEW = 8  # entries of a block, over those of the matrix, below which they are added one by one


class ElementKernel(Protocol):
    """What assembly needs of a compiled kernel; arrays are batched over n elements."""

    @property
    def name(self) -> str:
        """Family of the kernel."""
        ...

    @property
    def signature(self) -> str:
        """Identity of the compiled code."""
        ...

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of the parameter array."""
        ...

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields of `fields_at`."""
        ...

    def residual(
        self,
        coordinates: Array,
        dofs: Array,
        *,
        data: Array | None = None,
        parameters: Array,
        rule: Rule | None = None,
    ) -> Array:
        """Element residuals (n, ndof)."""
        ...

    def tangent(
        self,
        coordinates: Array,
        dofs: Array,
        *,
        data: Array | None = None,
        parameters: Array,
        rule: Rule | None = None,
    ) -> tuple[Array, Array]:
        """Element residuals (n, ndof) and tangents (n, ndof, ndof)."""
        ...

    def fields_at(
        self,
        coordinates: Array,
        dofs: Array,
        *,
        data: Array | None = None,
        parameters: Array,
        rule: Rule | None = None,
    ) -> Array:
        """Fields at the quadrature points (n, points, len(fields))."""
        ...


@dataclass(frozen=True, eq=False)
class ElementBlock:
    """Like elements of one kernel.

    name: by which parameters are given. coordinates: (n, 2 nodes) reference (z, r), node by node.
    dofs: (n, ndof) numbers of the unknowns. data: (n, k) constants of each element or None.
    rule: quadrature rule, None for the kernel's own. constant: the tangent depends on parameters
    alone, so that it is evaluated once for each set of them.
    """

    name: str
    kernel: ElementKernel
    coordinates: Array
    dofs: Integers
    data: Array | None = None
    rule: Rule | None = None
    constant: bool = False

    def residual(self, x: Array, parameters: Array) -> Array:
        """Element residuals (n, ndof) at the global vector x."""
        return self.kernel.residual(self.coordinates, x[self.dofs], **self._given(parameters))

    def tangent(self, x: Array, parameters: Array) -> tuple[Array, Array]:
        """Element residuals (n, ndof) and tangents (n, ndof, ndof) at the global vector x."""
        return self.kernel.tangent(self.coordinates, x[self.dofs], **self._given(parameters))

    def _given(self, parameters: Array) -> dict[str, Any]:
        return {"data": self.data, "parameters": parameters, "rule": self.rule}

    def fields(self, x: Array, parameters: Array) -> dict[str, Array]:
        """Fields of the kernel at its quadrature points, name -> (n, points)."""
        values = self.kernel.fields_at(self.coordinates, x[self.dofs], **self._given(parameters))
        return {name: values[:, :, i] for i, name in enumerate(self.kernel.fields)}


@dataclass(frozen=True, eq=False)
class Pattern:
    """Sparsity of a matrix that element blocks share, compressed by columns.

    indptr (size + 1,), indices (nnz,): csc structure, every diagonal entry included, symmetric.
    diagonal: (size,) positions of the diagonal in the data. scatter: for each block the position
    (n * ndof * ndof,) of every element entry in the data.
    """

    size: int
    indptr: Integers
    indices: Integers
    diagonal: Integers
    scatter: tuple[Integers, ...]

    @property
    def nnz(self) -> int:
        """Number of stored entries."""
        return len(self.indices)

    def matrix(self, data: Array) -> csc_array[np.float64]:
        """The csc matrix with these data (nnz,); the structure is shared, not copied."""
        structure = (data, self.indices, self.indptr)
        return csc_array(structure, shape=(self.size, self.size), copy=False)


def build_pattern(size: int, dof_maps: Sequence[Integers]) -> Pattern:
    """Pattern of the matrix of order `size` to which elements with these dofs contribute."""
    keys = [np.arange(size) * (size + 1)]
    for dofs in dof_maps:
        if dofs.size and (dofs.min() < 0 or dofs.max() >= size):
            raise ValueError(f"a dof map points outside the {size} unknowns")
        keys.append((dofs[:, None, :] * size + dofs[:, :, None]).ravel())
    stored, where = np.unique(np.concatenate(keys), return_inverse=True)
    columns, rows = np.divmod(stored, size)
    indptr = np.concatenate([[0], np.cumsum(np.bincount(columns, minlength=size))])
    ends = np.cumsum([len(key) for key in keys])
    parts = tuple(where[a:b] for a, b in pairwise(ends))
    return Pattern(size, indptr.astype(np.int32), rows.astype(np.int32), where[:size], parts)


@dataclass(frozen=True, eq=False)
class Assembler:
    """Blocks of elements and the pattern they share; pure functions of x and parameters.

    Parameters are given block by block, in the kernel's order; a block without parameters is
    switched off, its place in the pattern stays. known: block name -> the latest parameters of a
    constant tangent, where it has entries and which.
    """

    size: int
    blocks: tuple[ElementBlock, ...]
    pattern: Pattern
    known: dict[str, tuple[Array, Integers, Array]] = field(default_factory=dict)

    @classmethod
    def build(cls, size: int, blocks: Sequence[ElementBlock]) -> Assembler:
        """Assembler of blocks over `size` unknowns; ValueError if two blocks share a name."""
        names = [block.name for block in blocks]
        if len(set(names)) < len(names):
            raise ValueError(f"two blocks have the same name: {', '.join(names)}")
        return cls(size, tuple(blocks), build_pattern(size, [block.dofs for block in blocks]))

    def block(self, name: str) -> ElementBlock:
        """The block of that name; KeyError if there is none."""
        for block in self.blocks:
            if block.name == name:
                return block
        raise KeyError(f"no block {name!r}; there are {', '.join(b.name for b in self.blocks)}")

    def residual(self, x: Array, parameters: Mapping[str, Array]) -> Array:
        """Sum of the element residuals, (size,)."""
        total = np.zeros(self.size)
        for block in self.blocks:
            if block.name in parameters:
                local = block.residual(x, parameters[block.name])
                total += self._scatter_vector(block, local)
        return total

    def linearise(
        self, x: Array, parameters: Mapping[str, Array]
    ) -> tuple[Array, csc_array[np.float64]]:
        """Residual (size,) and tangent (size, size), csc with the fixed pattern."""
        total, data = np.zeros(self.size), np.zeros(self.pattern.nnz)
        for block, scatter in zip(self.blocks, self.pattern.scatter, strict=True):
            if block.name not in parameters:
                continue
            if block.constant:
                local = block.residual(x, parameters[block.name])
                places, entries = self._constant(block, scatter, parameters[block.name])
                data[places] += entries
            else:
                local, tangents = block.tangent(x, parameters[block.name])
                self._add(data, scatter, tangents)
            total += self._scatter_vector(block, local)
        return total, self.pattern.matrix(data)

    def _add(self, data: Array, scatter: Integers, tangents: Array) -> None:
        """Add the entries of element tangents to the data, in place."""
        if _FEW * len(scatter) < len(data):
            np.add.at(data, scatter, tangents.ravel())
        else:  # faster, but it goes through all of the data
            data += np.bincount(scatter, weights=tangents.ravel(), minlength=len(data))

    def _constant(
        self, block: ElementBlock, scatter: Integers, parameters: Array
    ) -> tuple[Integers, Array]:
        """Places and values of the entries of a constant tangent."""
        known = self.known.get(block.name)
        if known is None or not np.array_equal(known[0], parameters):
            data = np.zeros(self.pattern.nnz)
            self._add(data, scatter, block.tangent(np.zeros(self.size), parameters)[1])
            places = np.flatnonzero(data)
            known = parameters.copy(), places, data[places]
            self.known[block.name] = known
        return known[1], known[2]

    def _scatter_vector(self, block: ElementBlock, local: Array) -> Array:
        summed = np.bincount(block.dofs.ravel(), weights=local.ravel(), minlength=self.size)
        return np.asarray(summed, dtype=np.float64)
