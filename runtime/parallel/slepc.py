"""Eigenproblems of the free unknowns on all processes: SLEPc, with factors of MUMPS."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csc_array

from softehl.runtime.arrays import Array
from softehl.runtime.discretisation.constraints import Constraints
from softehl.runtime.discretisation.reduced_tangent import symmetric
from softehl.runtime.mpi import petsc, slepc, world
from softehl.runtime.parallel.halo_exchange import HaloExchange, global_max, global_sum
from softehl.runtime.solve.eigen import (
    NoModes,
    below,
    buckling_factors,
    require_count,
    terms,
    without_rounding,
)
from softehl.runtime.solve.linear.linear_solver import SingularMatrix

_EXACT = 1e-11  # of eigenvalues
_PREFIX = "softehl_eigen_"


@dataclass(frozen=True, eq=False)
class Pencil:
    """Matrix pencil of the free unknowns, each matrix the sum of those of the processes (m, m)."""

    constraints: Constraints
    K: csc_array
    M: csc_array

    @property
    def exchange(self) -> HaloExchange:
        """Of free unknowns."""
        assert isinstance(self.constraints.exchange, HaloExchange)
        return self.constraints.exchange

    def lowest(self, count: int, saddle: int) -> tuple[Array, Array]:
        """See `solve.eigen.lowest`; vectors (count, m) of the unknowns of this process."""
        K, M = (self.constraints.gather(A.diagonal()) for A in (self.K, self.M))
        require_count(count, int(global_sum(np.array([float((M > 0.0).sum())]))[0]))
        ratio = global_max(float(np.abs(K[M > 0.0] / M[M > 0.0]).max(initial=0.0)))
        eps, factors = self._shifted(count)
        below(lambda shift: factors.at(eps, shift), self._nearly_singular, ratio, saddle)
        values, vectors = _eigenpairs(eps, count, "modes")
        mass, order = eps.getOperators()[1], np.argsort(values.real)[:count]
        modes = np.empty((len(order), len(self.constraints.free)))
        for mode, k in zip(modes, order, strict=True):
            # once more by the inverse: unknowns without mass follow from the others
            right, shape = vectors[k].duplicate(), vectors[k].duplicate()
            mass.mult(vectors[k], right)
            factors.ksp.solve(right, shape)
            mass.mult(shape, right)
            shape.scale(1.0 / np.sqrt(shape.dot(right)))
            mode[:] = self._local(shape)
        size = global_sum(terms(self.K, modes))
        return without_rounding(values.real[order], size), signed(modes)

    def factors(self, count: int) -> tuple[Array, Array]:
        """See `solve.eigen.smallest_factors` of K and M; vectors as in `lowest`."""
        eps = self._solver(count, -self._matrix(self.M), self._matrix(self.K))
        eps.setProblemType(slepc().EPS.ProblemType.GNHEP)
        eps.setWhichEigenpairs(slepc().EPS.Which.LARGEST_REAL)
        _factorised(eps.getST().getKSP(), "lu")
        values, vectors = _eigenpairs(eps, count, "buckling factors")
        factors, order = buckling_factors(values)
        modes = signed(np.stack([self._local(vectors[k]) for k in order[:count]]))
        sizes = [global_max(float(np.abs(mode).max(initial=0.0))) for mode in modes]
        return factors[:count], modes / np.array(sizes)[:, None]

    def _shifted(self, count: int) -> tuple[Any, _ShiftedFactors]:
        eps = self._solver(count, self._matrix(self.K), self._matrix(self.M))
        eps.setProblemType(slepc().EPS.ProblemType.GHEP)
        eps.setWhichEigenpairs(slepc().EPS.Which.TARGET_MAGNITUDE)
        eps.getST().setType("sinvert")
        ksp = eps.getST().getKSP()
        _factorised(ksp, "cholesky")
        return eps, _ShiftedFactors(ksp, self.exchange)

    def _solver(self, count: int, A: Any, B: Any) -> Any:
        eps = slepc().EPS().create(world())
        eps.setOptionsPrefix(_PREFIX)
        eps.setOperators(A, B)
        size = self.exchange.vector.getSize()
        eps.setDimensions(count, min(size, 2 * count + 20))
        eps.setTolerances(_EXACT)
        return eps

    def _matrix(self, A: csc_array) -> Any:
        """T' A T as a matrix of PETSc's."""
        PETSc, entries = petsc(), coo_array(symmetric(A))
        numbers = np.full(len(self.constraints.free), -1, dtype=PETSc.IntType)
        numbers[self.constraints.free] = self.exchange.numbers
        matrix, sizes = PETSc.Mat().create(comm=world()), self.exchange.vector.getSizes()
        matrix.setSizes((sizes, sizes), 1)
        matrix.setType("aij")
        matrix.setPreallocationCOO(numbers[entries.row], numbers[entries.col])
        matrix.setValuesCOO(entries.data, PETSc.InsertMode.INSERT_VALUES)
        return matrix

    def _local(self, vector: Any) -> Array:
        return self.constraints.expand(np.array(vector.array_r[self.exchange.positions]))

    def _nearly_singular(self, factors: _ShiftedFactors) -> bool:
        """See `solve.eigen.nearly_singular`."""
        b = np.random.default_rng(world().rank).uniform(-1.0, 1.0, len(self.exchange.owned))
        x = self.constraints.expand(factors.solve(b))
        size = self.constraints.gather(abs(self.K) @ np.abs(x))
        largest_entries = [global_max(float(np.abs(v).max(initial=0.0))) for v in (b, size)]
        return bool(largest_entries[0] <= 1e-11 * largest_entries[1])


@dataclass(frozen=True, eq=False)
class _ShiftedFactors:
    """Of a shifted matrix; see `solve.eigen.Pivots`."""

    ksp: Any
    exchange: HaloExchange

    def at(self, eps: Any, shift: float) -> _ShiftedFactors:
        """With another shift.  Raises SingularMatrix."""
        eps.setTarget(shift)
        eps.getST().setShift(shift)
        try:
            eps.setUp()
        except petsc().Error as error:
            raise SingularMatrix(f"no factors: {error}") from None
        return self

    @property
    def negative(self) -> int:
        """Number of negative eigenvalues."""
        return int(self.ksp.getPC().getFactorMatrix().getInertia()[0])

    def solve(self, b: Array) -> Array:
        """x of own values b."""
        source = self.exchange.to_petsc(b)
        target = source.duplicate()
        self.ksp.solve(source, target)
        return np.array(target.array_r[self.exchange.positions])


def _factorised(ksp: Any, kind: str) -> None:
    """Factors of MUMPS, which count signs of pivots where none are hidden (13), nor zero (24)."""
    for control in (13, 24):
        petsc().Options()[f"{_PREFIX}st_mat_mumps_icntl_{control}"] = 1
    ksp.setType("preonly")
    pc = ksp.getPC()
    pc.setType(kind)
    pc.setFactorSolverType("mumps")


def _eigenpairs(eps: Any, count: int, name: str) -> tuple[Array, list[Any]]:
    """Eigenvalues, complex ones, and vectors.  Raises NoModes, SingularMatrix."""
    eps.setFromOptions()
    try:
        eps.solve()
    except petsc().Error as error:
        raise SingularMatrix(f"no factors: {error}") from None
    n_converged = eps.getConverged()
    if n_converged < count:
        raise NoModes(f"{count} {name}: {n_converged} converged")
    vectors = [eps.getOperators()[0].createVecRight() for _ in range(n_converged)]
    return np.array([eps.getEigenpair(k, v) for k, v in enumerate(vectors)]), vectors


def signed(modes: Array) -> Array:
    """Modes (k, m) with the largest entry on any process positive."""
    extremes = [world().allgather(float(m[np.abs(m).argmax()]) if len(m) else 0.0) for m in modes]
    signs = np.array([np.sign(max(of_all, key=abs)) for of_all in extremes])
    return np.asarray(modes * signs[:, None])
