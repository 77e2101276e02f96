"""Products and linear solutions of a matrix-free tangent on a device.

The host has the state and sees two scalars of an iteration. Once a Newton step the moduli are
computed on the device, and from them the diagonal and the matrix of the lower order; its hierarchy
is built on the host, and its levels are moved to the device. Loads, springs and contact are a
sparse matrix there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_array, diags_array

from softehl.errors import SoftehlError
from softehl.runtime.arrays import Array, Flags
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.device.device_block import DeviceBlock, SparsePattern, load_module
from softehl.runtime.device.device_module import DeviceModule
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.matrix_free_operator import MatrixFreeOperator, level_in
from softehl.runtime.discretisation.matrix_free_products import lexicographic, require_product
from softehl.runtime.discretisation.p_multigrid import LOWER, MultigridLevels, cell_of, inverse
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.solve.linear.amg import available, hierarchy
from softehl.runtime.solve.linear.coarse_grid_solver import DIRECT_BELOW, coarse_solver
from softehl.runtime.solve.linear.multigrid import Apply, MultigridCycle, MultigridLevel


@dataclass(frozen=True, eq=False)
class DeviceProduct:
    """The tangent of a block at a state u on the device."""

    block: DeviceBlock
    u: Any

    def there(self, x: Any, y: Any) -> None:
        """y += K x for vectors of the device."""
        self.block.product(self.u, x, y)

    def __call__(self, x: Array, y: Array) -> None:
        """y += K x for vectors of the host."""
        n, module = len(self.u), self.block.module
        result = module.zeros(n)
        self.there(module.array(x[:n]), result)
        y[:n] += module.host(result)


@dataclass(eq=False)
class Device:
    """Backend on a device; what all states share is made once.

    name: "cuda" or "emulated". load: function that makes the module of a kernel.
    """

    name: str
    load: Callable[..., DeviceModule] = load_module
    modules: dict[str, DeviceModule] = field(default_factory=dict)
    patterns: dict[str, SparsePattern] = field(default_factory=dict)
    blocks: dict[str, tuple[ElementBlock, DeviceBlock]] = field(default_factory=dict)

    def require(self, block: ElementBlock) -> None:
        """Load the kernels of a block.  Raises StudyError where a device cannot run them."""
        try:
            self.modules[block.name] = self.load(require_product(block), self.name)
        except SoftehlError as error:
            raise StudyError(f"device = {self.name!r}: block {block.name!r}: {error}") from None

    def product(
        self, block: ElementBlock, x: Array, parameters: Array, levels: MultigridLevels
    ) -> DeviceProduct:
        """See `Backend`."""
        module, numbers = self.modules[block.name], levels.unknowns[0]
        if block.name in self.blocks and _same_elements(self.blocks[block.name][0], block):
            made = self.blocks[block.name][1].at(block, parameters)
        else:
            made = DeviceBlock.of(block, parameters, module, inverse(numbers, len(x)))
            self.blocks[block.name] = block, made
        return DeviceProduct(made, module.array(x[numbers]))

    def coarse(
        self,
        block: ElementBlock,
        product: DeviceProduct,
        x: Array,
        levels: MultigridLevels,
        free: Flags,
    ) -> tuple[csr_array, Array]:
        """See `Backend`: from the moduli at the points."""
        device, numbers = product.block, levels.unknowns
        module, moduli = device.module, device.moduli(product.u)
        of_block, diagonal = module.zeros(len(product.u)), np.zeros(len(x))
        device.diagonal(moduli, of_block)
        diagonal[numbers[0]] = module.host(of_block)
        order = LOWER.get(CELLS[require_product(block).cell].order, 1)
        if block.name not in self.patterns:
            self.patterns[block.name] = _pattern(block, levels, order, module)
        pattern, size = self.patterns[block.name], len(numbers[1])
        values = module.zeros(pattern.count)
        device.assemble(order, moduli, pattern, values)
        matrix = csr_array((module.host(values), pattern.columns, pattern.starts), (size, size))
        mask = diags_array(free[numbers[1]].astype(np.float64))
        return csr_array(mask @ matrix @ mask), diagonal

    def space(self, operator: MatrixFreeOperator) -> DeviceSpace:
        """See `Backend`."""
        return DeviceSpace(operator, next(iter(self.modules.values())))


def _same_elements(a: ElementBlock, b: ElementBlock) -> bool:
    """True if only data and history of two blocks may differ."""
    return a.dofs is b.dofs and a.coordinates is b.coordinates


def _pattern(
    block: ElementBlock, levels: MultigridLevels, order: int, module: DeviceModule
) -> SparsePattern:
    """Of the nodes of the lower order, x running first."""
    lower = cell_of(CELLS[require_product(block).cell], order)
    dofs, components = levels.lower[block.name], levels.components
    first = dofs.reshape(len(dofs), -1, components)[:, lexicographic(lower), 0]
    unknowns = components * np.arange(len(levels.unknowns[1]) // components + 1)
    return SparsePattern.of(first // components, unknowns, module)


@dataclass(frozen=True, eq=False)
class DeviceSpace:
    """Vectors on the device of a module."""

    operator: MatrixFreeOperator
    module: DeviceModule

    def vector(self, a: Array) -> Any:
        """See `VectorSpace`."""
        return self.module.array(a)

    def matrix(self, A: csr_array) -> Any:
        """See `VectorSpace`."""
        return self.module.sparse(A)

    def host(self, a: Any) -> Array:
        """See `VectorSpace`."""
        host: Array = self.module.host(a)
        return host

    @cached_property
    def _loads(self) -> Any:
        loads = self.operator.loads_matrix
        return self.matrix(loads) if loads.nnz else None

    @cached_property
    def _places(self) -> tuple[Any, Any, Any]:
        """Constrained unknowns, slaves, and their masters."""
        constraints = self.operator.ties.levels[0]
        slaves = constraints.slaves
        arrays = self.operator.constrained, slaves, constraints.masters[slaves]
        constrained, followers, leaders = (self.module.array(a) for a in arrays)
        return constrained, followers, leaders

    def apply(self, v: Any) -> Any:
        """See `VectorSpace`."""
        constrained, slaves, masters = self._places
        x, y = v.copy(), self.module.zeros(len(v))
        x[constrained] = 0.0
        if len(slaves):
            x[slaves] = x[masters]
        for product in self.operator.products:
            assert isinstance(product, DeviceProduct)
            product.there(x, y)
        if self._loads is not None:
            y += self._loads @ x
        if len(slaves):
            self.module.xp.add.at(y, masters, y[slaves])
        y[constrained] = v[constrained]
        return y

    def coarse(self, A: csr_array, nullspace: Array, block: int) -> Apply:
        """See `VectorSpace`: levels of algebraic multigrid, smoothed on the device."""
        levels = list[MultigridLevel]()
        if A.shape[0] >= DIRECT_BELOW and available():
            grids = hierarchy(A, nullspace, block, light=True).levels
            for grid in grids[:-1]:
                matrix, P = csr_array(grid.A), csr_array(grid.P)
                apply = self.matrix(matrix).__matmul__
                levels.append(level_in(self, apply, matrix.diagonal(), P))
            A = csr_array(grids[-1].A)
        exact = coarse_solver(A, nullspace, block) if not levels else _dense(A)
        return MultigridCycle(levels, lambda b: self.vector(exact(self.host(b))))


def _dense(A: csr_array) -> Apply:
    """Solution by a pseudo-inverse, on the host."""
    inverse = np.linalg.pinv(A.toarray(), hermitian=True)
    return lambda b: np.asarray(inverse @ b)
