"""A tangent that is no matrix, and its solution by Krylov's methods with multigrid."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import coo_array, csr_array

from softehl.runtime.arrays import Array, Flags, Integers
from softehl.runtime.engines.levels import Levels
from softehl.runtime.fem.assembly import ElementBlock
from softehl.runtime.fem.problem import Problem
from softehl.runtime.fem.products import Product
from softehl.runtime.solve.coarse import coarse_solver
from softehl.runtime.solve.gradients import conjugate_gradients, minimal_residuals
from softehl.runtime.solve.linear import SingularMatrix
from softehl.runtime.solve.multigrid import Level, Multigrid


@dataclass(frozen=True, eq=False)
class Iteration:
    """Tolerance of the residual, relative to the right-hand side; iterations at most; counts of all
    solutions so far.
    """

    tolerance: float
    most: int
    counts: list[int] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Tangent:
    """The tangent at a state: products of pages, a matrix of loads and springs, and multigrid.

    rest: matrix of all blocks that are no pages, node by node as the first level has it.
    diagonals: of K, (n,). lower: K at the first lower level, without prescribed unknowns. free:
    whether an unknown is not prescribed. held: prescribed ones, and work: two vectors for products,
    node by node.
    """

    problem: Problem
    levels: Levels
    iteration: Iteration
    products: tuple[Product, ...]
    rest: csr_array
    diagonals: Array
    lower: csr_array
    free: Flags
    held: Integers
    work: tuple[Array, Array]

    @classmethod
    def of(cls, problem: Problem, levels: Levels, iteration: Iteration, x: Array) -> Tangent:
        """At x, (n,)."""
        free: Flags = np.ones(len(x), dtype=bool)
        free[problem.fixed] = False
        products, diagonal, rest = [], np.zeros(len(x)), csr_array((len(x), len(x)))
        count = levels.steps[0].shape[1]
        lower = csr_array((count, count))
        for block in problem.assembler.blocks:
            given = problem.parameters.get(block.name)
            if given is None or not len(block.dofs):
                continue
            if block.name in levels.places:
                products.append(Product.of(block, x, given, levels.places[block.name]))
                lower = lower + _projected(block, x, given, levels, free, diagonal)
            else:
                tangents = block.tangent(x, given)[1]
                rest = rest + _matrix(block.dofs, tangents, len(x))
        diagonal += rest.diagonal()
        order = levels.unknowns[0]
        if rest.nnz:
            rest = csr_array(rest)[order][:, order]
            P = _held(levels.steps[0], free[order], free[levels.unknowns[1]])
            lower = lower + P.T @ rest @ P
        found = csr_array(rest), diagonal, csr_array(lower), free, np.flatnonzero(~free[order])
        places = next(iter(levels.places.values()))
        work = places.vector(), places.vector()
        return cls(problem, levels, iteration, tuple(products), *found, work)

    def times(self, v: Array) -> Array:
        """K v, prescribed unknowns included."""
        order, y = self.levels.unknowns[0], np.empty_like(v)
        y[order] = self._product(v[order], self.held[:0])
        return y

    def _product(self, v: Array, held: Integers) -> Array:
        """K v node by node, where unknowns that are held do not move."""
        given, found = self.work
        x, y = given[: len(v)], found[: len(v)]
        x[:] = v
        x[held] = 0.0
        found.fill(0.0)
        for product in self.products:
            product(given, found)
        return y + self.rest @ x if self.rest.nnz else y.copy()

    def apply(self, v: Array) -> Array:
        """K v node by node, rows and columns of prescribed unknowns replaced by those of 1."""
        y = self._product(v, self.held)
        y[self.held] = v[self.held]
        return y

    def diagonal(self) -> Array:
        """Of K."""
        return self.diagonals

    def __abs__(self) -> _Bound:
        return _Bound(self)

    def loosest(self) -> None:
        """See `solve.held.Judging`: iterations that converged show that the matrix is regular."""

    def solve(self, r: Array) -> Array:
        """x of K x = r.  Raises SingularMatrix where the iteration does not get there."""
        given, cycle, order = self.iteration, self._multigrid(), self.levels.unknowns[0]
        if self._is_symmetric():
            found = conjugate_gradients(self.apply, cycle, r[order], given.tolerance, given.most)
        else:
            found = minimal_residuals(self.apply, cycle, r[order], given.tolerance, given.most)
        given.counts.append(found.iterations)
        # up to a negative curvature it is a direction of descent, which Newton's method may take
        if not (found.converged or found.negative) or not np.isfinite(found.x).all():
            raise SingularMatrix(
                f"matrix-free: no linear solution after {found.iterations} iterations: leave "
                "linear out, or take more steps"
            )
        x = np.empty_like(r)
        x[order] = found.x
        return x

    def _is_symmetric(self) -> bool:
        u, v = np.random.default_rng(0).uniform(-1.0, 1.0, (2, len(self.free)))
        Ku, Kv = self.apply(u), self.apply(v)
        size = np.linalg.norm(u) * np.linalg.norm(Kv)
        return bool(abs(u @ Kv - v @ Ku) <= 1e-10 * size)

    def _multigrid(self) -> Multigrid:
        levels, free = self.levels, [self.free[numbers] for numbers in self.levels.unknowns]
        diagonal = np.where(self.free, self.diagonals, 1.0)[levels.unknowns[0]]
        if not np.isfinite(diagonal).all():
            raise SingularMatrix("the tangent has entries that are not finite")
        found = [Level.of(self.apply, diagonal, _held(levels.steps[0], free[0], free[1]))]
        matrix = self.lower
        for k, step in enumerate(levels.steps[1:], start=1):
            P, A = _held(step, free[k], free[k + 1]), _with_ones(matrix, free[k])
            found.append(Level.of(A.__matmul__, A.diagonal(), P))
            matrix = csr_array(P.T @ matrix @ P)
        near = np.where(free[-1][:, None], levels.near, 0.0)
        lowest = coarse_solver(_with_ones(matrix, free[-1]), near, levels.components)
        return Multigrid(found, lowest)


@dataclass(frozen=True, eq=False)
class _Bound:
    """A bound of |K|: |K_ij| <= sqrt(K_ii K_jj) inside every element."""

    tangent: Tangent

    def __matmul__(self, x: Array) -> Array:
        problem = self.tangent.problem
        root = np.sqrt(np.abs(self.tangent.diagonals))
        root[problem.fixed] = 0.0
        return np.asarray(root * problem.assembler.around(root * x, problem.parameters))


def _projected(
    block: ElementBlock, x: Array, given: Array, levels: Levels, free: Flags, diagonal: Array
) -> csr_array:
    """The matrix at the lower order, and the diagonal of K, from the tangents of elements."""
    P, dofs = levels.transfers[block.name].whole(), levels.lower[block.name]
    found, at = np.empty((len(dofs), P.shape[1], P.shape[1])), 0
    for piece, _ in block.pieces(np.empty(0, dtype=np.int64)):
        tangents = piece.tangent(x, given)[1]
        np.add.at(diagonal, piece.dofs, np.einsum("nii->ni", tangents))
        mask = free[piece.dofs].astype(np.float64)
        held = P[None] * mask[:, :, None]
        found[at : at + len(mask)] = np.swapaxes(held, 1, 2) @ (tangents @ held)
        at += len(mask)
    mask = free[levels.unknowns[1]][dofs].astype(np.float64)
    found *= mask[:, :, None] * mask[:, None, :]
    return _matrix(dofs, found, len(levels.unknowns[1]))


def _matrix(dofs: Integers, tangents: Array, size: int) -> csr_array:
    """Assembled from the matrices (n, k, k) of elements."""
    k = dofs.shape[1]
    rows, columns = np.repeat(dofs, k, axis=1).ravel(), np.tile(dofs, k).ravel()
    return csr_array(coo_array((tangents.ravel(), (rows, columns)), (size, size)))


def _held(step: csr_array, upper: Flags, lower: Flags) -> csr_array:
    """Interpolation without rows and columns of prescribed unknowns."""
    scaled = step.multiply(upper.astype(np.float64)[:, None])
    return csr_array(scaled.multiply(lower.astype(np.float64)[None]))


def _with_ones(A: csr_array, free: Flags) -> csr_array:
    """With a typical number on the diagonal of prescribed unknowns."""
    typical = float(np.abs(A.diagonal()).mean()) or 1.0
    held = np.where(free, 0.0, typical)
    n = len(free)
    return csr_array(A + csr_array((held, (np.arange(n), np.arange(n))), (n, n)))
