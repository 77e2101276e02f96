"""Residuals, products and linear solutions of a matrix-free tangent on a device.

The host has the state and sees two scalars of an iteration. Once a Newton step the state is moved
to the device; residual, moduli, diagonal and matrix of the lower order are computed there. The
hierarchy of that matrix is built on the host, and its levels are moved to the device. Loads,
springs and contact are evaluated on the host: vectors, and a sparse matrix on the device.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_array, diags_array

from softehl.errors import SoftehlError
from softehl.runtime.arrays import Array, Flags
from softehl.runtime.definition.problem_definition import StudyError
from softehl.runtime.device.device_block import DeviceBlock, SparsePattern, load_module
from softehl.runtime.device.device_module import DeviceModule
from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.element_blocks import ElementBlock
from softehl.runtime.discretisation.matrix_free_operator import (
    MatrixFreeOperator,
    level_in,
    random_vector,
)
from softehl.runtime.discretisation.matrix_free_products import lexicographic, require_product
from softehl.runtime.discretisation.p_multigrid import LOWER, MultigridLevels, cell_of, inverse
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.mesh.cells import CELLS
from softehl.runtime.solve.linear.amg import available, hierarchy
from softehl.runtime.solve.linear.coarse_grid_solver import DIRECT_BELOW, coarse_solver
from softehl.runtime.solve.linear.multigrid import Apply, MultigridCycle, MultigridLevel

MOST_RANDOMS = 32
"""Vectors of random numbers that stay on a device; those of algebraic multigrid change in size."""


@dataclass(frozen=True, eq=False)
class DeviceProduct:
    """The tangent of a block at a state u on the device.

    kept: moduli at the points, where a point calls routines: else they are computed in every
    product, from the geometry alone. single: the same in single precision, for preconditioners.
    """

    block: DeviceBlock
    u: Any
    kept: Any = None
    single: DeviceProduct | None = None

    @classmethod
    def of(cls, block: DeviceBlock, u: Any, single: DeviceBlock | None) -> DeviceProduct:
        """At u; single: the block in single precision."""
        kept = block.moduli(u) if block.module.source.routines else None
        low = None
        if single is not None:
            real = single.module.source.real
            low = cls(single, u.astype(real), None if kept is None else kept.astype(real))
        return cls(block, u, kept, low)

    @property
    def moduli(self) -> Any:
        """At the points."""
        return self.block.moduli(self.u) if self.kept is None else self.kept

    def there(self, x: Any, y: Any) -> None:
        """y += K x for vectors of the device."""
        if self.kept is None:
            self.block.product(self.u, x, y)
        else:
            self.block.product_of_moduli(self.kept, x, y)

    def __call__(self, x: Array, y: Array) -> None:
        """y += K x for vectors of the host."""
        n, module = len(self.u), self.block.module
        result = module.zeros(n)
        self.there(module.array(x[:n]), result)
        y[:n] += module.host(result)


@dataclass(eq=False)
class Device:
    """Backend on a device; what all states share is made once.

    name: "cuda" or "emulated". mixed: preconditioners are in single precision. load: function that
    makes the module of a kernel. modules, and singles in single precision: of a block.
    """

    name: str
    mixed: bool = False
    load: Callable[..., DeviceModule] = load_module
    modules: dict[str, DeviceModule] = field(default_factory=dict)
    singles: dict[str, DeviceModule] = field(default_factory=dict)
    patterns: dict[str, SparsePattern] = field(default_factory=dict)
    blocks: dict[str, tuple[ElementBlock, Array, DeviceBlock]] = field(default_factory=dict)
    single_blocks: dict[str, tuple[DeviceBlock, DeviceBlock]] = field(default_factory=dict)
    transfers: dict[tuple[int, str], tuple[csr_array, tuple[Any, Any]]] = field(
        default_factory=dict
    )
    randoms: dict[tuple[int, int, str], Any] = field(default_factory=dict)
    state: tuple[Array, Any] | None = None

    def require(self, block: ElementBlock) -> None:
        """Load the kernels of a block.  Raises StudyError where a device cannot run them."""
        try:
            self.modules[block.name] = self.load(require_product(block), self.name)
            if self.mixed:
                self.singles[block.name] = self.load(require_product(block), self.name, "float")
        except SoftehlError as error:
            raise StudyError(f"device = {self.name!r}: block {block.name!r}: {error}") from None

    def block(
        self, block: ElementBlock, parameters: Array, levels: MultigridLevels, size: int
    ) -> DeviceBlock:
        """The block there; size: of all unknowns."""
        name = block.name
        if name in self.blocks:
            known, given, made = self.blocks[name]
            if known.dofs is block.dofs and known.coordinates is block.coordinates:
                same = known.point_data is block.point_data and np.array_equal(given, parameters)
                if not same:
                    made = made.at(block, parameters)
                    self.blocks[name] = block, parameters.copy(), made
                return made
        made = DeviceBlock.of(
            block, parameters, self.modules[name], inverse(levels.unknowns[0], size)
        )
        self.blocks[name] = block, parameters.copy(), made
        return made

    def moved(self, x: Array, levels: MultigridLevels) -> Any:
        """x there, node by node; the last one is remembered."""
        if self.state is None or not np.array_equal(self.state[0], x):
            self.state = x.copy(), self.module.array(x[levels.unknowns[0]])
        return self.state[1]

    def problem(self, problem: Problem, levels: MultigridLevels) -> Problem:
        """See `Backend`."""
        a = problem.assembler
        there = DeviceAssembler(a.size, a.blocks, a.structure, a.memo, device=self, levels=levels)
        return replace(problem, assembler=there)

    def product(
        self, block: ElementBlock, x: Array, parameters: Array, levels: MultigridLevels
    ) -> DeviceProduct:
        """See `Backend`."""
        made = self.block(block, parameters, levels, len(x))
        return DeviceProduct.of(made, self.moved(x, levels), self._single(block.name, made))

    def _single(self, name: str, made: DeviceBlock) -> DeviceBlock | None:
        """A block in single precision, if there is one."""
        if not self.mixed:
            return None
        if name not in self.single_blocks or self.single_blocks[name][0] is not made:
            self.single_blocks[name] = made, made.converted(self.singles[name])
        return self.single_blocks[name][1]

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
        module, moduli = device.module, product.moduli
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

    def spaces(self, operator: MatrixFreeOperator) -> tuple[DeviceSpace, DeviceSpace]:
        """See `Backend`."""
        space = DeviceSpace(operator, self, self.module)
        if not self.mixed:
            return space, space
        return space, DeviceSpace(operator, self, next(iter(self.singles.values())))

    @property
    def module(self) -> DeviceModule:
        """Module of any block: all have the same arrays."""
        return next(iter(self.modules.values()))


@dataclass(eq=False)
class DeviceAssembler(Assembler):
    """Assembler whose residuals of pages are evaluated on a device, all others on the host."""

    device: Device = field(kw_only=True)
    levels: MultigridLevels = field(kw_only=True)

    def residual(self, x: Array, parameters: Mapping[str, Array]) -> Array:
        """See `Assembler`."""
        total = super().residual(x, self._of_host(parameters))
        self._add(x, parameters, total, None)
        return total

    def residual_and_size(self, x: Array, parameters: Mapping[str, Array]) -> tuple[Array, Array]:
        """See `Assembler`."""
        total, size = super().residual_and_size(x, self._of_host(parameters))
        self._add(x, parameters, total, size)
        return total, size

    def _of_host(self, parameters: Mapping[str, Array]) -> dict[str, Array]:
        return {n: p for n, p in parameters.items() if n not in self.device.modules}

    def _add(
        self, x: Array, parameters: Mapping[str, Array], total: Array, size: Array | None
    ) -> None:
        """Add the residuals of pages and their magnitudes."""
        module, numbers = self.device.module, self.levels.unknowns[0]
        u = self.device.moved(x, self.levels)
        sums = [(a, module.zeros(len(u))) for a in (total, size) if a is not None]
        for block in self.blocks:
            if block.name in self.device.modules and block.name in parameters:
                made = self.device.block(block, parameters[block.name], self.levels, self.size)
                made.residual(u, *(there for _, there in sums))
        for host, there in sums:
            host[numbers] += module.host(there)


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
    """Vectors on the device, in the precision of a module."""

    operator: MatrixFreeOperator
    device: Device
    module: DeviceModule

    @property
    def real(self) -> str:
        """Type of NumPy of its numbers."""
        return self.module.source.real

    def vector(self, a: Array) -> Any:
        """See `VectorSpace`."""
        return self.module.real(a)

    def converted(self, a: Any) -> Any:
        """See `VectorSpace`."""
        return a.astype(self.real)

    def matrix(self, A: csr_array) -> Any:
        """See `VectorSpace`."""
        return self.module.sparse(csr_array(A.astype(self.real)))

    def interpolation(self, level: int, P: csr_array) -> tuple[Any, Any]:
        """See `VectorSpace`."""
        kept, key = self.device.transfers, (level, self.real)
        if key not in kept or kept[key][0] is not P:
            kept[key] = P, (self.matrix(P), self.matrix(csr_array(P.T)))
        return kept[key][1]

    def random(self, n: int, number: int = 0) -> Any:
        """See `VectorSpace`."""
        kept, key = self.device.randoms, (n, number, self.real)
        if key not in kept:
            if len(kept) == MOST_RANDOMS:
                del kept[next(iter(kept))]
            kept[key] = self.vector(random_vector(n, number))
        return kept[key]

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
            own = product if self.module is self.device.module else product.single
            assert own is not None
            own.there(x, y)
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
                transfer = self.matrix(P), self.matrix(csr_array(P.T))
                levels.append(level_in(self, apply, matrix.diagonal(), transfer))
            A = csr_array(grids[-1].A)
        exact = coarse_solver(A, nullspace, block) if not levels else _dense(A)
        return MultigridCycle(levels, lambda b: self.vector(exact(self.host(b).astype(np.float64))))


def _dense(A: csr_array) -> Apply:
    """Solution by a pseudo-inverse, on the host."""
    inverse = np.linalg.pinv(A.toarray(), hermitian=True)
    return lambda b: np.asarray(inverse @ b)
