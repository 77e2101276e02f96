"""Matrix-free tangent as a shell matrix of PETSc, with p-multigrid.

PETSc has the Krylov method, Chebyshev's smoothing and the cycle. Ours are the products, the
interpolation from the next lower order and the matrix there, which algebraic multigrid solves.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.sparse import coo_array

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.discretisation import matrix_free_operator as alone
from softehl.runtime.discretisation.assembly import Assembler
from softehl.runtime.discretisation.p_multigrid import MultigridLevels
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.mpi import petsc, world
from softehl.runtime.parallel.halo_exchange import HaloExchange
from softehl.runtime.parallel.matrix_free import TOLERANCE
from softehl.runtime.parallel.petsc_matrix import PetscSolver, SolverTimes
from softehl.runtime.solve.linear.coarse_grid_solver import DIRECT_BELOW
from softehl.runtime.solve.linear.multigrid import DEGREE


@dataclass(eq=False)
class MatrixFreeShell:
    """The tangent of a problem that is spread over processes; see `parallel.petsc_matrix.Tangent`.

    held: (k,) whether an own unknown is prescribed. ties: what moves, where there are none. local:
    the part of this process's elements. matrix: PETSc's. own: (k,) the diagonal.
    """

    problem: Problem
    levels: MultigridLevels
    exchange: HaloExchange
    constrained: Flags = field(init=False)
    ties: alone.TieForces = field(init=False)
    local: alone.MatrixFreeOperator = field(init=False)
    matrix: Any = field(init=False)
    own_diagonal: Array = field(init=False)

    def __post_init__(self) -> None:
        """An empty shell."""
        self.constrained = self.problem.constraints.prescribed[self.exchange.owned]
        self.ties = alone.TieForces.of(self.problem, self.levels)
        sizes = self.exchange.vector.getSizes()
        self.matrix = petsc().Mat().createPython((sizes, sizes), self, comm=world())
        self.matrix.setUp()

    def fill(
        self,
        assembler: Assembler,
        x: Array,
        parameters: Mapping[str, Array],
        defect: Array,
        times: SolverTimes,
    ) -> Array:
        """Evaluate all elements at x, (m,); their residuals with K times defect taken off, (m,)."""
        began, problem = time.perf_counter(), self.problem
        r = assembler.residual(x, parameters)
        once = alone.KrylovSettings(0.0, 0)
        self.local = alone.MatrixFreeOperator.of(problem, self.levels, once, self.ties, x)
        self.own_diagonal = self.exchange.added(self.local.diagonals)
        if defect.any():
            r -= self.local.times(defect)
        times.kernels += time.perf_counter() - began
        return r

    def mult(self, _: Any, source: Any, target: Any) -> None:
        """PETSc's call: a product, with ones for prescribed unknowns."""
        positions = self.exchange.positions
        x = self.exchange.local(source)
        x[self.problem.fixed] = 0.0
        y = self.exchange.added(self.local.times(x))
        target.array[positions] = np.where(self.constrained, source.array_r[positions], y)

    def getDiagonal(self, _: Any, target: Any) -> None:
        """PETSc's call."""
        target.array[self.exchange.positions] = np.where(self.constrained, 1.0, self.own_diagonal)

    def diagonal(self) -> Array:
        """Magnitudes of the diagonal of K, own rows, (k,)."""
        return np.where(self.constrained, 1.0, np.abs(self.own_diagonal))

    def times(self, x: Array) -> Array:
        """K times own values x, (k,): own rows, (k,)."""
        product = self.exchange.vector.duplicate()
        self.matrix.mult(self.exchange.to_petsc(x), product)
        return np.array(product.array_r[self.exchange.positions])

    def times_magnitudes(self, x: Array) -> Array:
        """A bound of |K| times own values x, (k,), at least 0: own rows, (k,)."""
        exchange, problem = self.exchange, self.problem
        root = np.where(self.constrained, 0.0, np.sqrt(np.abs(self.own_diagonal)))
        local = exchange.local(exchange.to_petsc(root * x))
        return np.asarray(
            root * exchange.added(problem.assembler.around(local, problem.parameters))
        )

    @property
    def rows(self) -> HaloExchange:
        """See `parallel.petsc_matrix.Operator`."""
        return self.exchange

    def solved(self, solver: PetscSolver, r: Array) -> Array:
        """See `parallel.petsc_matrix.Operator`."""
        return solver.solve(self, r)

    def empty_row(self) -> int:
        """None is known."""
        return -1

    def prepare(self, ksp: Any, nullspace: Any) -> None:
        """See `parallel.petsc_matrix.Tangent`."""
        ksp.setType("cg" if self._is_symmetric() else "gmres")
        ksp.setTolerances(rtol=TOLERANCE, max_it=1000)
        lower, step = self._lower(nullspace)
        pc = ksp.getPC()
        pc.setType("mg")
        pc.setMGLevels(2)
        pc.setMGInterpolation(1, step)
        above, below = pc.getMGSmoother(1), pc.getMGCoarseSolve()
        above.setType("chebyshev")
        above.getPC().setType("jacobi")
        above.setTolerances(max_it=DEGREE)
        above.setOperators(self.matrix, self.matrix)
        below.setType("preonly")
        if lower.getSize()[0] < DIRECT_BELOW:
            below.getPC().setType("lu")
            below.getPC().setFactorSolverType("mumps")
        else:
            below.getPC().setType("gamg")
        below.setOperators(lower, lower)

    def _is_symmetric(self) -> bool:
        numbers = np.random.default_rng(world().rank).uniform(-1.0, 1.0, (2, len(self.constrained)))
        u, v = (self.exchange.to_petsc(row) for row in numbers)
        Ku, Kv = u.duplicate(), v.duplicate()
        self.matrix.mult(u, Ku)
        self.matrix.mult(v, Kv)
        return bool(abs(u.dot(Kv) - v.dot(Ku)) <= 1e-10 * u.norm() * Kv.norm())

    def _lower(self, nullspace: Any) -> tuple[Any, Any]:
        """The matrix at the lower order, and the interpolation from there."""
        exchange, levels, free = self.exchange, self.levels, self.local.ties.constraints.free
        numbers, local = self._numbers()
        rows, sizes = levels.unknowns[0], (len(local), int(world().allreduce(len(local))))
        owned = np.zeros(len(exchange.numbers), dtype=bool)
        owned[exchange.owned] = True
        mask = owned[rows] & free[rows]
        step = coo_array(alone.without(levels.steps[0], mask) @ self.local.ties.levels[1].square)
        indices = exchange.numbers[rows[step.row]], numbers[step.col]
        P = _matrix(indices, step.data, (exchange.vector.getSizes(), sizes), 1)
        lower = coo_array(self.local.lower)
        typical = float(np.abs(lower.diagonal()).mean()) if lower.shape[0] else 1.0
        owned_lower = exchange.owned[local]
        ones = numbers[np.isin(levels.unknowns[1], owned_lower[~free[owned_lower]])]
        entries = np.append(numbers[lower.row], ones), np.append(numbers[lower.col], ones)
        values = np.append(lower.data, np.full(len(ones), typical))
        A = _matrix(entries, values, (sizes, sizes), levels.components if nullspace else 1)
        if nullspace is not None:
            A.setNearNullSpace(self._motions(A, nullspace, local))
        return A, P

    def _numbers(self) -> tuple[Integers, Integers]:
        """PETSc's number of each unknown of the lower level; own ones, by their numbers among own
        unknowns, in that order.
        """
        exchange, lower = self.exchange, self.levels.unknowns[1]
        mask = np.isin(exchange.owned, lower)
        local = np.flatnonzero(mask)
        return exchange.renumbered(mask)[0][lower], local[np.argsort(exchange.positions[local])]

    def _motions(self, A: Any, nullspace: Any, owned_local: Integers) -> Any:
        """The motions at the nodes of the lower level, made orthogonal."""
        vectors: list[Any] = []
        for vector in nullspace.getVecs():
            level_vector = A.createVecRight()
            level_vector.array[:] = vector.array_r[self.exchange.positions[owned_local]]
            for other in vectors:
                level_vector.axpy(-level_vector.dot(other), other)
            level_vector.normalize()
            vectors.append(level_vector)
        return petsc().NullSpace().create(vectors=vectors, comm=world())


def _matrix(positions: tuple[Integers, Integers], values: Array, sizes: Any, block: int) -> Any:
    """Of entries at PETSc's rows and columns, sums where there are several."""
    matrix = petsc().Mat().create(comm=world())
    matrix.setSizes(sizes, block)
    matrix.setType("aij")
    matrix.setPreallocationCOO(*(part.astype(petsc().IntType) for part in positions))
    matrix.setValuesCOO(values, petsc().InsertMode.INSERT_VALUES)
    return matrix
