"""Element block on a device: its arrays there, and its kernels."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from softehl.device_arrays import by_blocks, sparse_pattern
from softehl.device_source import NodalFields
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.device import device_printer
from softehl.runtime.device.device_module import DeviceModule, device_module
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.matrix_free_products import lexicographic
from softehl.runtime.discretisation.p_multigrid import cell_of
from softehl.runtime.kernels.kernel import Kernel
from softehl.runtime.mesh.cells import CELLS


def load_module(kernel: Kernel, device: str, real: str = "double") -> DeviceModule:
    """Device kernels of a kernel.  Raises DeviceError, `TargetError`."""
    directory = kernel.library.directory
    return device_module(device_printer.device_source(directory, kernel.name, real), device)


def unknowns_by_order(kernel: Kernel, fields: Sequence[NodalFields]) -> list[Integers]:
    """Numbers (nodes, components) of the unknowns of an element, x running first in the nodes."""
    cell, found = CELLS[kernel.cell], []
    numbers = {place: k for k, place in enumerate(kernel.places)}
    for f in fields:
        nodes: list[int | None] = [None]
        if f.order:
            lower = cell_of(cell, f.order)
            distances = np.linalg.norm(cell.nodes[:, None] - lower.nodes[None], axis=2)
            nodes = [*map(int, distances.argmin(axis=0)[lexicographic(lower)])]
        found.append(np.array([[numbers[c, node] for c in f.components] for node in nodes]))
    return found


@dataclass(eq=False)
class DeviceBlock:
    """Arrays of a block on a device, in the order of its kernels.

    index: (n, nodes) places of the first unknown of each node in vectors, those of each order of
    the fields one after the other. places: of its coordinates in X, (m, dimension). history:
    (blocks, numbers, points of a block), or None. All methods take and return arrays of the device;
    vectors have the unknowns of a node as neighbours.
    """

    module: DeviceModule
    n: int
    index: Any
    places: Any
    X: Any
    parameters: Any
    history: Any

    @classmethod
    def of(
        cls, block: ElementBlock, parameters: Array, module: DeviceModule, position: Integers
    ) -> DeviceBlock:
        """position: place of each unknown of the system in the vectors."""
        kernel, source, n = block.kernel, module.source, len(block.dofs)
        assert isinstance(kernel, Kernel)
        order = lexicographic(CELLS[kernel.cell])
        first = np.concatenate([u[:, 0] for u in unknowns_by_order(kernel, source.fields)])
        X = block.coordinates.reshape(n, -1, source.dimension)[:, order]
        nodes = np.arange(X.shape[0] * X.shape[1]).reshape(X.shape[:2])
        return cls(
            module,
            n,
            module.array(position[block.dofs[:, first]].astype(np.int32)),
            module.array((nodes * X.shape[2]).astype(np.int32)),
            module.real(X.reshape(-1, X.shape[2])),
            module.real(np.append(parameters, 0.0)),
            cls._history(block, module),
        )

    def at(self, block: ElementBlock, parameters: Array) -> DeviceBlock:
        """These elements with parameters, and the history of `block`; they share the geometry."""
        assert self.geometry is not None
        other = copy(self)
        other.parameters = self.module.real(np.append(parameters, 0.0))
        other.history = self._history(block, self.module)
        return other

    def converted(self, module: DeviceModule) -> DeviceBlock:
        """These elements in the precision of another module; they share their places."""
        real = module.source.real
        history = None if self.history is None else self.history.astype(real)
        X, parameters = self.X.astype(real), self.parameters.astype(real)
        other = replace(self, module=module, X=X, parameters=parameters, history=history)
        other.geometry = self.geometry.astype(real)
        return other

    @staticmethod
    def _history(block: ElementBlock, module: DeviceModule) -> Any:
        """History with x running first in the points, block by block."""
        source = module.source
        if not source.history:
            return None
        n, q, D, k = len(block.dofs), source.line, source.dimension, source.history
        assert block.point_data is not None
        axes = (0, *range(D, 0, -1), D + 1)
        turned = block.point_data.reshape(n, *(q,) * D, k).transpose(axes)
        return module.real(by_blocks(turned.reshape(n, source.points, k), source.elements))

    def _kept(self, numbers: int) -> Any:
        source = self.module.source
        return self.module.zeros(source.blocks(self.n), numbers, source.elements * source.points)

    @cached_property
    def geometry(self) -> Any:
        """Inverse Jacobian and volume at the points."""
        kept = self._kept(self.module.source.geometry)
        self.module.launch("geometry", self.n, (self.places, self.X, kept))
        return kept

    def residual(self, u: Any, y: Any, sizes: Any = None) -> None:
        """y += residual at u; sizes += magnitudes of the residuals of elements."""
        arrays = self.parameters, self.history, self.index, self.places, self.X, u, sizes, y
        self.module.launch("residual", self.n, arrays)

    def product(self, u: Any, x: Any, y: Any) -> None:
        """y += K(u) x, with the geometry kept."""
        arrays = self.parameters, self.history, self.index, self.geometry, u, x, y
        self.module.launch("product_geometry", self.n, arrays)

    def product_recomputed(self, u: Any, x: Any, y: Any) -> None:
        """y += K(u) x, with nothing kept."""
        arrays = (self.parameters, self.history, self.index, self.places, self.X, u, x, y)
        self.module.launch("product", self.n, arrays)

    def moduli(self, u: Any) -> Any:
        """Moduli of the parent cell at the points."""
        kept = self._kept(self.module.source.moduli)
        arrays = self.parameters, self.history, self.index, self.places, self.X, u, kept
        self.module.launch("moduli", self.n, arrays)
        return kept

    def product_of_moduli(self, moduli: Any, x: Any, y: Any, *, transposed: bool = False) -> None:
        """y += K x, or K' x, of moduli."""
        swapped = transposed and not self.module.source.symmetric
        kernel = "product_transposed" if swapped else "product_moduli"
        self.module.launch(kernel, self.n, (moduli, self.index, x, y))

    def diagonal(self, moduli: Any, y: Any) -> None:
        """y += diagonal of K."""
        self.module.launch("diagonal", self.n, (moduli, self.index, y))

    def assemble(self, order: int, moduli: Any, pattern: SparsePattern, values: Any) -> None:
        """values += entries of P' K P, with P from the shape functions of an order."""
        arrays = moduli, pattern.low, pattern.rows, pattern.slots, values
        self.module.launch(f"assemble{order}", self.n, arrays)


@dataclass(frozen=True, eq=False)
class SparsePattern:
    """Places of the entries of elements in a CSR matrix.

    low: (n, k) first unknown of each node; rows: (size + 1,) start of every row; slots: (n, k, k)
    place in the row of the first node of the second one; all on the device. starts, columns: of the
    matrix, on the host.
    """

    low: Any
    rows: Any
    slots: Any
    starts: Integers
    columns: Integers

    @property
    def count(self) -> int:
        """Number of entries."""
        return len(self.columns)

    @classmethod
    def of(cls, nodes: Integers, first: Integers, module: DeviceModule) -> SparsePattern:
        """For elements with these nodes, (n, k); first: (nodes + 1,) first unknown of each."""
        rows, columns, slots = sparse_pattern(nodes, first)
        low = first[nodes].astype(np.int32)
        return cls(module.array(low), module.array(rows), module.array(slots), rows, columns)
